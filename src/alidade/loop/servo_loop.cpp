#include "alidade/loop/servo_loop.h"

#include <algorithm>
#include <cmath>
#include <numeric>

#include "alidade/estimation/config_error.h"
#include "alidade/loop/lens_observer.h"
#include "alidade/servo/head_servo.h"
#include "alidade/simulate/draws.h"
#include "alidade/simulate/servo.h"
#include "alidade/simulate/track.h"

namespace alidade {
namespace {

constexpr std::size_t max_on_their_way = 256;  // images taken and not yet known

/// An image of one head: the target, and what is static.
struct Image {
  HeadObservation observation;
  bool is_seen = false;
  std::vector<Eigen::Vector2d> background;
};

/// Images of one head that are not yet known.
class ImageQueue {
 public:
  explicit ImageQueue(double latency_s) : latency_s_(latency_s) {}
  void take(Image image) { ring_[num_taken_++ % ring_.size()] = std::move(image); }
  /// The next image that is known by now and was not requested before; none: nullptr.
  Image* next(double t_s) {
    if (num_known_ >= num_taken_) return nullptr;
    Image& image = ring_[num_known_ % ring_.size()];
    if (image.observation.t_capture_s + latency_s_ > t_s + 1e-9) return nullptr;
    ++num_known_;
    return &image;
  }

 private:
  std::array<Image, max_on_their_way> ring_{};
  std::size_t num_taken_ = 0, num_known_ = 0;
  double latency_s_;
};

/// One head, its controller and the images between them.
struct LoopedHead {
  SimulatedHead head;
  HeadServo servo;
  ImageQueue images;
  std::optional<LensObserver> observer;
  IntrinsicsSample lens;  ///< Of the newest image that is known.
};

std::array<ServoAxis, 2> true_axes(const ServoScene& scene) {
  std::array<ServoAxis, 2> axes = scene.axes;
  for (ServoAxis& axis : axes) axis = as_it_is(axis, scene.mismatch);
  return axes;
}

/// Distant static points where a head will look: about the target, somewhere in the narrowest image.
std::vector<Eigen::Vector3d> background_of(const ServoScene& scene, const RigHead& head, std::uint64_t seed) {
  constexpr double far_m = 1e4;
  std::vector<Eigen::Vector3d> points;
  Draws draws(seed);
  Eigen::Vector4d narrowest = own_lens(head.camera).k;
  narrowest.head<2>() *= std::max(1.0, scene.zoom.largest());
  const Zoomed zoomed(head.camera, narrowest);
  for (std::size_t tried = 0; points.size() < scene.background_points && tried < 100 * scene.background_points;
       ++tried) {
    const double t_s = draws.uniform(0.0, scene.duration_s), u = draws.uniform(0.0, head.camera.width_px - 1.0),
                 v = draws.uniform(0.0, head.camera.height_px - 1.0);
    const auto readings = aim(head.head, scene.path.at(t_s));
    const auto ray = readings ? ray_in_world(head, *readings, zoomed.own_px({u, v})) : std::nullopt;
    if (ray) points.emplace_back(ray->origin_in_world + far_m * ray->direction_in_world);
  }
  return points;
}

std::vector<LoopedHead> looped_heads(const ServoScene& scene, const ServoConfig& config, std::uint64_t seed) {
  std::vector<LoopedHead> looped;
  for (std::size_t i = 0; i < scene.heads.size(); ++i) {
    const RigHead& head = scene.heads[i];
    const bool observes = scene.intrinsics == LensKnowledge::observed;
    const std::uint64_t own_seed = 2 * seed + 1000003 * i;
    HeadTruth truth{head, true_axes(scene), scene.encoder_step_rad, scene.sigma_encoder_rad, scene.sigma_px, {}};
    if (observes) truth.background_in_world = background_of(scene, head, own_seed + 700001);
    const Eigen::Vector2d start = aim(head.head, scene.path.at(0.0)).value_or(Eigen::Vector2d::Zero());
    looped.push_back({SimulatedHead(truth, start, own_seed),
                      HeadServo(head, config),
                      ImageQueue(scene.latency_s),
                      {},
                      own_lens(head.camera)});
    if (observes) {
      const double step_share = scene.encoder_step_rad / std::sqrt(12.0);
      looped.back().observer.emplace(head, truth.background_in_world.size(),
                                     std::hypot(scene.sigma_encoder_rad, step_share));
    }
  }
  return looped;
}

bool is_hidden(const ServoScene& scene, double t_s) {
  return std::ranges::any_of(scene.hidden_s,
                             [t_s](const auto& span) { return t_s >= span.first && t_s < span.second; });
}

/// What is known by now goes to the observer, and the newest of it to the servo.
void deliver(const ServoScene& scene, LoopedHead& looped, double t_s, HeadServoInput& input) {
  while (Image* image = looped.images.next(t_s)) {
    input.observation.reset();
    HeadObservation& observation = image->observation;
    if (looped.observer) {
      looped.observer->take(observation.t_capture_s, observation.pan_tilt_rad, image->background);
      observation.lens = looped.observer->lens();
    }
    if (scene.intrinsics != LensKnowledge::given) looped.lens = *observation.lens;
    if (image->is_seen) input.observation = observation;
  }
}

/// Behind the camera: as wrong as can be, half a turn of pixels.
double length_of(const std::optional<Eigen::Vector2d>& error_px, double focal_px) {
  const double most = 3.14 * focal_px;
  return error_px && error_px->allFinite() ? std::min(most, error_px->norm()) : most;
}

/// Between this image and the next.
void add_between(const ServoScene& scene, const LoopedHead& looped, ServoRow& row) {
  const auto parts = static_cast<double>(row.error_between_px.size() + 1);
  for (std::size_t i = 0; i < row.error_between_px.size(); ++i) {
    const double later_s = static_cast<double>(i + 1) / parts * scene.period_s;
    auto where = looped.head.true_pixel_after(later_s, scene.path.at(row.t_s + later_s));
    if (where) *where -= row.true_lens.tail<2>();
    row.error_between_px[i] = length_of(where, row.true_lens[0]);
  }
}

/// Where the target truly is in the row's image.
void add_truth(const ServoScene& scene, const LoopedHead& looped, const Eigen::Vector3d& target, ServoRow& row) {
  const auto where = looped.head.true_pixel(target);
  row.true_lens = looped.head.intrinsics();
  row.error_px = where ? Eigen::Vector2d(*where - row.true_lens.tail<2>())
                       : Eigen::Vector2d::Constant(std::numeric_limits<double>::quiet_NaN());
  row.is_in_image = where && is_in_image(scene.heads[row.head].camera, *where);
}

ServoRow step(const ServoScene& scene, LoopedHead& looped, double t_s, std::size_t head) {
  const Eigen::Vector3d target = scene.path.at(t_s);
  looped.head.zoom_to(scene.zoom.at(t_s));
  ServoRow row;
  row.t_s = t_s;
  row.head = head;
  row.measured_rad = looped.head.read_encoders();
  const auto seen = looped.head.seen_pixel(target);
  const bool is_seen = seen && !is_hidden(scene, t_s);
  Image image{
      {t_s, row.measured_rad, seen.value_or(Eigen::Vector2d::Zero()), {}}, is_seen, looped.head.seen_background()};
  if (scene.intrinsics == LensKnowledge::truth)
    image.observation.lens = IntrinsicsSample{looped.head.intrinsics(), Eigen::Vector4d::Zero()};
  looped.images.take(std::move(image));
  HeadServoInput input{t_s, row.measured_rad, std::nullopt};
  deliver(scene, looped, t_s, input);
  const HeadServoOutput output = looped.servo.step(input);
  looped.head.send(output.command);
  row.command = output.command;
  row.asked_rad = output.asked_rad;
  row.predicted_rad = output.predicted_rad;
  row.has_prediction = output.has_prediction;
  row.lens = looped.lens;
  row.sigma_predicted_px = looped.lens.k.head<2>().mean() * output.sigma_rad;
  row.rate_rad_s = looped.head.rates_rad_s();
  row.event = output.event;
  add_truth(scene, looped, target, row);
  add_between(scene, looped, row);
  if (is_seen) row.seen_px = *seen;
  return row;
}

/// How far the focal length that the loop has was off, and how that compares with its σ.
void add_focal_errors(const ServoScene& scene, const std::vector<ServoRow>& rows, ServoFigures& figures) {
  double share2 = 0.0, z2 = 0.0, num = 0.0;
  for (const ServoRow& row : rows) {
    if (row.t_s < scene.warm_up_s) continue;
    const double off = row.lens.k[0] - row.true_lens[0];
    share2 += std::pow(off / row.true_lens[0], 2);
    if (row.lens.sigma[0] > 0.0) z2 += std::pow(off / row.lens.sigma[0], 2);
    num += 1.0;
  }
  if (!(num > 0.0)) return;
  figures.focal_share = std::sqrt(share2 / num);
  figures.focal_z = std::sqrt(z2 / num);
}

/// 95 % are no larger, of errors in order of size.
double p95_of(const std::vector<double>& errors) {
  return errors[static_cast<std::size_t>(0.95 * (static_cast<double>(errors.size()) - 1.0))];
}

/// Of each head: from when on the target is out of its image, as a share of the time that counts.
std::vector<double> gone_of(const ServoScene& scene, const std::vector<ServoRow>& rows) {
  std::vector<double> counted(scene.heads.size(), 0.0), gone(scene.heads.size(), 0.0);
  for (const ServoRow& row : rows) {
    if (row.t_s < scene.warm_up_s) continue;
    counted[row.head] += 1.0;
    gone[row.head] = row.is_in_image ? 0.0 : gone[row.head] + 1.0;
  }
  for (std::size_t i = 0; i < gone.size(); ++i) gone[i] /= std::max(1.0, counted[i]);
  return gone;
}

ServoFigures figures_of(const ServoScene& scene, const std::vector<ServoRow>& rows) {
  ServoFigures figures;
  std::vector<double> errors;
  double sum2 = 0.0, between2 = 0.0;
  std::size_t central = 0, visible = 0, waiting = 0;
  for (const ServoRow& row : rows) {
    figures.num_lost += row.event == ServoEvent::lost ? 1u : 0u;
    figures.num_found += row.event == ServoEvent::found ? 1u : 0u;
    if (row.event == ServoEvent::lost || row.event == ServoEvent::searching) figures.search_s += scene.period_s;
    if (row.t_s < scene.warm_up_s) continue;
    const Camera& camera = scene.heads[row.head].camera;
    const double error = length_of(row.error_px, row.true_lens[0]);
    errors.push_back(error);
    sum2 += error * error;
    for (const double between_px : row.error_between_px) {
      between2 += between_px * between_px / static_cast<double>(row.error_between_px.size());
      figures.max_px = std::max(figures.max_px, between_px);
    }
    visible += row.is_in_image ? 1u : 0u;
    waiting += row.event == ServoEvent::waiting ? 1u : 0u;
    central +=
        std::abs(row.error_px.x()) <= camera.width_px / 6.0 && std::abs(row.error_px.y()) <= camera.height_px / 6.0
            ? 1u
            : 0u;
  }
  if (errors.empty()) return figures;
  const auto count = static_cast<double>(errors.size());
  figures.rms_px = std::sqrt(sum2 / count);
  figures.between_px = std::sqrt(between2 / count);
  figures.central_third = static_cast<double>(central) / count;
  figures.in_image = static_cast<double>(visible) / count;
  figures.unseen = static_cast<double>(waiting) / count;
  std::ranges::sort(errors);
  figures.p95_px = p95_of(errors);
  figures.max_px = std::max(figures.max_px, errors.back());
  figures.gone = gone_of(scene, rows);
  figures.errors_px = std::move(errors);
  add_focal_errors(scene, rows, figures);
  return figures;
}

constexpr std::array<std::string_view, 3> knowledge_names{"given", "observed", "true"};

}  // namespace

ServoAxis as_it_is(const ServoAxis& known, const PlantMismatch& mismatch) {
  ServoAxis axis = known;
  axis.plant = scaled(known.plant, mismatch.gain, mismatch.tau);
  axis.command_delay_s = std::max(0.0, known.command_delay_s + mismatch.later_s);
  return axis;
}

std::string_view lens_knowledge_name(LensKnowledge knowledge) {
  return knowledge_names[static_cast<std::size_t>(knowledge)];
}

std::optional<LensKnowledge> lens_knowledge_named(std::string_view name) {
  for (std::size_t i = 0; i < knowledge_names.size(); ++i)
    if (knowledge_names[i] == name) return static_cast<LensKnowledge>(i);
  return std::nullopt;
}

ServoScene xiahou_servo_scene() {
  ServoScene scene;
  const std::array<RigHead, 2> rig = xiahou_rig();
  scene.heads.assign(rig.begin(), rig.end());
  return scene;
}

ServoRun run_servo(const ServoScene& scene, const ServoConfig& config, std::uint64_t seed,
                   const std::function<void(const ServoRow&)>& watch) {
  if (!(scene.period_s > 0.0) || !(scene.duration_s >= 0.0 && scene.duration_s <= 1e9 * scene.period_s))
    throw ConfigError("a servo's period is above zero, and its duration not more than 1e9 of them");
  ServoConfig own = config;
  own.axes = scene.axes;
  own.period_s = scene.period_s;
  std::vector<LoopedHead> heads = looped_heads(scene, own, seed);
  const auto num_periods = static_cast<std::size_t>(std::floor(scene.duration_s / scene.period_s + 1e-9)) + 1;
  ServoRun run;
  run.rows.reserve(num_periods * heads.size());
  for (std::size_t k = 0; k < num_periods; ++k) {
    const double t_s = static_cast<double>(k) * scene.period_s;
    for (std::size_t i = 0; i < heads.size(); ++i) {
      run.rows.push_back(step(scene, heads[i], t_s, i));
      if (watch) watch(run.rows.back());
    }
    for (LoopedHead& looped : heads) looped.head.advance(scene.period_s);
  }
  run.figures = figures_of(scene, run.rows);
  return run;
}

ServoFigures put_together(const std::vector<ServoFigures>& runs) {
  ServoFigures all;
  if (runs.empty()) return all;
  for (const ServoFigures& run : runs) {
    all.rms_px += run.rms_px * run.rms_px;
    all.between_px += run.between_px * run.between_px;
    all.central_third += run.central_third;
    all.in_image += run.in_image;
    all.num_lost += run.num_lost;
    all.num_found += run.num_found;
    all.search_s += run.search_s;
    all.focal_share += run.focal_share * run.focal_share;
    all.focal_z += run.focal_z * run.focal_z;
    all.unseen += run.unseen;
    all.max_px = std::max(all.max_px, run.max_px);
    all.errors_px.insert(all.errors_px.end(), run.errors_px.begin(), run.errors_px.end());
    all.gone.resize(std::max(all.gone.size(), run.gone.size()), 0.0);
    for (std::size_t i = 0; i < run.gone.size(); ++i) all.gone[i] = std::max(all.gone[i], run.gone[i]);
  }
  const auto count = static_cast<double>(runs.size());
  all.rms_px = std::sqrt(all.rms_px / count);
  all.between_px = std::sqrt(all.between_px / count);
  all.focal_share = std::sqrt(all.focal_share / count);
  all.focal_z = std::sqrt(all.focal_z / count);
  all.central_third /= count;
  all.in_image /= count;
  all.unseen /= count;
  std::ranges::sort(all.errors_px);
  if (!all.errors_px.empty()) all.p95_px = p95_of(all.errors_px);
  return all;
}

ServoRobustness servo_robustness(const ServoScene& scene, const ServoConfig& config, std::vector<double> gain_factors,
                                 std::vector<double> tau_factors, std::uint64_t seed, const Progress& progress) {
  ServoRobustness grid{std::move(gain_factors), std::move(tau_factors), {}};
  const std::size_t total = grid.gain_factors.size() * grid.tau_factors.size();
  for (const double gain : grid.gain_factors) {
    for (const double tau : grid.tau_factors) {
      report_progress(progress, "robustness", grid.rms_px.size(), total);
      ServoScene mismatched = scene;
      mismatched.mismatch.gain *= gain;
      mismatched.mismatch.tau *= tau;
      grid.rms_px.push_back(run_servo(mismatched, config, seed).figures.rms_px);
    }
  }
  return grid;
}

}  // namespace alidade
