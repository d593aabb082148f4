#include "alidade/localize/engine.h"

#include <algorithm>
#include <cmath>
#include <utility>

#include "alidade/localize/checks/summary.h"

namespace alidade {

std::optional<StartHypothesis> LocalizeEngine::start_without_target() const {
  if (config_.start) return StartHypothesis{config_.start->motion, config_.start->cov};
  if (!config_.target.points.empty()) return std::nullopt;
  StartHypothesis origin;
  constexpr double sure = 1e-6;  // the world frame is the camera's; zero would leave no way to correct it
  origin.cov.diagonal().head<6>().setConstant(sure * sure);
  origin.cov.diagonal().segment<3>(6).setConstant(config_.sigma_speed_m_s * config_.sigma_speed_m_s);
  origin.cov.diagonal().tail<3>().setConstant(config_.sigma_rate_rad_s * config_.sigma_rate_rad_s);
  return origin;
}

KnownPoseConfig LocalizeEngine::pose_config() const {
  return {config_.filter.sigma_px, config_.sigma_speed_m_s, config_.sigma_rate_rad_s};
}

void LocalizeEngine::begin(std::span<const StartHypothesis> starts, double t_s, const FilterBankConfig& bank) {
  bank_.emplace(camera_, starts, config_.filter, bank);
  t_s_ = t_s;
}

/// Whether the known points alone determine frame and scale: nothing else is given of either, and all of them stay in
/// the filter. Depths too uncertain for hundreds of points to determine the scale beside a target do not count.
bool LocalizeEngine::is_frame_the_targets() const {
  constexpr double vague = 0.25;
  const bool has_depths = config_.depth_m && config_.sigma_depth < vague;
  return !config_.start && !has_depths && !config_.map && config_.target.points.size() <= max_known_at_once;
}

ObservationsReport LocalizeEngine::update(std::span<const FeatureObservation> observations) {
  const ObservationsReport report = bank_->update(observations);
  if (is_frame_the_targets()) bank_->fit_frame();
  return report;
}

void LocalizeEngine::predict_to(double t_s, double period_s) {
  constexpr int max_steps = 1000;  // long before that, σ is as large as the world
  const double gap_s = t_s - t_s_;
  const int num_steps = static_cast<int>(std::clamp(std::round(gap_s / period_s), 1.0, double{max_steps}));
  for (int i = 0; i < num_steps; ++i) bank_->predict(gap_s / num_steps);
  t_s_ = t_s;
}

void LocalizeEngine::fill(std::span<const FeatureObservation> observations, const ObservationsReport& report,
                          PathStep& step) const {
  step.num_tracked = report.num_used;
  step.num_gated = report.num_gated;
  if (report.num_used > 0) step.nis_per_dof = report.nis_per_dof;
  fill_pose(step);
  step.num_known = step.num_known_gated = 0;
  for (std::size_t i = 0; i < observations.size(); ++i) {
    const bool is_gated = report.outcomes[i] == ObservationOutcome::gated;
    if (!is_gated && report.outcomes[i] != ObservationOutcome::used) continue;
    const auto feature = std::ranges::find(best().features(), observations[i].id, &Feature::id);
    if (feature == best().features().end() || !feature->is_known) continue;
    ++step.num_known;
    step.num_known_gated += is_gated ? 1 : 0;
  }
}

void LocalizeEngine::fill_pose(PathStep& step) const {
  step.world_from_cam = best().motion().world_from_cam;
  step.cov = best().pose_covariance();
  step.num_features = best().features().size();
}

void LocalizeEngine::keep_residuals(std::span<const FeatureObservation> observations,
                                    const ObservationsReport& report) {
  residuals_.add(best(), observations, report.outcomes);
  recent_residuals_.add(best(), observations, report.outcomes);
}

void LocalizeEngine::sum_up(const std::function<std::size_t(long id)>& num_used, Localization& result) const {
  result.num_restarts = num_restarts_;
  result.given = given_.numbers();
  result.radial = residuals_.structure();
  alidade::sum_up(bank(), num_used, result);
}

void LocalizeEngine::sum_up_recent(const std::function<std::size_t(long id)>& num_used, Localization& recent) {
  recent.num_restarts =
      static_cast<std::size_t>(std::ranges::count(recent.path, FrameEvent::restarted, &PathStep::event));
  recent.radial = std::exchange(recent_residuals_, RadialResiduals()).structure();
  alidade::sum_up(bank(), num_used, recent);
  if (bank_) recent.given = given_.take_recent(best());
}

}  // namespace alidade
