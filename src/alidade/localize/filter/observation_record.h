#pragma once

#include <map>
#include <set>

#include "alidade/localize/config.h"
#include "alidade/localize/filter/filter.h"
#include "alidade/localize/filter/point_store.h"
#include "alidade/localize/frames/kept_frames.h"
#include "alidade/localize/path/path_smoother.h"

namespace alidade {

/// Whether a point's position can be solved for: nearly linear; without a target all depths are as unsure as the unit
/// of length, and a parallax is enough.
[[nodiscard]] bool is_settled(const Feature& feature, const LocalizationFilter& filter, const LocalizeConfig& config);

/// Of so many frames, how many points may be in the smoother's equations at once for the work to stay in proportion.
[[nodiscard]] double max_points_at_once(std::size_t num_frames);

/// Where a run began, and when points entered its map: for smoothing the path at the end.
class ObservationRecord {
 public:
  /// The path begins at this frame, for the first time or again.
  void begin(std::size_t frame);
  [[nodiscard]] std::size_t num_begun() const { return num_begun_; }
  [[nodiscard]] std::size_t begun() const { return last_begun_; }  ///< The last time.
  /// A point that comes back was born when it entered first: its range now is what it said before.
  void entered(std::size_t frame, long id, const RangePrior& prior, bool comes_back) {
    if (!comes_back || !births_.contains(id)) births_[id] = {frame, prior};
  }
  void left(long id) { births_.erase(id); }
  /// The camera came to this frame by no motion.
  void jumped(std::size_t frame) { jumps_.insert(frame); }

  /// The same by the numbers of the frames that are kept.
  [[nodiscard]] ObservationRecord of_every(const KeptFrames& frames) const;

  /// All that was seen since the path began, with the filter's map to begin at. Backwards from the last frame, each
  /// pose is the one that explains most of the map's observations: the filter's, that of the frame after it, or one of
  /// the target's alone; so that what a filter took for its pose before it began again is forgotten, and frames before
  /// it began at all are localised as far as the map is seen in them. Points that are not nearly linear yet are
  /// rejected: they determine little, and what they determine is not Gaussian. `gone`: points that left a full filter;
  /// their observations are used, too. `start`: what was given of the first pose. Points are skipped where the work
  /// would be out of proportion; none where that leaves too few, or a target's points were never seen. `has_loops`:
  /// room is left for points that are joined over the time between.
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
  /// Without a target and a start the supposed distances of the first points are the unit of length.
  [[nodiscard]] bool sets_unit(const LocalizeConfig& config, std::size_t frame) const {
    return config.target.points.empty() && !config.start && frame == last_begun_;
  }

  std::size_t first_frame_ = 0, last_begun_ = 0, num_begun_ = 0;
  std::map<long, Birth> births_;
  std::set<std::size_t> jumps_;
};

}  // namespace alidade
