#pragma once

#include <Eigen/Core>
#include <array>

#include "alidade/servo/config.h"

namespace alidade {

/// Search pattern for a lost target: around the position to which its decaying motion has carried it, on an Archimedean
/// spiral at constant speed whose turns overlap by less than an image. Allocates no memory.
class TargetSearch {
 public:
  /// `view_height_rad` is the angular height of the image.
  TargetSearch(const SearchConfig& config, double view_height_rad)
      : config_(config), turn_rad_(config.turn_of_view * view_height_rad) {}

  /// Last known position of the target, at that time.
  void begin(double t_s, const std::array<Bearing, 2>& lost) {
    begin_s_ = t_s;
    lost_ = lost;
  }
  /// (pan, tilt) to point at.
  [[nodiscard]] Eigen::Vector2d at(double t_s) const;

 private:
  SearchConfig config_;
  double turn_rad_;
  double begin_s_ = 0.0;
  std::array<Bearing, 2> lost_{};
};

}  // namespace alidade
