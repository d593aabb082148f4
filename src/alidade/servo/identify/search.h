#pragma once

#include <Eigen/Core>
#include <array>

#include "alidade/servo/config.h"

namespace alidade {

/// Where to look for a target that was lost: about where its motion, dying away, has carried it, on an Archimedean
/// spiral at constant speed whose turns overlap by less than an image. Allocates nothing.
class TargetSearch {
 public:
  /// `view_height_rad` is the image's height as an angle.
  TargetSearch(const SearchConfig& config, double view_height_rad)
      : config_(config), turn_rad_(config.turn_of_view * view_height_rad) {}

  /// The target was last believed there, at that time.
  void begin(double t_s, const std::array<Bearing, 2>& lost) {
    begin_s_ = t_s;
    lost_ = lost;
  }
  /// (pan, tilt) to look at.
  [[nodiscard]] Eigen::Vector2d at(double t_s) const;

 private:
  SearchConfig config_;
  double turn_rad_;
  double begin_s_ = 0.0;
  std::array<Bearing, 2> lost_{};
};

}  // namespace alidade
