#include "alidade/localize.h"

#include <algorithm>
#include <cmath>
#include <limits>
#include <opencv2/core.hpp>
#include <optional>
#include <utility>

#include "alidade/estimation/median.h"
#include "alidade/localize/checks/judge.h"
#include "alidade/localize/checks/lens_kind.h"
#include "alidade/localize/checks/missing_frames.h"
#include "alidade/localize/checks/scale_readings.h"
#include "alidade/localize/checks/summary.h"
#include "alidade/localize/frames/image_localizer.h"
#include "alidade/localize/frames/white_pixels.h"
#include "alidade/localize/map/map_frame.h"
#include "alidade/localize/map/moved_points.h"
#include "alidade/localize/observation_localizer.h"
#include "alidade/localize/setup.h"

namespace alidade {
namespace {

/// The map of a table for use in a later run: points by their numbers.
void save_numbered(Localization& result) {
  for (const MapPoint& point : result.map)
    if (const Eigen::Matrix3d cov = point.cov_in_map.value_or(point.cov);
        point.id >= 0 && cov.allFinite() && cov.diagonal().minCoeff() > 0.0)
      result.saved_map.points.push_back({point.id, point.point_in_world, cov, {}});
}

/// Scale from other sensors than the camera.
void add_scale(const LocalizeConfig& config, Localization& result) {
  if (!result.is_scale_read) {
    read_scales(config, result.map, result);
    if (const auto read = scale_of(result); read && !result.has_target) {
      apply_scale(*read, result);
      result.is_scale_read = result.scale_known = true;
    }
    if (result.has_target) widen_by_contradictions(config.filter.sigma_scale, result);
  }
  add_imu_scale(config, result);
}

/// The new position of moved points is that in the path's map.
void add_moved_points(const MovedMapPoints& moved, bool is_left_out, Localization& result) {
  std::vector<double> moves_m;
  for (std::size_t i = 0; i < moved.ids.size(); ++i) {
    const auto at = std::ranges::find(result.map, moved.ids[i], &MapPoint::id);
    if (at != result.map.end()) moves_m.push_back((at->point_in_world - moved.places[i]).norm());
  }
  result.moved_points = {moved.ids.size(), moved.num_judged, moved.num_as_one, 0.0, is_left_out};
  if (is_left_out && !moves_m.empty()) result.moved_points.median_m = median_of(std::move(moves_m));
}

/// A result that contains only what was given.
Localization described(const LocalizeConfig& config, const Camera& camera) {
  Localization result;
  result.camera = camera;
  result.is_in_map = config.map.has_value();
  result.has_target = result.is_in_map || !config.target.points.empty();
  result.lacks_map_frame = config.map && config.map->is_in_metres && !config.map->frame;
  result.scale_known = config.map ? config.map->is_in_metres : result.has_target;
  result.is_scale_given = config.target.is_scale_given;
  result.sigma_px = config.filter.sigma_px;
  if (config.sigma_px) result.sigma_px_from = SigmaPxFrom::given;
  return result;
}

/// Whether σ of a pixel is to be estimated from the observations.
bool seeks_sigma(const LocalizeConfig& config) {
  return !config.sigma_px && config.filter.sigma_px == LocalizationFilterConfig{}.sigma_px;
}

/// Whether the innovations of a path solved with the usual σ are small enough for a smaller one. Persistent errors
/// cancel in differences of few frames: if they dominate, the smaller σ is wrong.
bool suggests(const Localization& result, double smaller_px) {
  constexpr double generous = 1.7, of_motion = 0.1;  // a motion trusted more than such pixels adapts less
  return result.nis_per_dof < generous * std::pow(smaller_px / result.sigma_px, 2) + of_motion;
}

/// Whether a path solved with an estimated σ is consistent: its residuals match that σ.
bool bears_out(const Localization& result, bool is_larger) {
  constexpr double least_nis = 0.4, most_nis = 1.5;
  const State state = result.verdict.state;
  if (state == State::refused || state == State::not_converged) return false;
  return is_larger ? result.nis_per_dof > least_nis : result.nis_per_dof < most_nis;
}

}  // namespace

/// The front ends hold references to config: it must not move.
struct Localizer::Run {
  Camera camera;
  LocalizeConfig config;
  std::optional<ObservationLocalizer> of_observations;
  std::optional<ImageLocalizer> of_images;
  std::vector<PathStep> path;
  std::size_t num_judged = 0;  ///< Steps already judged by recent().
  bool seeks_sigma_px = false, sigma_px_is_found = false;
  std::vector<ObservationFrame> given = {};  ///< Frames to estimate it from; empty for longer recordings.
  std::optional<MovedMapPoints> moved = {};  ///< Moved points of an earlier run's map; excluded from this run's.

  [[nodiscard]] double last_t_s() const {
    return path.empty() ? std::numeric_limits<double>::quiet_NaN() : path.back().t_s;
  }
  /// Points of the map that are no longer where it has them.
  [[nodiscard]] MovedMapPoints moved_points() const {
    if (moved) return *moved;
    if (!of_observations || !config.map) return {};
    return moved_map_points(camera, of_observations->numbered_frames(), *config.map, config.filter.sigma_px);
  }
  /// The config for the same frames once more.
  [[nodiscard]] LocalizeConfig again() const {
    LocalizeConfig once_more = config;
    if (once_more.map) once_more.target.points.clear();
    once_more.watch = {};
    once_more.inspect = {};
    once_more.seconds = {};
    return once_more;
  }
  void keep(const ObservationFrame& frame) {
    if (!seeks_sigma_px) return;
    seeks_sigma_px = path.size() < static_cast<std::size_t>(config.max_smoothed);
    if (seeks_sigma_px)
      given.push_back(frame);
    else
      given = {};
  }
  template <typename Take>
  const PathStep& timed(const Take& take) {
    const double begin_s = config.seconds ? config.seconds() : 0.0;
    path.push_back(take());
    if (config.seconds) path.back().seconds = config.seconds() - begin_s;
    return path.back();
  }
};

Localizer::Localizer(const Camera& camera, const LocalizeConfig& config) {
  require_sense(config, camera);
  run_ = std::make_unique<Run>(
      Run{known_camera(camera, config), config, {}, {}, {}, 0, seeks_sigma(config), false, {}, {}});
}

Localizer::~Localizer() = default;
Localizer::Localizer(Localizer&&) noexcept = default;
Localizer& Localizer::operator=(Localizer&&) noexcept = default;

const PathStep& Localizer::push(const ObservationFrame& frame) {
  Run& run = *run_;
  if (run.of_images) throw ConfigError("observations follow images");
  require_sense(frame, run.last_t_s());
  if (!run.of_observations) {
    run.config = resolved(std::move(run.config), run.camera, false);
    run.of_observations.emplace(run.camera, run.config);
  }
  run.keep(frame);
  const PathStep& step = run.timed([&] { return run.of_observations->take(frame); });
  if (run.config.watch) run.config.watch(step);
  return step;
}

const PathStep& Localizer::push(const cv::Mat& grey, long frame, double t_s) {
  Run& run = *run_;
  if (run.of_observations) throw ConfigError("images follow observations");
  require_sense(ObservationFrame{frame, t_s, {}}, run.last_t_s());
  if (grey.type() != CV_8UC1 || grey.cols != run.camera.width_px || grey.rows != run.camera.height_px)
    throw ConfigError("an image is not 8-bit grey of the camera's size");
  if (!run.of_images) {
    run.config = resolved(std::move(run.config), run.camera, true);
    run.of_images.emplace(run.camera, run.config);
  }
  const PathStep& step = run.timed([&] { return run.of_images->take(grey, frame, t_s); });
  if (run.config.watch_image) run.config.watch_image(t_s, grey, run.of_images->tried());
  if (run.config.watch) run.config.watch(step);
  return step;
}

Verdict Localizer::recent() {
  Run& run = *run_;
  if (run.of_images) throw ConfigError("recent() is of observations");
  Localization recent = described(run.config, run.camera);
  recent.path.assign(run.path.begin() + static_cast<std::ptrdiff_t>(run.num_judged), run.path.end());
  run.num_judged = run.path.size();
  if (run.of_observations) run.of_observations->sum_up_recent(recent);
  return live_verdict(recent);
}

/// If points of the map have moved since it was made, solves again with the others.
std::optional<Localization> Localizer::finished_without(MovedMapPoints moved, std::span<const TimedPose> truth) const {
  const Run& run = *run_;
  const std::vector<ObservationFrame> frames = run.of_observations->numbered_frames();
  if (frames.size() != run.path.size()) return std::nullopt;
  LocalizeConfig config = run.again();
  std::erase_if(config.map->points,
                [&](const SavedPoint& point) { return std::ranges::binary_search(moved.ids, point.id); });
  Localizer again(run.camera, config);
  again.run_->seeks_sigma_px = false;
  again.run_->sigma_px_is_found = run.sigma_px_is_found;
  again.run_->moved = std::move(moved);
  for (const ObservationFrame& frame : frames) again.push(frame);
  for (std::size_t k = 0; k < frames.size(); ++k) again.run_->path[k].seconds = run.path[k].seconds;
  Localization result = again.finish(truth);
  const State state = result.verdict.state;
  if (state == State::refused || state == State::not_converged) return std::nullopt;
  return result;
}

std::optional<Localization> Localizer::by_found_sigma(double found_px, std::span<const ObservationFrame> frames,
                                                      LocalizeConfig config, std::span<const TimedPose> truth,
                                                      const Progress& progress) const {
  const bool is_larger = found_px > config.filter.sigma_px;
  config.sigma_px = found_px;
  Localizer again(run_->camera, config);
  again.run_->sigma_px_is_found = true;
  again.push_all(frames, progress);
  Localization result = again.finish(truth);
  if (!bears_out(result, is_larger)) return std::nullopt;
  return result;
}

/// Solves with the σ of a pixel estimated from the frames, if that differs from the usual one.
Localization Localizer::with_sigma_sought(std::span<const ObservationFrame> frames, LocalizeConfig config,
                                          std::span<const TimedPose> truth, const Progress& progress,
                                          const std::function<Localization()>& by_usual) const {
  const double usual_px = config.filter.sigma_px;
  const auto other_px = other_sigma_px(frames, run_->camera, usual_px);
  if (!other_px) return by_usual();
  if (*other_px > usual_px)
    if (auto larger = by_found_sigma(*other_px, frames, config, truth, progress)) return *std::move(larger);
  Localization usual = by_usual();
  if (*other_px > usual_px || !suggests(usual, *other_px)) return usual;
  config.watch = {};
  config.inspect = {};
  if (auto smaller = by_found_sigma(*other_px, frames, std::move(config), truth, progress)) return *std::move(smaller);
  return usual;
}

void Localizer::push_all(std::span<const ObservationFrame> frames, const Progress& progress) {
  std::size_t done = 0;
  for (const ObservationFrame& frame : frames) {
    report_progress(progress, "localize", done++, frames.size());
    push(frame);
  }
}

Localization Localizer::finish(std::span<const TimedPose> truth) const {
  require_sense(truth);
  const Run& run = *run_;
  if (run.given.empty()) return finished(truth);
  Localization result = with_sigma_sought(run.given, run.again(), truth, {}, [this, truth] { return finished(truth); });
  for (std::size_t k = 0; k < run.path.size(); ++k) result.path[k].seconds = run.path[k].seconds;
  return result;
}

/// Solves with the σ of a pixel that push() used.
Localization Localizer::finished(std::span<const TimedPose> truth) const {
  const Run& run = *run_;
  const MovedMapPoints moved = run.moved_points();
  if (!moved.ids.empty() && !run.moved)
    if (auto without = finished_without(moved, truth)) return *std::move(without);
  Localization result = described(run.config, run.camera);
  if (run.sigma_px_is_found) result.sigma_px_from = SigmaPxFrom::residuals;
  result.path = run.path;
  result.truth.assign(truth.begin(), truth.end());
  for (const int index : run.config.filter.lens_params)
    result.lens_params.push_back(param_names(run.camera.lens)[static_cast<std::size_t>(index)]);
  if (run.of_images)
    run.of_images->sum_up(result);
  else if (run.of_observations)
    run.of_observations->sum_up(result);
  add_scale(run.config, result);
  add_moved_points(moved, run.moved.has_value(), result);
  if (run.config.map && run.config.map->frame) widen_by_frame(*run.config.map->frame, result);
  if (const auto sigma_s = sigma_of_times(run.config, result)) widen_by_times(*sigma_s, result);
  result.saved_map.is_in_metres = result.scale_known;
  if (run.of_images)
    run.of_images->save_map(result);
  else
    save_numbered(result);
  add_path_error(result);
  auto missing = missing_frames(result.path);
  result.missing = std::move(missing.frames);
  result.frame_pattern = std::move(missing.pattern);
  result.counts = {result.path.size(), result.path.size() - result.num_lost, result.num_lost, {}};
  result.assumed = localize_assumed(result);
  result.verdict = localize_verdict(result);
  std::optional<OtherLensKind> other;
  if (run.of_images)
    other = other_lens_kind(run.of_images->frames(), run.of_images->target(), run.config, result);
  else if (run.of_observations)
    other = other_lens_kind(run.of_observations->frames(), run.config.target.points, run.config, result);
  if (other) add_lens_kind(*other, result);
  return result;
}

Localization localize(std::span<const ObservationFrame> frames, const Camera& camera, const LocalizeConfig& config,
                      std::span<const TimedPose> truth, const Progress& progress) {
  require_sense(truth);
  Localizer localizer(camera, sized(config, frames));
  const auto solve = [&] {
    localizer.push_all(frames, progress);
    return localizer.finish(truth);
  };
  if (!std::exchange(localizer.run_->seeks_sigma_px, false)) return solve();
  for (double last_t_s = std::numeric_limits<double>::quiet_NaN(); const ObservationFrame& frame : frames)
    require_sense(frame, std::exchange(last_t_s, frame.t_s));
  return localizer.with_sigma_sought(frames, localizer.run_->config, truth, progress, solve);
}

Localization localize(const ObservationTable& observations, const Camera& camera, const LocalizeConfig& config,
                      std::span<const TimedPose> truth, const Progress& progress) {
  Localization result = localize(observations.frames, camera, config, truth, progress);
  result.counts.given += observations.skipped.size();
  result.counts.skipped = observations.skipped;
  return result;
}

Localization localize(const ImageStream& images, const Camera& camera, const LocalizeConfig& config,
                      std::span<const TimedPose> truth, const Progress& progress) {
  if (!images.next) throw ConfigError("there is nothing that loads the images");
  require_sense(truth);
  Localizer localizer(camera, config);
  cv::Mat grey;
  long frame = 0;
  double t_s = 0.0;
  for (std::size_t done = 0; images.next(grey, frame, t_s); ++done) {
    report_progress(progress, "localize", done, std::max(images.num_images, done + 1));
    localizer.push(grey, frame, t_s);
  }
  Localization result = localizer.finish(truth);
  if (images.own_rate_hz) add_rate_assumed(images.own_rate_hz(), result);
  return result;
}

}  // namespace alidade
