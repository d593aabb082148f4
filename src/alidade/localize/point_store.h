#pragma once

#include <map>
#include <optional>

#include "alidade/localize/filter.h"

namespace alidade {

/// What a run knows of points outside its filters: how often each was used or did not fit, and what is believed of the
/// depth of one that is to enter the state.
class PointStore {
 public:
  explicit PointStore(const LocalizeConfig& config) : config_(&config) {}

  /// Counts what became of an observation. True where the point has not fitted so often in a row that it should leave
  /// the map.
  bool is_stranger(long id, ObservationOutcome outcome);
  [[nodiscard]] std::size_t num_used(long id) const;
  /// Distance along the ray of a new point. None: not now (delayed, or the lens sees nothing there).
  [[nodiscard]] std::optional<RangePrior> prior_of(const FeatureObservation& observation,
                                                   const LocalizationFilter& filter);

 private:
  struct Point {
    std::size_t num_used = 0;
    int num_gated_in_a_row = 0;
    bool was_in_map = false;                     ///< What is given of its depth holds where it was first seen.
    std::optional<Rigid3> first_world_from_cam;  ///< Of a delayed one.
    Eigen::Vector3d first_ray_in_world = Eigen::Vector3d::Zero();
  };
  [[nodiscard]] std::optional<RangePrior> triangulated(const FeatureObservation& observation,
                                                       const LocalizationFilter& filter);
  [[nodiscard]] const GivenDepth* given_depth(long id) const;
  [[nodiscard]] double usual_depth_m(const LocalizationFilter& filter) const;

  const LocalizeConfig* config_;
  std::map<long, Point> points_;
};

}  // namespace alidade
