#pragma once

#include <map>
#include <optional>
#include <vector>

#include "alidade/localize/filter/filter.h"
#include "alidade/localize/localization.h"

namespace alidade {

/// A point as it was when it left a full filter.
struct GonePoint {
  MapPoint point;
  bool is_linear = false;  ///< Its position can be solved for.
};

/// Bookkeeping of points outside the filters: how often each was used or rejected, and the depth prior of one that is
/// to enter the state.
class PointStore {
 public:
  explicit PointStore(const LocalizeConfig& config) : config_(&config) {}

  /// Counts what became of an observation in a frame. True where the point has not fitted so often in a row that it
  /// should leave the map.
  bool is_stranger(long id, ObservationOutcome outcome, std::size_t frame);
  [[nodiscard]] std::size_t num_used(long id) const;
  /// The frame in which a point of the map was used last, or entered.
  [[nodiscard]] std::size_t last_frame(long id) const;
  void entered(long id, std::size_t frame) { points_[id].last_frame = frame; }
  /// What is known of a point that leaves a full map: where it will be looked for when it is seen again.
  void keep(const GonePoint& point) { gone_[point.point.id] = point; }
  void forget_gone() { gone_.clear(); }
  [[nodiscard]] bool is_gone(long id) const { return gone_.contains(id); }
  /// Those that are not in the filter now.
  [[nodiscard]] std::vector<GonePoint> gone(const LocalizationFilter& filter) const;
  /// Distance along the ray of a new point. None: not now (delayed, or the lens sees nothing there).
  [[nodiscard]] std::optional<RangePrior> prior_of(const FeatureObservation& observation,
                                                   const LocalizationFilter& filter);

 private:
  struct Point {
    std::size_t num_used = 0, last_frame = 0;
    int num_gated_in_a_row = 0;
    bool was_in_map = false;                     ///< What is given of its depth holds where it was first seen.
    std::optional<Rigid3> first_world_from_cam;  ///< Of a delayed one.
    Eigen::Vector3d first_ray_in_world = Eigen::Vector3d::Zero();
  };
  [[nodiscard]] std::optional<RangePrior> known_range(long id, const LocalizationFilter& filter) const;
  [[nodiscard]] std::optional<RangePrior> triangulated(const FeatureObservation& observation,
                                                       const LocalizationFilter& filter);
  [[nodiscard]] const GivenDepth* given_depth(long id) const;
  [[nodiscard]] double usual_depth_m(const LocalizationFilter& filter) const;

  const LocalizeConfig* config_;
  std::map<long, Point> points_;
  std::map<long, GonePoint> gone_;
};

}  // namespace alidade
