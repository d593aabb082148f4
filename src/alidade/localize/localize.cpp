#include "alidade/localize/localize.h"

#include <Eigen/LU>
#include <algorithm>
#include <cmath>
#include <map>
#include <set>

#include "alidade/localize/given_numbers.h"
#include "alidade/localize/path_doubt.h"
#include "alidade/localize/point_store.h"
#include "alidade/localize/sight_record.h"
#include "alidade/localize/summary.h"

namespace alidade {
namespace {

constexpr std::size_t least_sights = 3;  // a pose has six numbers, a point two

/// One run: the filters, what is known of points outside them, and when to start again.
class Localizer {
 public:
  Localizer(const Camera& camera, const LocalizeConfig& config, double period_s)
      : camera_(camera), config_(config), points_(config), period_s_(period_s) {}

  PathStep take(const SightFrame& frame);
  [[nodiscard]] const FilterBank* bank() const { return bank_ ? &*bank_ : nullptr; }
  [[nodiscard]] std::size_t num_restarts() const { return num_restarts_; }
  [[nodiscard]] const PointStore& points() const { return points_; }
  [[nodiscard]] const RadialResiduals& residuals() const { return residuals_; }
  [[nodiscard]] const SightRecord& record() const { return record_; }
  [[nodiscard]] const GivenTally& given() const { return given_; }
  [[nodiscard]] double period_s() const { return period_s_; }

 private:
  [[nodiscard]] std::vector<StartHypothesis> starts(const SightFrame& frame) const;
  [[nodiscard]] KnownPoseConfig pose_config() const {
    return {config_.filter.sigma_px, config_.sigma_speed_m_s, config_.sigma_rate_rad_s};
  }
  [[nodiscard]] PathStep taken(const SightFrame& frame);
  bool start(const SightFrame& frame);
  void predict_to(double t_s);
  void add_new(const SightFrame& frame);
  void drop_strangers(const SightFrame& frame, const SightsReport& report);
  [[nodiscard]] std::vector<StartHypothesis> elsewhere(const SightFrame& frame) const;
  [[nodiscard]] int num_more_explained(const SightFrame& frame, const Rigid3& world_from_cam) const;
  bool restart(const SightFrame& frame, Doubt doubt);
  void fill(const SightFrame& frame, const SightsReport& report, PathStep& step) const;

  Camera camera_;
  const LocalizeConfig& config_;
  std::optional<FilterBank> bank_;
  PointStore points_;
  double period_s_, t_s_ = 0.0, seen_s_ = 0.0;
  PathDoubt doubt_;
  int num_elsewhere_ = 0;  ///< Frames in a row in which the target says that the camera is somewhere else.
  RadialResiduals residuals_;
  SightRecord record_;
  GivenTally given_;
  std::size_t num_taken_ = 0;  ///< Frames.
  std::size_t num_restarts_ = 0;
};

/// A start that was told, or the poses from which the target looks so; without a target the first camera is the world.
std::vector<StartHypothesis> Localizer::starts(const SightFrame& frame) const {
  if (config_.start) return {*config_.start};
  if (!config_.target.empty()) return poses_from_known(camera_, frame.sights, config_.target, pose_config());
  if (frame.sights.size() < least_sights) return {};
  StartHypothesis origin;
  constexpr double sure = 1e-6;  // the world is where the camera is; zero would leave no way to correct it
  origin.cov.diagonal().head<6>().setConstant(sure * sure);
  origin.cov.diagonal().segment<3>(6).setConstant(config_.sigma_speed_m_s * config_.sigma_speed_m_s);
  origin.cov.diagonal().tail<3>().setConstant(config_.sigma_rate_rad_s * config_.sigma_rate_rad_s);
  return {origin};
}

bool Localizer::start(const SightFrame& frame) {
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
  constexpr int most_steps = 1000;  // σ is as large as the world long before
  const double gap_s = t_s - t_s_;
  const int num_steps = std::clamp(static_cast<int>(std::lround(gap_s / period_s_)), 1, most_steps);
  for (int i = 0; i < num_steps; ++i) bank_->predict(gap_s / num_steps);
  t_s_ = t_s;
}

void Localizer::add_new(const SightFrame& frame) {
  for (const FeatureSight& sight : frame.sights) {
    if (bank_->best().has(sight.id)) continue;
    const auto prior = points_.prior_of(sight, bank_->best());
    if (!prior) continue;
    const FeatureKind kind = config_.new_points == NewPoints::xyz ? FeatureKind::xyz : FeatureKind::inverse_depth;
    if (bank_->add(sight.id, sight.px, *prior, kind)) record_.entered(num_taken_, sight.id, *prior);
  }
}

/// Points that do not fit several times in a row leave; they may come again.
void Localizer::drop_strangers(const SightFrame& frame, const SightsReport& report) {
  for (std::size_t i = 0; i < frame.sights.size(); ++i) {
    if (!points_.is_stranger(frame.sights[i].id, report.outcomes[i])) continue;
    bank_->remove(frame.sights[i].id);
    record_.left(frame.sights[i].id);
  }
}

/// Where the camera is by the target, if that contradicts the path. Empty: it does not, or its sights fit no pose.
std::vector<StartHypothesis> Localizer::elsewhere(const SightFrame& frame) const {
  std::vector<StartHypothesis> from = poses_from_known(camera_, frame.sights, config_.target, pose_config());
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

/// Of the target's sights, how many more a pose explains than the path does.
int Localizer::num_more_explained(const SightFrame& frame, const Rigid3& world_from_cam) const {
  const double gate_px2 = 4.0 * config_.filter.gate * config_.filter.sigma_px * config_.filter.sigma_px;
  const Rigid3& now = bank_->best().motion().world_from_cam;
  int num_more = 0;
  for (const FeatureSight& sight : frame.sights) {
    const auto known = std::ranges::find(config_.target, sight.id, &KnownPoint::id);
    if (known == config_.target.end()) continue;
    const auto is_near = [&](const Rigid3& pose) {
      const auto px = project(camera_, pose.inverse() * known->point_in_world);
      return px && (*px - sight.px).squaredNorm() < gate_px2 ? 1 : 0;
    };
    num_more += is_near(world_from_cam) - is_near(now);
  }
  return num_more;
}

/// From the target, where it says that the camera is somewhere else. Mismatches may look like another pose: where the
/// sights that fit are not contradicted by themselves, it has to explain at least two more of the target's, and where
/// there is only some doubt three times running. The map of points that led there is dropped.
bool Localizer::restart(const SightFrame& frame, Doubt doubt) {
  constexpr int sure = 3, least_more = 2;
  std::vector<StartHypothesis> from = doubt == Doubt::none ? std::vector<StartHypothesis>{} : elsewhere(frame);
  if (!from.empty() && doubt != Doubt::strong &&
      num_more_explained(frame, from.front().motion.world_from_cam) < least_more)
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

void Localizer::fill(const SightFrame& frame, const SightsReport& report, PathStep& step) const {
  step.num_tracked = report.num_used;
  step.num_gated = report.num_gated;
  if (report.num_used > 0) step.nis_per_dof = report.nis_per_dof;
  const LocalizationFilter& filter = bank_->best();
  step.world_from_cam = filter.motion().world_from_cam;
  step.cov = filter.pose_covariance();
  step.num_features = filter.features().size();
  step.num_known = step.num_known_gated = 0;
  for (std::size_t i = 0; i < frame.sights.size(); ++i) {
    const bool is_gated = report.outcomes[i] == SightOutcome::gated;
    if (!is_gated && report.outcomes[i] != SightOutcome::used) continue;
    if (std::ranges::find(config_.target, frame.sights[i].id, &KnownPoint::id) == config_.target.end()) continue;
    ++step.num_known;
    step.num_known_gated += is_gated ? 1 : 0;
  }
}

PathStep Localizer::take(const SightFrame& frame) {
  PathStep step = taken(frame);
  ++num_taken_;
  return step;
}

PathStep Localizer::taken(const SightFrame& frame) {
  PathStep step;
  step.frame = frame.frame;
  step.t_s = frame.t_s;
  step.num_seen = frame.sights.size();
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
  const SightsReport report = bank_->update(frame.sights);
  fill(frame, report, step);
  residuals_.add(bank_->best(), frame.sights, report.outcomes);
  if (step.event == FrameEvent::tracked && step.num_tracked < least_sights) step.event = FrameEvent::predicted;
  const Doubt doubt = doubt_.after(step);
  drop_strangers(frame, report);
  if (config_.restarts && restart(frame, doubt)) {
    const SightsReport again = bank_->update(frame.sights);
    fill(frame, again, step);
    step.event = FrameEvent::restarted;
  }
  if (step.num_tracked >= least_sights || step.event == FrameEvent::started) add_new(frame);
  bank_->convert_linear();
  given_.add(bank_->best());
  return step;
}

/// The usual time between frames: the median.
double period_of(std::span<const SightFrame> frames) {
  std::vector<double> gaps;
  for (std::size_t i = 1; i < frames.size(); ++i) gaps.push_back(frames[i].t_s - frames[i - 1].t_s);
  if (gaps.empty()) return 1.0;
  std::ranges::nth_element(gaps, gaps.begin() + static_cast<std::ptrdiff_t>(gaps.size() / 2));
  return std::max(gaps[gaps.size() / 2], 1e-9);
}

/// The state is made as large as these frames can need.
LocalizeConfig sized(const LocalizeConfig& given, std::span<const SightFrame> frames) {
  LocalizeConfig config = given;
  std::set<long> ids;
  std::size_t most = 1;
  for (const SightFrame& frame : frames) {
    for (const FeatureSight& sight : frame.sights) ids.insert(sight.id);
    most = std::max(most, frame.sights.size());
  }
  for (const KnownPoint& point : config.target) ids.insert(point.id);
  const auto need = motion_dim + config.filter.lens_params.size() + 6 * ids.size() + 8;
  config.filter.state_capacity =
      std::min(config.filter.state_capacity, static_cast<int>(std::min<std::size_t>(need, 1 << 20)));
  config.filter.sigma_scale = config.sigma_scale;
  config.filter.sights_capacity =
      std::min(config.filter.sights_capacity, static_cast<int>(std::min<std::size_t>(most, 1 << 20)));
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

/// What of each frame fits the smoothed path: frames that the filter had lost may be held by their sights there.
void judge_frames(const SmoothedPath& smoothed, std::size_t first_frame, std::span<const SightFrame> frames,
                  LocalizeReport& report) {
  std::vector<std::size_t> num_fit(report.path.size(), 0);
  for (const PlacedResidual& residual : smoothed.residuals) ++num_fit[first_frame + residual.frame];
  for (std::size_t k = first_frame; k < report.path.size(); ++k) {
    PathStep& step = report.path[k];
    const bool was_lost = step.event == FrameEvent::predicted || step.event == FrameEvent::waiting;
    if (was_lost && num_fit[k] >= least_sights) step.event = FrameEvent::tracked;
    std::size_t num_of_map = 0;
    for (const FeatureSight& sight : frames[k].sights)
      num_of_map += std::ranges::binary_search(smoothed.ids, sight.id) ? 1 : 0;
    report.num_unexplained += 2 * num_fit[k] < num_of_map ? 1 : 0;
  }
}

/// The path since it began, from all that was seen of it. None where there is no scale, or it does not settle.
std::optional<SmoothedPath> smooth(const Localizer& localizer, const LocalizeConfig& config,
                                   std::span<const SightFrame> frames, LocalizeReport& report) {
  if (!config.smooths || !localizer.bank() || config.target.empty()) return std::nullopt;
  const SightRecord& record = localizer.record();
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

LocalizeReport localize_sights(const Camera& camera, std::span<const SightFrame> frames, const LocalizeConfig& given,
                               std::span<const TimedPose> truth, const Progress& progress) {
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
