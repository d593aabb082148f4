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

/// A pose has six components, a point two.
inline constexpr std::size_t min_observations = 3;
/// Known points, of three components each: the others need their part of the state.
inline constexpr std::size_t max_known_at_once = 100;

/// The estimator behind localize(): the filters, and the state kept from frame to frame. Two front ends drive it, one
/// for given observations, one that makes them from images.
class LocalizeEngine {
 public:
  /// `config` as resolved() gives it; it must live longer.
  LocalizeEngine(const Camera& camera, const LocalizeConfig& config) : camera_(camera), config_(config) {}

  [[nodiscard]] bool has_begun() const { return bank_.has_value(); }
  [[nodiscard]] const FilterBank* bank() const { return bank_ ? &*bank_ : nullptr; }
  [[nodiscard]] FilterBank& filters() { return *bank_; }
  [[nodiscard]] const LocalizationFilter& best() const { return bank_->best(); }
  [[nodiscard]] const Camera& camera() const { return camera_; }

  /// The start that was given, or where there is no target the first camera as the world; none: from the target.
  [[nodiscard]] std::optional<StartHypothesis> start_without_target() const;
  /// σ of an observation and of speeds, for poses from the target.
  [[nodiscard]] KnownPoseConfig pose_config() const;
  void begin(std::span<const StartHypothesis> starts, double t_s, const FilterBankConfig& bank);
  void end() { bank_.reset(); }
  /// With the observations of a frame.
  ObservationsReport update(std::span<const FeatureObservation> observations);
  /// In steps of a frame's period: accelerations are drawn again for each, also while frames are missing.
  void predict_to(double t_s, double period_s);
  /// Pose, and what became of the observations; of them the target's, where the filter says so.
  void fill(std::span<const FeatureObservation> observations, const ObservationsReport& report, PathStep& step) const;
  void fill_pose(PathStep& step) const;
  /// What the last frames with it say of the path.
  [[nodiscard]] Doubt doubt_after(const PathStep& step) { return doubt_.after(step); }
  void forget_doubt() { doubt_.clear(); }
  void count_restart() { ++num_restarts_; }
  /// Keeps residuals of an update, and at the end of a frame what is given to the filter.
  void keep_residuals(std::span<const FeatureObservation> observations, const ObservationsReport& report);
  void keep_given() { given_.add(best()); }

  /// What the run has to say of its whole, from `result.path`. `num_used`: how often a point was used.
  void sum_up(const std::function<std::size_t(long id)>& num_used, Localization& result) const;
  /// The same of `recent.path`, which has the steps since this was last asked.
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
