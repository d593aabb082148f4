#pragma once

#include <functional>
#include <optional>
#include <span>

#include "alidade/localize/checks/radial_residuals.h"
#include "alidade/localize/filter/filter_bank.h"
#include "alidade/localize/filter/given_numbers.h"
#include "alidade/localize/known_pose.h"
#include "alidade/localize/path/path_doubt.h"

namespace alidade {

/// A pose has six components, an observation two.
inline constexpr std::size_t min_observations = 3;
/// Known points in the filter, three components each: the other points need their part of the state.
inline constexpr std::size_t max_known_at_once = 100;

/// The estimator behind localize(): the filters, and the state kept from frame to frame. Two front ends drive it, one
/// for given observations, one that extracts them from images.
class LocalizeEngine {
 public:
  /// `config` as returned by resolved(); it must outlive this.
  LocalizeEngine(const Camera& camera, const LocalizeConfig& config) : camera_(camera), config_(config) {}

  [[nodiscard]] bool has_begun() const { return bank_.has_value(); }
  [[nodiscard]] const FilterBank* bank() const { return bank_ ? &*bank_ : nullptr; }
  [[nodiscard]] FilterBank& filters() { return *bank_; }
  [[nodiscard]] const LocalizationFilter& best() const { return bank_->best(); }
  [[nodiscard]] const Camera& camera() const { return camera_; }

  /// The given start, or without a target the first camera as the world frame; empty: the start is from the target.
  [[nodiscard]] std::optional<StartHypothesis> start_without_target() const;
  /// σ of an observation and of velocities, for poses from the target.
  [[nodiscard]] KnownPoseConfig pose_config() const;
  void begin(std::span<const StartHypothesis> starts, double t_s, const FilterBankConfig& bank);
  void end() { bank_.reset(); }
  /// Updates with the observations of a frame.
  ObservationsReport update(std::span<const FeatureObservation> observations);
  /// In steps of one frame period, each with independent accelerations, also across missing frames.
  void predict_to(double t_s, double period_s);
  /// Fills the pose and the numbers of used and gated observations, in total and of known points.
  void fill(std::span<const FeatureObservation> observations, const ObservationsReport& report, PathStep& step) const;
  void fill_pose(PathStep& step) const;
  /// Doubt about the path from the last frames, including this one.
  [[nodiscard]] Doubt doubt_after(const PathStep& step) { return doubt_.after(step); }
  void forget_doubt() { doubt_.clear(); }
  void count_restart() { ++num_restarts_; }
  /// Keeps residuals of an update and, at the end of a frame, the effect of the filter's given numbers.
  void keep_residuals(std::span<const FeatureObservation> observations, const ObservationsReport& report);
  void keep_given() { given_.add(best()); }

  /// Fills the summary of the run from `result.path`. `num_used`: how often a point was used.
  void sum_up(const std::function<std::size_t(long id)>& num_used, Localization& result) const;
  /// The same from `recent.path`, which contains the steps since the last call.
  void sum_up_recent(const std::function<std::size_t(long id)>& num_used, Localization& recent);

 private:
  [[nodiscard]] bool is_frame_the_targets() const;

  Camera camera_;
  const LocalizeConfig& config_;
  std::optional<FilterBank> bank_;
  double t_s_ = 0.0;
  PathDoubt doubt_;
  RadialResiduals residuals_, recent_residuals_;
  GivenTally given_;
  std::size_t num_restarts_ = 0;
};

}  // namespace alidade
