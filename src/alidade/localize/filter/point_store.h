#pragma once

#include <map>
#include <optional>
#include <vector>

#include "alidade/localize/filter/filter.h"
#include "alidade/localize/localization.h"

namespace alidade {

/// A point as it was when it was removed from a full filter.
struct GonePoint {
  MapPoint point;
  bool is_linear = false;  ///< Its position can be estimated.
};

/// Bookkeeping of points outside the filters: how often each was used or rejected, and the depth prior for one that
/// enters the state.
class PointStore {
 public:
  explicit PointStore(const LocalizeConfig& config) : config_(&config) {}

  /// Counts the outcome of an observation in a frame. True if the point was gated so many times in a row that it
  /// should be removed from the map.
  bool is_stranger(long id, ObservationOutcome outcome, std::size_t frame);
  [[nodiscard]] std::size_t num_used(long id) const;
  /// The frame in which a point of the map was last used, or in which it entered.
  [[nodiscard]] std::size_t last_frame(long id) const;
  void entered(long id, std::size_t frame) { points_[id].last_frame = frame; }
  /// Keeps a point that leaves a full map: the prediction of its position when it is observed again.
  void keep(const GonePoint& point) { gone_[point.point.id] = point; }
  void forget_gone() { gone_.clear(); }
  [[nodiscard]] bool is_gone(long id) const { return gone_.contains(id); }
  /// The kept points that are not in the filter now.
  [[nodiscard]] std::vector<GonePoint> gone(const LocalizationFilter& filter) const;
  /// Prior distance along the ray of a new point. Empty if not available (delayed, or no ray for the pixel).
  [[nodiscard]] std::optional<RangePrior> prior_of(const FeatureObservation& observation,
                                                   const LocalizationFilter& filter);

 private:
  struct Point {
    std::size_t num_used = 0, last_frame = 0;
    int num_gated_in_a_row = 0;
    bool was_in_map = false;                     ///< Its given depth applies to the first observation only.
    std::optional<Rigid3> first_world_from_cam;  ///< For a delayed point.
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
