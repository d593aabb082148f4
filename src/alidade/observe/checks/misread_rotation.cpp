#include <algorithm>
#include <cmath>
#include <functional>

#include "alidade/geometry/degree.h"
#include "alidade/geometry/so3.h"
#include "alidade/observe/solve/solve.h"

namespace alidade {
namespace {

/// A way to misread angles, rates or attitudes, and the advice if the pixels fit once it is undone.
struct Misreading {
  const char* words;
  std::function<void(RotationRow&)> undo;
};

void scale_all(RotationRow& row, const Eigen::Vector3d& by) {
  row.pan_tilt_roll_rad = row.pan_tilt_roll_rad.cwiseProduct(by);
  row.rate_rad_per_s = row.rate_rad_per_s.cwiseProduct(by);
}

std::function<void(RotationRow&)> scaled(double x, double y, double z) {
  return [by = Eigen::Vector3d(x, y, z)](RotationRow& row) { scale_all(row, by); };
}

void exchange(RotationRow& row) {
  std::swap(row.pan_tilt_roll_rad.x(), row.pan_tilt_roll_rad.y());
  std::swap(row.rate_rad_per_s.x(), row.rate_rad_per_s.y());
}

const Misreading exchanged_pixels{"x and y of the points are exchanged", [](RotationRow& row) {
                                    for (Eigen::Vector2d& px : row.px) std::swap(px.x(), px.y());
                                  }};

std::vector<Misreading> misreadings_of(RotationSource source) {
  if (source == RotationSource::attitude) {
    return {{"the quaternions are of the base in the camera, not of the camera in the base",
             [](RotationRow& row) { row.base_from_cam = row.base_from_cam.conjugate(); }},
            exchanged_pixels};
  }
  if (source == RotationSource::head) {
    return {{"pan counts the other way (to the right), or the image is mirrored left to right", scaled(-1, 1, 1)},
            {"tilt counts the other way (down), or the image is mirrored top to bottom", scaled(1, -1, 1)},
            {"pan and tilt count the other way, or the camera hangs upside down", scaled(-1, -1, 1)},
            {"pan and tilt are exchanged", exchange},
            {"pan and tilt are exchanged, and pan counts the other way",
             [](RotationRow& row) {
               exchange(row);
               scale_all(row, {-1.0, 1.0, 1.0});
             }},
            {"the angles are half of what the head turns", scaled(2, 2, 2)},
            {"the angles are twice what the head turns", scaled(0.5, 0.5, 0.5)},
            {"the angles are degrees: name the columns pan_deg, tilt_deg", scaled(degree, degree, degree)},
            exchanged_pixels};
  }
  return {{"ω_y counts the other way, or the image is mirrored left to right", scaled(1, -1, -1)},
          {"ω_x counts the other way, or the image is mirrored top to bottom", scaled(-1, 1, -1)},
          {"ω_x and ω_y count the other way, or the camera hangs upside down", scaled(-1, -1, 1)},
          {"the rates are of the world against the camera: all signs are reversed", scaled(-1, -1, -1)},
          {"ω_x and ω_y are exchanged", exchange},
          {"the rates are half of what the camera turns", scaled(2, 2, 2)},
          {"the rates are twice what the camera turns", scaled(0.5, 0.5, 0.5)},
          {"the rates are degrees per second", scaled(degree, degree, degree)},
          exchanged_pixels};
}

constexpr std::size_t max_frames = 150;

/// Noise [px] with which the thinned rows of the first seconds are explained; infinite if they are not explained.
struct Explanation {
  double noise_px = std::numeric_limits<double>::infinity();
  bool tells = false;  ///< Whether the focal lengths are determined: otherwise any reading explains the log.
};

Explanation explanation_of(const RotationLog& log, const ObserveSetup& config, const PixelScale& scale,
                           const Progress& progress) {
  MotionReader reader(log.source, config.max_gap_s);
  FrameBuffer buffer(log.num_points, max_frames);
  std::vector<Eigen::Vector2d> px(log.num_points);
  for (const RotationRow& row : log.rows) {
    const RotationFrame frame = reader.next(row);
    for (std::size_t i = 0; i < px.size(); ++i) {
      px[i] = i < frame.px.size() ? scale.normalised(frame.px[i]) : Eigen::Vector2d::Constant(not_seen);
    }
    if (frame.starts_segment && buffer.size() > 0) break;
    buffer.add(frame, px);
  }
  AdjustConfig adjust_with;
  adjust_with.start = start_camera(config, scale);
  adjust_with.other_starts = {0.7, 2.5, 5.0, 10.0};
  adjust_with.max_iterations = 20;  // with a wrong reading the cost has no minimum to reach
  adjust_with.reject = false;
  const Adjustment adjustment = adjust(buffer, adjust_with, progress);
  if (!adjustment.has_value) return {};
  constexpr double most = 0.05;  // σ over the focal length that is acceptable in an answer
  const Eigen::Vector2d variance = CommonMatrix(adjustment.solution.bound()).diagonal().head<2>();
  const Eigen::Vector2d focal = adjustment.solution.camera.k.head<2>();
  const bool tells = (variance.array() > 0.0).all() && (variance.array().sqrt() < most * focal.array()).all();
  return {adjustment.solution.rms_px * scale.scale, tells};
}

/// Very small rotations, or rotations about one axis only, determine nothing however they are read.
bool motion_suffices(const ObserveMotion& motion) {
  constexpr double min_rad = 3.0 * degree, little = 0.02;  // share of the largest: below it, the axis did not rotate
  return motion.span_rad >= min_rad && motion.path_rad.head<2>().minCoeff() >= little * motion.path_rad.maxCoeff();
}

bool rejects_many(const ObserveSolution& report) {
  constexpr double many = 0.2;
  const auto seen = static_cast<double>(report.reference.bundle.observations.size() + report.pixels_rejected);
  return static_cast<double>(report.pixels_rejected) > many * seen;
}

}  // namespace

bool may_be_misread(const ObserveSolution& report) {
  constexpr double max_ordinary_px = 2.0;
  using Status = ObserveSolution::Status;
  constexpr double ask_beyond = 5.0;
  const bool has_answer = report.status == Status::ok || report.status == Status::too_few_data;
  if (!has_answer) return motion_suffices(report.motion);
  if (std::ranges::any_of(report.causes, [](const CauseScore& cause) { return cause.z >= ask_beyond; })) return true;
  // With causes estimated until none is indicated, the focal length may no longer be determined.
  constexpr double vague = 0.05;
  for (const std::size_t axis : {0U, 1U})
    if (report.status == Status::ok && report.quantities[axis].sigma > vague * report.quantities[axis].value)
      return motion_suffices(report.motion);
  return report.status == Status::ok && (report.sigma_px > max_ordinary_px || rejects_many(report));
}

std::vector<std::string> misreading_words(RotationSource source) {
  std::vector<std::string> words;
  for (const Misreading& misreading : misreadings_of(source)) words.emplace_back(misreading.words);
  return words;
}

Misread misread_rotation(const RotationLog& log, const ObserveSetup& config, const ObserveSolution& report,
                         const Progress& progress) {
  if (log.source == RotationSource::none || config.rotation == RotationKnowledge::free) return {.is_sought = true};
  constexpr double max_px = 3.0, clearly = 0.3;            // of the noise as the log is read
  constexpr double ordinary_px = 1.0, beyond_doubt = 0.1;  // then no other cause is tried
  // explanation_of() estimates neither distortion nor mounting: if the solution explains the log with these, its noise
  // counts as that of the log as read.
  const bool is_explained = report.status == ObserveSolution::Status::ok && !rejects_many(report);
  const double as_read = std::min(explanation_of(log, config, report.scale, progress).noise_px,
                                  is_explained ? report.sigma_px : std::numeric_limits<double>::infinity());
  Misread best{.is_sought = true};
  double least = std::min(max_px, clearly * as_read);
  for (const Misreading& misreading : misreadings_of(log.source)) {
    RotationLog undone = log;
    for (RotationRow& row : undone.rows) misreading.undo(row);
    const Explanation explained = explanation_of(undone, config, report.scale, progress);
    if (!explained.tells || !(explained.noise_px < least)) continue;
    least = explained.noise_px;
    best.words = misreading.words;
    best.explains_all = least < std::min(ordinary_px, beyond_doubt * as_read);
  }
  return best;
}

}  // namespace alidade
