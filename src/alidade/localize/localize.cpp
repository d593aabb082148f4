#include "alidade/localize/localize.h"

#include <Eigen/LU>
#include <algorithm>
#include <cmath>
#include <map>
#include <set>

#include "alidade/localize/given_numbers.h"
#include "alidade/localize/observation_record.h"
#include "alidade/localize/path_doubt.h"
#include "alidade/localize/point_store.h"
#include "alidade/localize/summary.h"

namespace alidade {
namespace {

constexpr std::size_t min_observations = 3;  // a pose has six numbers, a point two

/// One run: the filters, what is known of points outside them, and when to start again.
class Localizer {
 public:
  Localizer(const Camera& camera, const LocalizeConfig& config, double period_s)
      : camera_(camera), config_(config), points_(config), period_s_(period_s) {}

  PathStep take(const ObservationFrame& frame);
  [[nodiscard]] const FilterBank* bank() const { return bank_ ? &*bank_ : nullptr; }
  [[nodiscard]] std::size_t num_restarts() const { return num_restarts_; }
  [[nodiscard]] const PointStore& points() const { return points_; }
  [[nodiscard]] const RadialResiduals& residuals() const { return residuals_; }
  [[nodiscard]] const ObservationRecord& record() const { return record_; }
  [[nodiscard]] const GivenTally& given() const { return given_; }
  [[nodiscard]] double period_s() const { return period_s_; }

 private:
  [[nodiscard]] std::vector<StartHypothesis> starts(const ObservationFrame& frame) const;
  [[nodiscard]] KnownPoseConfig pose_config() const {
    return {config_.filter.sigma_px, config_.sigma_speed_m_s, config_.sigma_rate_rad_s};
  }
  [[nodiscard]] PathStep taken(const ObservationFrame& frame);
  bool start(const ObservationFrame& frame);
  void predict_to(double t_s);
  void add_new(const ObservationFrame& frame);
  void drop_strangers(const ObservationFrame& frame, const ObservationsReport& report);
  [[nodiscard]] std::vector<StartHypothesis> elsewhere(const ObservationFrame& frame) const;
  [[nodiscard]] int num_more_explained(const ObservationFrame& frame, const Rigid3& world_from_cam) const;
  bool restart(const ObservationFrame& frame, Doubt doubt);
  void fill(const ObservationFrame& frame, const ObservationsReport& report, PathStep& step) const;

  Camera camera_;
  const LocalizeConfig& config_;
  std::optional<FilterBank> bank_;
  PointStore points_;
  double period_s_, t_s_ = 0.0, seen_s_ = 0.0;
  PathDoubt doubt_;
  int num_elsewhere_ = 0;  ///< Frames in a row in which the target says that the camera is somewhere else.
  RadialResiduals residuals_;
  ObservationRecord record_;
  GivenTally given_;
  std::size_t num_taken_ = 0;  ///< Frames.
  std::size_t num_restarts_ = 0;
};

/// A start that was told, or the poses from which the target looks so; without a target the first camera is the world.
std::vector<StartHypothesis> Localizer::starts(const ObservationFrame& frame) const {
  if (config_.start) return {*config_.start};
  if (!config_.target.empty()) return poses_from_known(camera_, frame.observations, config_.target, pose_config());
  if (frame.observations.size() < min_observations) return {};
  StartHypothesis origin;
  constexpr double sure = 1e-6;  // the world is where the camera is; zero would leave no way to correct it
  origin.cov.diagonal().head<6>().setConstant(sure * sure);
  origin.cov.diagonal().segment<3>(6).setConstant(config_.sigma_speed_m_s * config_.sigma_speed_m_s);
  origin.cov.diagonal().tail<3>().setConstant(config_.sigma_rate_rad_s * config_.sigma_rate_rad_s);
  return {origin};
}

bool Localizer::start(const ObservationFrame& frame) {
  std::vector<StartHypothesis> from = starts(frame);
  if (from.empty()) return false;
  if (!config_.start && !config_.target.empty()) from = only_where(std::move(from));
  bank_.emplace(camera_, from, config_.filter, config_.bank);
  for (const KnownPoint& point : config_.target) bank_->add_known(point.id, point.point_in_world, point.sigma_m);
  t_s_ = seen_s_ = frame.t_s;
  record_.begin(num_taken_);
  return true;
}

/// In steps of a frame's period: accelerations are drawn anew for each, also while frames are missing.
void Localizer::predict_to(double t_s) {
  constexpr int max_steps = 1000;  // σ is as large as the world long before
  const double gap_s = t_s - t_s_;
  const int num_steps = std::clamp(static_cast<int>(std::lround(gap_s / period_s_)), 1, max_steps);
  for (int i = 0; i < num_steps; ++i) bank_->predict(gap_s / num_steps);
  t_s_ = t_s;
}

void Localizer::add_new(const ObservationFrame& frame) {
  for (const FeatureObservation& observation : frame.observations) {
    if (bank_->best().has(observation.id)) continue;
    const auto prior = points_.prior_of(observation, bank_->best());
    if (!prior) continue;
    const FeatureKind kind = config_.new_points == NewPoints::xyz ? FeatureKind::xyz : FeatureKind::inverse_depth;
    if (bank_->add(observation.id, observation.px, *prior, kind)) record_.entered(num_taken_, observation.id, *prior);
  }
}

/// Points that do not fit several times in a row leave; they may come again.
void Localizer::drop_strangers(const ObservationFrame& frame, const ObservationsReport& report) {
  for (std::size_t i = 0; i < frame.observations.size(); ++i) {
    if (!points_.is_stranger(frame.observations[i].id, report.outcomes[i])) continue;
    bank_->remove(frame.observations[i].id);
    record_.left(frame.observations[i].id);
  }
}

/// Where the camera is by the target, if that contradicts the path. Empty: it does not, or its observations fit no
/// pose.
std::vector<StartHypothesis> Localizer::elsewhere(const ObservationFrame& frame) const {
  std::vector<StartHypothesis> from = poses_from_known(camera_, frame.observations, config_.target, pose_config());
  if (from.empty()) return from;
  const LocalizationFilter& now = bank_->best();
  const CameraMotion& is = now.motion();
  Eigen::Vector<double, 6> difference;
  difference.head<3>() = from.front().motion.world_from_cam.translation - is.world_from_cam.translation;
  difference.tail<3>() = log_so3(is.world_from_cam.rotation.conjugate() * from.front().motion.world_from_cam.rotation);
  const Eigen::Matrix<double, 6, 6> cov =
      now.motion_covariance().topLeftCorner<6, 6>() + from.front().cov.topLeftCorner<6, 6>();
  constexpr double gate = 22.5;  // χ² of six numbers: 99.9 %
  if (difference.dot(cov.inverse() * difference) < gate) from.clear();
  return from;
}

/// Of the target's observations, how many more a pose explains than the path does.
int Localizer::num_more_explained(const ObservationFrame& frame, const Rigid3& world_from_cam) const {
  const double gate_px2 = 4.0 * config_.filter.gate * config_.filter.sigma_px * config_.filter.sigma_px;
  const Rigid3& now = bank_->best().motion().world_from_cam;
  int num_more = 0;
  for (const FeatureObservation& observation : frame.observations) {
    const auto known = std::ranges::find(config_.target, observation.id, &KnownPoint::id);
    if (known == config_.target.end()) continue;
    const auto is_near = [&](const Rigid3& pose) {
      const auto px = project(camera_, pose.inverse() * known->point_in_world);
      return px && (*px - observation.px).squaredNorm() < gate_px2 ? 1 : 0;
    };
    num_more += is_near(world_from_cam) - is_near(now);
  }
  return num_more;
}

/// From the target, where it says that the camera is somewhere else. Mismatches may look like another pose: where the
/// observations that fit are not contradicted by themselves, it has to explain at least two more of the target's, and
/// where there is only some doubt three times running. The map of points that led there is dropped.
bool Localizer::restart(const ObservationFrame& frame, Doubt doubt) {
  constexpr int sure = 3, min_more = 2;
  std::vector<StartHypothesis> from = doubt == Doubt::none ? std::vector<StartHypothesis>{} : elsewhere(frame);
  if (!from.empty() && doubt != Doubt::strong &&
      num_more_explained(frame, from.front().motion.world_from_cam) < min_more)
    from.clear();
  num_elsewhere_ = from.empty() ? 0 : num_elsewhere_ + 1;
  if (from.empty() || (doubt == Doubt::some && num_elsewhere_ < sure)) return false;
  std::vector<long> unknown;
  for (const Feature& feature : bank_->best().features())
    if (!feature.is_known) unknown.push_back(feature.id);
  for (const long id : unknown) bank_->remove(id);
  bank_->restart(only_where(from));
  record_.begin(num_taken_);
  doubt_.clear();
  num_elsewhere_ = 0;
  ++num_restarts_;
  return true;
}

void Localizer::fill(const ObservationFrame& frame, const ObservationsReport& report, PathStep& step) const {
  step.num_tracked = report.num_used;
  step.num_gated = report.num_gated;
  if (report.num_used > 0) step.nis_per_dof = report.nis_per_dof;
  const LocalizationFilter& filter = bank_->best();
  step.world_from_cam = filter.motion().world_from_cam;
  step.cov = filter.pose_covariance();
  step.num_features = filter.features().size();
  step.num_known = step.num_known_gated = 0;
  for (std::size_t i = 0; i < frame.observations.size(); ++i) {
    const bool is_gated = report.outcomes[i] == ObservationOutcome::gated;
    if (!is_gated && report.outcomes[i] != ObservationOutcome::used) continue;
    if (std::ranges::find(config_.target, frame.observations[i].id, &KnownPoint::id) == config_.target.end()) continue;
    ++step.num_known;
    step.num_known_gated += is_gated ? 1 : 0;
  }
}

PathStep Localizer::take(const ObservationFrame& frame) {
  PathStep step = taken(frame);
  ++num_taken_;
  return step;
}

PathStep Localizer::taken(const ObservationFrame& frame) {
  PathStep step;
  step.frame = frame.frame;
  step.t_s = frame.t_s;
  step.num_seen = frame.observations.size();
  step.event = FrameEvent::tracked;
  if (!bank_) {
    if (!start(frame)) {
      step.event = FrameEvent::waiting;
      return step;
    }
    step.event = FrameEvent::started;
  } else {
    predict_to(frame.t_s);
  }
  const ObservationsReport report = bank_->update(frame.observations);
  fill(frame, report, step);
  residuals_.add(bank_->best(), frame.observations, report.outcomes);
  if (step.event == FrameEvent::tracked && step.num_tracked < min_observations) step.event = FrameEvent::predicted;
  const Doubt doubt = doubt_.after(step);
  drop_strangers(frame, report);
  if (config_.restarts && restart(frame, doubt)) {
    const ObservationsReport again = bank_->update(frame.observations);
    fill(frame, again, step);
    step.event = FrameEvent::restarted;
  }
  if (step.num_tracked >= min_observations || step.event == FrameEvent::started) add_new(frame);
  bank_->convert_linear();
  given_.add(bank_->best());
  return step;
}

/// The usual time between frames: the median.
double period_of(std::span<const ObservationFrame> frames) {
  std::vector<double> gaps;
  for (std::size_t i = 1; i < frames.size(); ++i) gaps.push_back(frames[i].t_s - frames[i - 1].t_s);
  if (gaps.empty()) return 1.0;
  std::ranges::nth_element(gaps, gaps.begin() + static_cast<std::ptrdiff_t>(gaps.size() / 2));
  return std::max(gaps[gaps.size() / 2], 1e-9);
}

/// The state is made as large as these frames can need.
LocalizeConfig sized(const LocalizeConfig& given, std::span<const ObservationFrame> frames) {
  LocalizeConfig config = given;
  std::set<long> ids;
  std::size_t most = 1;
  for (const ObservationFrame& frame : frames) {
    for (const FeatureObservation& observation : frame.observations) ids.insert(observation.id);
    most = std::max(most, frame.observations.size());
  }
  for (const KnownPoint& point : config.target) ids.insert(point.id);
  const auto need = motion_dim + config.filter.lens_params.size() + 6 * ids.size() + 8;
  config.filter.state_capacity =
      std::min(config.filter.state_capacity, static_cast<int>(std::min<std::size_t>(need, 1 << 20)));
  config.filter.sigma_scale = config.sigma_scale;
  config.filter.observations_capacity =
      std::min(config.filter.observations_capacity, static_cast<int>(std::min<std::size_t>(most, 1 << 20)));
  return config;
}

/// Errors that last from frame to frame by an autoregression of first order: so many fewer are independent.
void enlarge(SmoothedPath& smoothed, const ResidualStructure& residuals) {
  if (!residuals.has_colour()) return;
  const double correlation = std::min(residuals.colour, 0.95), factor = (1.0 + correlation) / (1.0 - correlation);
  for (auto& cov : smoothed.cov) cov *= factor;
  for (auto& cov : smoothed.point_covs) cov *= factor;
  smoothed.sigma_lens *= std::sqrt(factor);
}

/// What of each frame fits the smoothed path: frames that the filter had lost may be held by their observations there.
void judge_frames(const SmoothedPath& smoothed, std::size_t first_frame, std::span<const ObservationFrame> frames,
                  LocalizeReport& report) {
  std::vector<std::size_t> num_fit(report.path.size(), 0);
  for (const PlacedResidual& residual : smoothed.residuals) ++num_fit[first_frame + residual.frame];
  for (std::size_t k = first_frame; k < report.path.size(); ++k) {
    PathStep& step = report.path[k];
    const bool was_lost = step.event == FrameEvent::predicted || step.event == FrameEvent::waiting;
    if (was_lost && num_fit[k] >= min_observations) step.event = FrameEvent::tracked;
    std::size_t num_of_map = 0;
    for (const FeatureObservation& observation : frames[k].observations)
      num_of_map += std::ranges::binary_search(smoothed.ids, observation.id) ? 1 : 0;
    report.num_unexplained += 2 * num_fit[k] < num_of_map ? 1 : 0;
  }
}

/// The path since it began, from all that was seen of it. None where there is no scale, or it does not settle.
std::optional<SmoothedPath> smooth(const Localizer& localizer, const LocalizeConfig& config,
                                   std::span<const ObservationFrame> frames, LocalizeReport& report) {
  if (!config.smooths || !localizer.bank() || config.target.empty()) return std::nullopt;
  const ObservationRecord& record = localizer.record();
  const auto problem =
      record.problem(report.camera, config, frames, report.path, localizer.bank()->best(), localizer.period_s());
  auto smoothed = problem ? smoothed_path(*problem) : std::nullopt;
  if (!smoothed) return std::nullopt;
  report.residuals = residual_structure(smoothed->residuals, report.camera.width_px, report.camera.height_px);
  enlarge(*smoothed, report.residuals);
  for (std::size_t k = 0; k < smoothed->cov.size(); ++k) {
    PathStep& step = report.path[problem->first_frame + k];
    step.world_from_cam = smoothed->world_from_cam[k];
    step.cov = smoothed->cov[k];
  }
  judge_frames(*smoothed, problem->first_frame, frames, report);
  return smoothed;
}

}  // namespace

std::string_view event_name(FrameEvent event) {
  switch (event) {
    case FrameEvent::waiting:
      return "waiting";
    case FrameEvent::started:
      return "started";
    case FrameEvent::tracked:
      return "tracked";
    case FrameEvent::predicted:
      return "predicted";
    case FrameEvent::restarted:
      return "restarted";
  }
  return "";
}

LocalizeReport localize_observations(const Camera& camera, std::span<const ObservationFrame> frames,
                                     const LocalizeConfig& given, std::span<const TimedPose> truth,
                                     const Progress& progress) {
  const LocalizeConfig config = sized(given, frames);
  LocalizeReport report;
  report.camera = camera;
  report.sigma_px = config.filter.sigma_px;
  report.has_target = !config.target.empty();
  report.scale_known = report.has_target;
  Localizer localizer(camera, config, period_of(frames));
  for (std::size_t i = 0; i < frames.size(); ++i) {
    report_progress(progress, "localize", i, frames.size());
    const double begin_s = config.seconds ? config.seconds() : 0.0;
    report.path.push_back(localizer.take(frames[i]));
    if (config.seconds) report.path.back().seconds = config.seconds() - begin_s;
    if (config.watch) config.watch(report.path.back());
    if (config.inspect && localizer.bank()) config.inspect(localizer.bank()->best());
  }
  report.num_restarts = localizer.num_restarts();
  const auto smoothed = smooth(localizer, config, frames, report);
  report.given = localizer.given().numbers();
  sum_up(
      localizer.bank(), [&](long id) { return localizer.points().num_used(id); }, truth, report);
  if (smoothed) take_over(*smoothed, report);
  report.known_shift = known_shift(report.map, config.target);
  report.is_behind = is_behind(report.path, config.target, config.seen_from_plus_z);
  report.is_board = config.is_board;
  report.is_scale_told = config.is_scale_told;
  report.radial = localizer.residuals().structure();
  return report;
}

}  // namespace alidade
