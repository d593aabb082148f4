#include "alidade/fleet/fleet_reading.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>

#include "alidade/geometry/degree.h"
#include "alidade/geometry/so3.h"
#include "alidade/observe/solve/solve.h"

namespace alidade {
namespace {

constexpr std::uint8_t none_explains = 255;

RotationSource source_of(FleetSource source) {
  // Of rates a kept row has the attitude that they add up to.
  return source == FleetSource::head ? RotationSource::head : RotationSource::attitude;
}

RotationLog log_of(const FleetCamera& camera) {
  RotationLog log;
  log.source = source_of(camera.source);
  log.num_points = camera.num_points;
  for (std::size_t i = 0; i < camera.num_buffered; ++i) {
    const auto& kept = camera.body.learning.rows[i];
    RotationRow& row = log.rows.emplace_back();
    row.t_s = static_cast<double>(i);
    row.pan_tilt_roll_rad = {kept[0], kept[1], kept[2]};
    row.base_from_cam = Eigen::Quaterniond(kept[0], kept[1], kept[2], kept[3]).normalized();
    for (std::size_t k = 0; k < camera.num_points; ++k)
      row.px.emplace_back(static_cast<double>(kept[4 + 2 * k]), static_cast<double>(kept[5 + 2 * k]));
  }
  return log;
}

/// About both axes of the image, and further than a few degrees.
bool turned_about_both(const FleetCamera& camera) {
  constexpr double min_rad = 3.0 * degree, little = 0.02;
  Eigen::Vector2d low = Eigen::Vector2d::Zero(), high = low;
  Eigen::Matrix3d first = Eigen::Matrix3d::Identity();
  for (std::size_t i = 0; i < camera.num_buffered; ++i) {
    const FleetRotation rotation = kept_rotation(camera.source, camera.body.learning.rows[i].data());
    const Eigen::Matrix3d base_from_cam = rotation.before * rotation.after;
    if (i == 0) first = base_from_cam;
    const Eigen::Vector2d turn =
        log_so3(Eigen::Quaterniond(Eigen::Matrix3d(first.transpose() * base_from_cam))).head<2>();
    low = low.cwiseMin(turn);
    high = high.cwiseMax(turn);
  }
  const Eigen::Vector2d span = high - low;
  return span.maxCoeff() >= min_rad && span.minCoeff() >= little * span.maxCoeff();
}

std::uint8_t code_of(RotationSource source, const std::string& words) {
  const std::vector<std::string> all = misreading_words(source);
  const auto found = std::ranges::find_if(all, [&](const std::string& each) { return each.find(words) == 0; });
  return found == all.end() ? none_explains : static_cast<std::uint8_t>(found - all.begin() + 1);
}

}  // namespace

FleetRotation kept_rotation(FleetSource source, const float* kept) {
  FleetRow row;
  row.source = source == FleetSource::head ? FleetSource::head : FleetSource::attitude;
  for (std::size_t i = 0; i < 4; ++i) row.rotation[i] = static_cast<double>(kept[i]);
  return rotation_of({}, row);
}

void seek_misreading(FleetCamera& camera, const FleetConfig& config) {
  if (!turned_about_both(camera)) return;
  const RotationLog log = log_of(camera);
  ObserveSetup setup;
  setup.width_px = config.width_px;
  setup.height_px = config.height_px;
  ObserveSolution as_read;
  as_read.scale = pixel_scale(log, setup.width_px, setup.height_px);
  const Misread misread = misread_rotation(log, setup, as_read);
  camera.misread = misread.words.empty() ? none_explains : code_of(log.source, misread.words);
}

void note_degrees(FleetCamera& camera) {
  camera.misread =
      camera.source == FleetSource::head ? code_of(RotationSource::head, "the angles are degrees") : none_explains;
}

std::string undetermined_sentence(const FleetCamera& camera) {
  const std::string fact = "the rows so far do not determine the camera: ";
  if (camera.misread == 0) return fact + "turn it about both axes";
  if (camera.misread != none_explains) {
    const std::vector<std::string> all = misreading_words(source_of(camera.source));
    if (camera.misread <= all.size()) return fact + all[camera.misread - 1U];
  }
  return fact + "turn it further about both axes, or check units and signs of its rotation and the order of its points";
}

void note_centre(FleetCamera& camera, const FleetConfig& config) {
  constexpr double most = 0.1, clearly = 5.0;
  camera.off_centre_percent = 0;
  double off = most;
  for (const int axis : {0, 1}) {
    const FleetTracking& tracking = camera.body.tracking;
    const double size = axis == 0 ? config.width_px : config.height_px;
    const double away = std::abs(tracking.x[static_cast<std::size_t>(2 + axis)] - 0.5 * (size - 1.0));
    const double variance = tracking.P[axis == 0 ? 13 : 18];  // of cx, cy: rows of 7, 6, 5, 4, 3, 2, 1
    if (away < clearly * std::sqrt(variance) || !(away / size > off)) continue;
    off = away / size;
    camera.off_centre_percent = static_cast<std::uint8_t>(std::min(std::round(100.0 * off), 255.0));
    camera.off_centre_axis = static_cast<std::uint8_t>(axis);
  }
}

std::string centre_sentence(const FleetCamera& camera) {
  if (camera.off_centre_percent == 0) return "";
  return fmt::format(
      "{} is {} % of the {} from the image centre: are the pixels of images of the size given, and not "
      "cropped?",
      camera.off_centre_axis == 0 ? "cx" : "cy", camera.off_centre_percent,
      camera.off_centre_axis == 0 ? "width" : "height");
}

}  // namespace alidade
