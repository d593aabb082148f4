#pragma once

#include <map>
#include <set>

#include "alidade/localize/config.h"
#include "alidade/localize/filter/filter.h"
#include "alidade/localize/filter/point_store.h"
#include "alidade/localize/frames/kept_frames.h"
#include "alidade/localize/path/path_smoother.h"

namespace alidade {

/// Whether the position of a point can be estimated: it is nearly linear. Without a target all depths are as uncertain
/// as the unit of length, and sufficient parallax is enough.
[[nodiscard]] bool is_settled(const Feature& feature, const LocalizationFilter& filter, const LocalizeConfig& config);

/// Maximum number of points in the smoother's equations at one time, for that many frames and a bounded run time.
[[nodiscard]] double max_points_at_once(std::size_t num_frames);

/// Where a run began, and when each point entered the map: input for smoothing the path at the end.
class ObservationRecord {
 public:
  /// The path begins at this frame, for the first time or after a restart.
  void begin(std::size_t frame);
  [[nodiscard]] std::size_t num_begun() const { return num_begun_; }
  [[nodiscard]] std::size_t begun() const { return last_begun_; }  ///< Frame of the last start.
  /// A point that returns keeps its first birth: its range now derives from its earlier observations.
  void entered(std::size_t frame, long id, const RangePrior& prior, bool comes_back) {
    if (!comes_back || !births_.contains(id)) births_[id] = {frame, prior};
  }
  void left(long id) { births_.erase(id); }
  /// The camera's pose at this frame does not follow from its motion.
  void jumped(std::size_t frame) { jumps_.insert(frame); }

  /// The same record, with frames renumbered to those that are kept.
  [[nodiscard]] ObservationRecord of_every(const KeptFrames& frames) const;

  /// All observations since the path began, with the filter's map as the initial guess. Backwards from the last frame,
  /// each pose is the one that explains most observations of the map, out of: the filter's, that of the following
  /// frame, or one estimated from the target alone. So wrong poses of a filter before its restart are forgotten, and
  /// frames before its first start are localised as long as the map is visible in them. Points that are not nearly
  /// linear yet are rejected: they determine little, and what they determine is not Gaussian. `gone`: points that left
  /// a full filter; their observations are used, too. `start`: the given first pose and motion. Points are skipped
  /// where the run time would be excessive; empty if too few are left or no point of the target was ever observed.
  /// `has_loops`: reserves room for points that are joined across the frames between.
  [[nodiscard]] std::optional<SmootherProblem> problem(const Camera& camera, const LocalizeConfig& config,
                                                       std::span<const ObservationFrame> frames,
                                                       std::span<const PathStep> path, const LocalizationFilter& filter,
                                                       std::span<const GonePoint> gone,
                                                       const std::optional<StartHypothesis>& start, double period_s,
                                                       bool has_loops = false) const;

 private:
  struct Birth {
    std::size_t frame = 0;
    RangePrior range;
  };
  void add_points(const LocalizeConfig& config, const LocalizationFilter& filter, SmootherProblem& problem) const;
  void give_frame(const LocalizeConfig& config, const std::optional<StartHypothesis>& start,
                  SmootherProblem& problem) const;
  void add_gone(const LocalizeConfig& config, std::span<const GonePoint> gone, SmootherProblem& problem) const;
  /// Without a target and a start, the assumed distances of the first points define the unit of length.
  [[nodiscard]] bool sets_unit(const LocalizeConfig& config, std::size_t frame) const {
    return config.target.points.empty() && !config.start && frame == last_begun_;
  }

  std::size_t first_frame_ = 0, last_begun_ = 0, num_begun_ = 0;
  std::map<long, Birth> births_;
  std::set<std::size_t> jumps_;
};

}  // namespace alidade
