#pragma once

#include <vector>

#include "alidade/localize/filter/point_episodes.h"
#include "alidade/localize/filter/point_store.h"
#include "alidade/localize/map/repeated_places.h"
#include "alidade/localize/path/whole_path.h"
#include "alidade/localize/usual_gap.h"

namespace alidade {

/// The front end for observations of numbered points: decides which points enter and leave the map, and when the target
/// contradicts the path; smooths the path at the end.
class ObservationLocalizer {
 public:
  /// `config` as returned by resolved(); it must outlive this.
  ObservationLocalizer(const Camera& camera, const LocalizeConfig& config)
      : engine_(camera, config),
        config_(config),
        points_(config),
        frames_(static_cast<std::size_t>(config.max_smoothed)) {}

  PathStep take(const ObservationFrame& frame);
  /// `result` contains the path; the rest is filled in, and the path is smoothed.
  void sum_up(Localization& result) const;
  /// Summary by the filter of the frames in its path, those since the last call.
  void sum_up_recent(Localization& recent);
  /// The frames as kept for smoothing.
  [[nodiscard]] const std::vector<ObservationFrame>& frames() const { return frames_.frames(); }
  /// The same with the points' own numbers.
  [[nodiscard]] std::vector<ObservationFrame> numbered_frames() const;

 private:
  [[nodiscard]] double period_s() const;
  void keep_gap(double t_s);
  [[nodiscard]] ObservationFrame numbered(ObservationFrame frame);
  [[nodiscard]] PathStep taken(const ObservationFrame& frame);
  [[nodiscard]] bool start(const ObservationFrame& frame);
  /// In observation_repeats.cpp.
  [[nodiscard]] bool shows_last(const ObservationFrame& frame);
  [[nodiscard]] bool should_move(const ObservationFrame& frame) const;
  [[nodiscard]] PathStep passed_over(const ObservationFrame& frame);
  [[nodiscard]] FrameEvent come_to(const ObservationFrame& frame);
  void add_new(const ObservationFrame& frame);
  void enter_known(const ObservationFrame& frame);
  [[nodiscard]] bool has_room() const;
  [[nodiscard]] double value_of(const Feature& feature) const;
  [[nodiscard]] std::vector<long> least_useful(const ObservationFrame& frame) const;
  void let_go(long id);
  void drop_strangers(const ObservationFrame& frame, const ObservationsReport& report);
  [[nodiscard]] bool is_vague(const ObservationFrame& frame) const;
  void drop_map();
  void place_by_target(const ObservationFrame& frame);
  [[nodiscard]] double contradiction_of(const StartHypothesis& from) const;
  [[nodiscard]] std::vector<StartHypothesis> elsewhere(const ObservationFrame& frame);
  [[nodiscard]] int num_explained(const ObservationFrame& frame, const Rigid3& world_from_cam) const;
  [[nodiscard]] bool is_no_chance(const ObservationFrame& frame, std::span<const StartHypothesis> from, Doubt doubt);
  /// Whether neither the frame nor the scale of the world is given.
  [[nodiscard]] bool is_free() const { return !config_.start && config_.target.points.empty(); }
  [[nodiscard]] bool begin_again(Doubt doubt);
  [[nodiscard]] bool restart(const ObservationFrame& frame, Doubt doubt);
  /// Camera poses from the target that contradict the path.
  struct OtherPlace {
    std::vector<StartHypothesis> from;
    std::size_t num_explained = 0;  ///< Observations of firm points explained from there.
    FilterBank before;              ///< The filters before this frame.
  };
  [[nodiscard]] std::optional<OtherPlace> other_place(const ObservationFrame& frame) const;
  [[nodiscard]] bool is_firm(long id) const;
  [[nodiscard]] bool is_there(const StartHypothesis& there, const Rigid3& found) const;
  [[nodiscard]] bool find_again(OtherPlace other, const ObservationFrame& frame, const ObservationsReport& report);
  void heed_doubt(const ObservationFrame& frame, std::optional<OtherPlace> other, Doubt doubt,
                  const ObservationsReport& report, PathStep& step);

  [[nodiscard]] Recording recording(const KeptFrames& frames) const;
  /// A path, and the frames from which it was solved, if these are not all.
  struct Solution {
    WholePath whole;
    std::optional<KeptFrames> few;
    bool is_of_known = false;  ///< From known points only.
  };
  [[nodiscard]] std::optional<Solution> solved(Localization& result) const;

  LocalizeEngine engine_;
  const LocalizeConfig& config_;
  PointStore points_;
  PointEpisodes episodes_;
  ObservationRecord record_;
  KeptFrames frames_;                 ///< Input of path smoothing.
  std::map<long, KnownPoint> known_;  ///< Known points, if too many to be in the filter at once.
  UsualGap gap_;                      ///< Between frames, if their period is not given.
  double t_s_ = 0.0;                  ///< Of the last frame.
  std::size_t num_taken_ = 0;         ///< Number of frames.
  std::vector<FeatureObservation> last_seen_;
  std::size_t num_repeated_ = 0;  ///< Frames identical to the one before.
  std::size_t num_left_ = 0;      ///< How often a point left a full filter.
  RepeatedPlaces elsewhere_;
  std::size_t num_known_ = 0, num_known_gated_ = 0;  ///< Of the target's observations, at accepted poses.
};

}  // namespace alidade
