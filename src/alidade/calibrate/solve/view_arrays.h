#pragma once

#include <Eigen/Core>
#include <cstdint>
#include <vector>

#include "alidade/board/board_view.h"

namespace alidade {

/// The corners of one view as arrays, for the inner loop: pixel and whitener of each.
/// The whitener is the upper triangle (a b; 0 c) with WᵀW = inverse covariance; zero excludes the corner.
struct ViewArrays {
  std::vector<std::int32_t> index;
  std::vector<double> u_px, v_px;
  std::vector<double> white_a, white_b, white_c;

  [[nodiscard]] std::size_t size() const { return index.size(); }
};

/// Arrays of a view with identity whiteners.
[[nodiscard]] ViewArrays make_arrays(const BoardView& view);

/// Whitener of corner i for the covariance `cov` [px²], scaled by √weight.
void set_whitener(ViewArrays& view, std::size_t i, const Eigen::Matrix2d& cov, double weight);

}  // namespace alidade
