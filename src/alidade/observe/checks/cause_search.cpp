// If several assumptions are violated at once, no single cause explains much: sets of causes are tried.
#include <algorithm>
#include <cmath>
#include <limits>

#include "alidade/observe/checks/cause_search.h"

namespace alidade {
namespace {

constexpr std::size_t max_search_frames = 120, max_search_points = 40;
constexpr double ordinary_step_rad = 0.02;

/// The parameters that a trial estimates in addition to those already estimated.
struct Trial {
  bool lens = false, mount = false, delay = false, shutter = false, lever = false, drift = false;
  std::vector<std::string> errors = {};
};

const std::string scale_cause = "encoder scale", backlash_cause = "backlash", zero_cause = "zero that drifts",
                  rate_scale_cause = "scale of the rates", bias_cause = "bias of the rates",
                  attitude_cause = "attitude that drifts", clock_cause = "clock rate",
                  axes_cause = "axes that are not perpendicular";

/// Simple ones first: among trials that explain about equally well, the first is taken. A lever comes with a depth per
/// point, and a lever of a metre can imitate a lens and a mounting.
const std::vector<Trial>& trials() {
  static const std::vector<Trial> all{
      {.lens = true},
      {.mount = true},
      {.delay = true},
      {.shutter = true},
      {.drift = true},
      {.errors = {backlash_cause}},
      {.errors = {scale_cause, rate_scale_cause}},
      {.errors = {bias_cause, attitude_cause, zero_cause}},
      {.errors = {axes_cause}},
      {.mount = true, .errors = {axes_cause}},
      {.mount = true, .delay = true},
      {.delay = true, .errors = {clock_cause}},
      {.delay = true, .shutter = true},
      {.delay = true, .errors = {backlash_cause}},
      {.lens = true, .delay = true},
      {.lens = true, .shutter = true},
      {.lens = true, .errors = {backlash_cause}},
      {.lens = true, .errors = {scale_cause, rate_scale_cause}},
      {.lens = true, .errors = {bias_cause}},
      {.lens = true, .mount = true, .delay = true},
      {.lens = true, .mount = true, .delay = true, .shutter = true},
      {.lever = true},
      {.lens = true, .lever = true},
      {.mount = true, .delay = true, .errors = {scale_cause, backlash_cause, rate_scale_cause, bias_cause}},
      {.lens = true, .mount = true, .delay = true, .errors = {backlash_cause, bias_cause}},
      {.lens = true,
       .mount = true,
       .delay = true,
       .shutter = true,
       .errors = {scale_cause, backlash_cause, zero_cause, rate_scale_cause, bias_cause, attitude_cause}},
      {.lens = true, .mount = true, .delay = true, .lever = true},
  };
  return all;
}

ObserveSetup freed_by(const Trial& trial, const ObserveSetup& config) {
  ObserveSetup freer = config;
  ObserveNuisances& estimate = freer.nuisances;
  if (trial.lens && !config.lens_is_given) estimate.k1 = estimate.k2 = estimate.k3 = estimate.tangential = true;
  estimate.mount = estimate.mount || trial.mount;
  estimate.delay = estimate.delay || trial.delay;
  estimate.shutter = estimate.shutter || trial.shutter;
  estimate.lever = estimate.lever || (trial.lever && !config.is_no_lever);
  estimate.drift = estimate.drift || trial.drift;
  freer.estimate_errors.insert(freer.estimate_errors.end(), trial.errors.begin(), trial.errors.end());
  return freer;
}

int size_of_layout(const RotationLog& log, const ObserveSetup& config) {
  ObserveNuisances nuisances = config.nuisances;
  nuisances.errors = static_cast<int>(estimated_errors(log, config).size());
  return CommonLayout(nuisances).size;
}

/// The frames of the log with the most observed points; the point with measured range comes first.
struct Sample {
  std::vector<RotationFrame> frames;
  std::vector<std::vector<Eigen::Vector2d>> px;
};

Sample sample_of(const RotationLog& log, const ObserveSetup& config, const PixelScale& scale,
                 std::size_t max_points = max_search_points) {
  std::vector<std::pair<int, std::size_t>> seen(log.num_points);
  for (std::size_t i = 0; i < seen.size(); ++i) seen[i] = {0, i};
  for (const RotationRow& row : log.rows) {
    for (std::size_t i = 0; i < row.px.size(); ++i) seen[i].first -= is_seen(row.px[i]) ? 1 : 0;
  }
  if (log.range_point < seen.size()) seen[log.range_point].first = std::numeric_limits<int>::min();
  std::sort(seen.begin(), seen.end());
  seen.resize(std::min(seen.size(), max_points));
  Sample sample;
  MotionReader reader(log.source, config.max_gap_s);
  for (const RotationRow& row : log.rows) {
    sample.frames.push_back(reader.next(row));
    std::vector<Eigen::Vector2d> px;
    for (const auto& [count, i] : seen) {
      px.push_back(i < sample.frames.back().px.size() ? scale.normalised(sample.frames.back().px[i])
                                                      : Eigen::Vector2d::Constant(not_seen));
    }
    sample.px.push_back(std::move(px));
  }
  return sample;
}

/// About `max_frames` of the frames at most, evenly spaced.
FrameBuffer buffer_of(const std::vector<RotationFrame>& frames, const Sample& sample,
                      std::size_t max_frames = max_search_frames) {
  const std::size_t num_points = sample.px.empty() ? 0 : sample.px.front().size();
  FrameBuffer buffer(num_points, frames.size() + 1);
  const std::size_t every = std::max<std::size_t>(1, frames.size() / max_frames);
  bool is_new = false;
  for (std::size_t k = 0; k < frames.size(); ++k) {
    is_new = is_new || frames[k].starts_segment;
    if (k % every != 0) continue;
    if (is_new) buffer.renew_all();
    is_new = false;
    buffer.add(frames[k], sample.px[k]);
  }
  return buffer;
}

AdjustConfig trial_config(const RotationLog& log, const ObserveSetup& config, const ObserveSolution& report,
                          int num_errors) {
  ObserveSetup sized = config;
  sized.width_px = report.width_px;
  sized.height_px = report.height_px;
  RotatingCamera start = start_camera(sized, report.scale);
  start.errors = RotationErrors::Zero(num_errors);
  if (!log.rows.empty()) start.drift_from_s = log.rows.back().t_s;
  AdjustConfig adjust_with = adjust_config_of(log, config, start, report.scale);
  adjust_with.gives_up = true;
  adjust_with.nuisances.errors = num_errors;
  adjust_with.sigma_px = 0.0;
  adjust_with.range_point = 0;  // index in the sample
  if (!config.start) adjust_with.other_starts = {2.5};
  return adjust_with;
}

/// σ of a pixel [px] with which all rows are explained; infinite if they are not explained.
double noise_of(const RotationLog& log, const ObserveSetup& config, const ObserveSolution& report, const Sample& sample,
                const Progress& progress) {
  std::vector<RotationFrame> frames = sample.frames;
  const std::vector<RotationError> errors = estimated_errors(log, config);
  add_turns(log, errors, config.max_gap_s, frames);
  const AdjustConfig adjust_with = trial_config(log, config, report, static_cast<int>(errors.size()));
  const Adjustment adjustment = adjust(buffer_of(frames, sample), adjust_with, progress);
  const std::size_t seen = adjustment.num_rejected + adjustment.bundle.observations.size();
  constexpr double max_rejected = 0.4;  // with more, no verdict is possible
  if (!adjustment.has_value ||
      static_cast<double>(adjustment.num_rejected) > max_rejected * static_cast<double>(seen)) {
    return std::numeric_limits<double>::infinity();
  }
  return adjustment.sigma_px * report.scale.scale;
}

/// Adjusts bundles of a log under the hypothesis of a step of the mounting.
class StepSearch {
 public:
  StepSearch(const RotationLog& log, const ObserveSetup& config, const ObserveSolution& report,
             const Progress& progress)
      : scale_(report.scale.scale),
        sample_(sample_of(log, config, report.scale, max_points)),
        adjust_with_(trial_config(log, config, report, 3)),
        progress_(progress) {
    adjust_with_.reject = false;
  }
  /// With a rotation of the camera on its mount at time `t_s`; the noise is that of all pixels.
  [[nodiscard]] MountingStep at(double t_s, std::size_t max_frames) const {
    std::vector<RotationFrame> frames = sample_.frames;
    for (RotationFrame& frame : frames) {
      frame.turn_by = TurnByErrors::Zero(3, 3);
      if (frame.t_s >= t_s) frame.turn_by.diagonal().setConstant(ordinary_step_rad);
    }
    const Adjustment adjustment = adjust(buffer_of(frames, sample_, max_frames), adjust_with_, progress_);
    MountingStep step{t_s, Eigen::Vector3d::Zero(), std::numeric_limits<double>::infinity()};
    if (!adjustment.has_value) return step;
    step.rotation_rad = ordinary_step_rad * adjustment.solution.camera.errors.head<3>();
    step.noise_px = adjustment.solution.rms_px * scale_;
    return step;
  }
  [[nodiscard]] double from_s() const { return sample_.frames.front().t_s; }
  [[nodiscard]] double until_s() const { return sample_.frames.back().t_s; }

 private:
  static constexpr std::size_t max_points = 16;
  double scale_;
  Sample sample_;
  AdjustConfig adjust_with_;
  const Progress& progress_;
};

}  // namespace

std::optional<ObserveSetup> searched_causes(const RotationLog& log, const ObserveSetup& config,
                                            const ObserveSolution& report, double max_noise_px,
                                            const Progress& progress) {
  constexpr double as_well = 1.15;
  if (log.rows.size() < 10 || log.num_points < 2) return std::nullopt;
  const Sample sample = sample_of(log, config, report.scale);
  std::vector<std::pair<double, ObserveSetup>> found;
  double least = std::numeric_limits<double>::infinity();
  const auto attempt = [&](const Trial& trial) {
    ObserveSetup freer = freed_by(trial, config);
    if (size_of_layout(log, freer) <= size_of_layout(log, config)) return;
    const double noise_px = noise_of(log, freer, report, sample, progress);
    least = std::min(least, noise_px);
    found.emplace_back(noise_px, std::move(freer));
  };
  // If the largest sets do not explain the log, no set does.
  const double as_given = noise_of(log, config, report, sample, progress);
  constexpr double clearly = 0.6;
  max_noise_px = std::min(max_noise_px, clearly * as_given);
  for (auto trial = trials().rbegin(); trial != trials().rbegin() + 2; ++trial) attempt(*trial);
  attempt({.drift = true});
  if (!(least < max_noise_px)) return std::nullopt;
  for (const Trial& trial : trials()) {
    attempt(trial);
    if (found.back().first < max_noise_px && found.back().first < as_well * least) return found.back().second;
  }
  return std::nullopt;
}

std::optional<MountingStep> mounting_step(const RotationLog& log, const ObserveSetup& config,
                                          const ObserveSolution& report, double max_noise_px, double max_share,
                                          const Progress& progress) {
  constexpr int num_times = 12;
  constexpr std::size_t few_frames = 60, many_frames = 120;
  // A trial that misses a step by half the spacing of trials leaves about half of the residuals; without a step, most.
  constexpr double hardly = 0.7;
  if (log.source == RotationSource::none || log.rows.size() < 10 || log.num_points < 2) return std::nullopt;
  const StepSearch search(log, config, report, progress);
  const double duration_s = search.until_s() - search.from_s();
  const double without_px = search.at(search.until_s() + 1.0, few_frames).noise_px;
  // A mounting that is rotated throughout is not a step.
  const double askew_px = config.nuisances.mount ? without_px : search.at(search.from_s(), few_frames).noise_px;
  const double enough_px = std::min(max_noise_px, max_share * std::min(without_px, askew_px));
  MountingStep best{search.from_s(), Eigen::Vector3d::Zero(), std::numeric_limits<double>::infinity()};
  double reach_s = duration_s / num_times;
  const double first_s = search.from_s() + 0.5 * reach_s, last_s = search.until_s() - 0.5 * reach_s;
  for (int k = 1; k < num_times; ++k) {
    const MountingStep tried = search.at(search.from_s() + k * reach_s, few_frames);
    if (tried.noise_px < best.noise_px) best = tried;
  }
  if (!(best.noise_px < std::max(enough_px, hardly * without_px))) return std::nullopt;
  best = search.at(best.t_s, many_frames);
  for (; reach_s > duration_s / static_cast<double>(many_frames); reach_s *= 0.5) {
    for (const double by_s : {-0.5 * reach_s, 0.5 * reach_s}) {
      const MountingStep tried = search.at(std::clamp(best.t_s + by_s, first_s, last_s), many_frames);
      if (tried.noise_px < best.noise_px) best = tried;
    }
  }
  if (!(best.noise_px < enough_px)) return std::nullopt;
  return best;
}

bool has_no_rest(const RotationLog& log, const ObserveSetup& config, const ObserveSolution& report,
                 const Progress& progress) {
  constexpr double window_s = 1.0, many = 0.5, clearly = 0.5, slowest_per_s = 0.003;
  const Sample sample = sample_of(log, config, report.scale);
  ObserveSetup sized = config;
  sized.width_px = report.width_px;
  sized.height_px = report.height_px;
  AdjustConfig still;
  still.gives_up = true;
  still.start = start_camera(sized, report.scale);
  still.other_starts = {2.5, 5.0};
  int judged = 0, varying = 0;
  std::size_t k = 0;
  while (k < sample.frames.size()) {
    FrameBuffer buffer(sample.px.front().size(), max_search_frames);
    const double until_s = sample.frames[k].t_s + window_s;
    still.start.drift_from_s = sample.frames[k].t_s;
    for (; k < sample.frames.size() && sample.frames[k].t_s < until_s; ++k) {
      if (sample.frames[k].starts_segment) buffer.renew_all();
      buffer.add(sample.frames[k], sample.px[k]);
    }
    AdjustConfig zooming = still;
    zooming.nuisances.drift = true;
    const Adjustment one = adjust(buffer, still, progress), changing = adjust(buffer, zooming, progress);
    if (!one.has_value || !changing.has_value) continue;  // a second of the log that does not determine the camera
    ++judged;
    const bool is_better = changing.sigma_px < clearly * one.sigma_px;
    varying += is_better && std::abs(changing.solution.camera.drift_per_s) > slowest_per_s ? 1 : 0;
  }
  return judged >= 3 && varying > many * judged;
}

}  // namespace alidade
