#include "alidade/loop/servo_loop.h"

#include <algorithm>
#include <cmath>
#include <numeric>

#include "alidade/simulate/track.h"

namespace alidade {
namespace {

constexpr std::size_t most_on_their_way = 256;  // pictures taken and not yet known

/// Pictures of one head that are not yet known.
class PictureQueue {
 public:
  explicit PictureQueue(double latency_s) : latency_s_(latency_s) {}
  void take(const HeadSight& sight, bool is_seen) { ring_[num_taken_++ % ring_.size()] = {sight, is_seen}; }
  /// The newest picture known by now that was not asked for before.
  void deliver(double t_s, HeadServoInput& input) {
    while (num_known_ < num_taken_) {
      const Picture& next = ring_[num_known_ % ring_.size()];
      if (next.sight.t_capture_s + latency_s_ > t_s + 1e-9) return;
      input.sight.reset();
      if (next.is_seen) input.sight = next.sight;
      ++num_known_;
    }
  }

 private:
  struct Picture {
    HeadSight sight;
    bool is_seen = false;
  };
  std::array<Picture, most_on_their_way> ring_{};
  std::size_t num_taken_ = 0, num_known_ = 0;
  double latency_s_;
};

/// One head, its controller and the pictures between them.
struct LoopedHead {
  SimulatedHead head;
  HeadServo servo;
  PictureQueue pictures;
  Eigen::Vector2d centre_px;
  double focal_px;
};

std::array<ServoAxis, 2> true_axes(const ServoScene& scene) {
  std::array<ServoAxis, 2> axes = scene.axes;
  for (ServoAxis& axis : axes) axis.plant = scaled(axis.plant, scene.mismatch.gain, scene.mismatch.tau);
  return axes;
}

std::vector<LoopedHead> looped_heads(const ServoScene& scene, const ServoConfig& config, std::uint64_t seed) {
  std::vector<LoopedHead> looped;
  for (std::size_t i = 0; i < scene.heads.size(); ++i) {
    const RigHead& head = scene.heads[i];
    const HeadTruth truth{head, true_axes(scene), scene.encoder_step_rad, scene.sigma_encoder_rad, scene.sigma_px};
    const Eigen::Vector2d start = aim(head.head, scene.path.at(0.0)).value_or(Eigen::Vector2d::Zero());
    looped.push_back({SimulatedHead(truth, start, 2 * seed + 1000003 * i), HeadServo(head, config),
                      PictureQueue(scene.latency_s), centre_of(head.camera), focal_of(head.camera)});
  }
  return looped;
}

bool is_hidden(const ServoScene& scene, double t_s) {
  return std::ranges::any_of(scene.hidden_s,
                             [t_s](const auto& span) { return t_s >= span.first && t_s < span.second; });
}

ServoRow step(const ServoScene& scene, LoopedHead& looped, double t_s, std::size_t head) {
  const Eigen::Vector3d target = scene.path.at(t_s);
  ServoRow row;
  row.t_s = t_s;
  row.head = head;
  row.measured_rad = looped.head.read_encoders();
  const auto seen = looped.head.seen_pixel(target);
  const auto where = looped.head.true_pixel(target);
  const bool is_seen = seen && !is_hidden(scene, t_s);
  looped.pictures.take({t_s, row.measured_rad, seen.value_or(Eigen::Vector2d::Zero())}, is_seen);
  HeadServoInput input{t_s, row.measured_rad, std::nullopt};
  looped.pictures.deliver(t_s, input);
  const HeadServoOutput output = looped.servo.step(input);
  looped.head.send(output.command);
  row.command = output.command;
  row.asked_rad = output.asked_rad;
  row.predicted_rad = output.predicted_rad;
  row.has_prediction = output.has_prediction;
  row.sigma_predicted_px = looped.focal_px * output.sigma_rad;
  row.rate_rad_s = looped.head.rates_rad_s();
  row.event = output.event;
  row.error_px = where ? Eigen::Vector2d(*where - looped.centre_px)
                       : Eigen::Vector2d::Constant(std::numeric_limits<double>::quiet_NaN());
  if (is_seen) row.seen_px = *seen;
  row.is_in_picture = where && is_in_picture(scene.heads[head].camera, *where);
  return row;
}

ServoFigures figures_of(const ServoScene& scene, const std::vector<ServoRow>& rows) {
  ServoFigures figures;
  std::vector<double> errors;
  double sum2 = 0.0;
  std::size_t central = 0, visible = 0;
  for (const ServoRow& row : rows) {
    figures.num_lost += row.event == ServoEvent::lost ? 1u : 0u;
    figures.num_found += row.event == ServoEvent::found ? 1u : 0u;
    if (row.event == ServoEvent::lost || row.event == ServoEvent::searching) figures.search_s += scene.period_s;
    if (row.t_s < scene.warm_up_s) continue;
    const Camera& camera = scene.heads[row.head].camera;
    // Behind the camera: as wrong as can be, half a turn of pixels.
    const double error = row.error_px.allFinite() ? row.error_px.norm() : 3.14 * focal_of(camera);
    errors.push_back(error);
    sum2 += error * error;
    visible += row.is_in_picture ? 1u : 0u;
    central +=
        std::abs(row.error_px.x()) <= camera.width_px / 6.0 && std::abs(row.error_px.y()) <= camera.height_px / 6.0
            ? 1u
            : 0u;
  }
  if (errors.empty()) return figures;
  const auto count = static_cast<double>(errors.size());
  figures.rms_px = std::sqrt(sum2 / count);
  figures.central_third = static_cast<double>(central) / count;
  figures.in_picture = static_cast<double>(visible) / count;
  std::ranges::sort(errors);
  figures.p95_px = errors[static_cast<std::size_t>(0.95 * (count - 1.0))];
  figures.max_px = errors.back();
  return figures;
}

}  // namespace

ServoScene xiahou_servo_scene() {
  ServoScene scene;
  const std::array<RigHead, 2> rig = xiahou_rig();
  scene.heads.assign(rig.begin(), rig.end());
  return scene;
}

ServoRun run_servo(const ServoScene& scene, const ServoConfig& config, std::uint64_t seed,
                   const std::function<void(const ServoRow&)>& watch) {
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
  std::vector<double> maxima, p95;
  for (const ServoFigures& run : runs) {
    all.rms_px += run.rms_px * run.rms_px;
    all.central_third += run.central_third;
    all.in_picture += run.in_picture;
    all.num_lost += run.num_lost;
    all.num_found += run.num_found;
    all.search_s += run.search_s;
    maxima.push_back(run.max_px);
    p95.push_back(run.p95_px);
  }
  const auto count = static_cast<double>(runs.size());
  all.rms_px = std::sqrt(all.rms_px / count);
  all.central_third /= count;
  all.in_picture /= count;
  std::ranges::sort(maxima);
  std::ranges::sort(p95);
  all.max_px = maxima[maxima.size() / 2];
  all.p95_px = p95[p95.size() / 2];
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
      mismatched.mismatch = {scene.mismatch.gain * gain, scene.mismatch.tau * tau};
      grid.rms_px.push_back(run_servo(mismatched, config, seed).figures.rms_px);
    }
  }
  return grid;
}

}  // namespace alidade
