#include "alidade/results/photos_outcome.h"

#include <fmt/format.h>

#include <cmath>

#include "alidade/formats/camera_json.h"
#include "alidade/geometry/degree.h"
#include "alidade/results/documents/calibration_document.h"

namespace alidade {
namespace {

/// "board's centre at (512, 80) px, 0.61 m away, turned 32° about x, 0° about y".
std::string photo_words(const CalibratedNow& known, const NextPhoto& photo) {
  Eigen::Vector3d centre = Eigen::Vector3d::Zero();
  for (const auto& point : known.board_points) centre += point / static_cast<double>(known.board_points.size());
  const Eigen::Vector3d centre_in_cam = photo.cam_from_board * centre;
  const Eigen::Vector3d turn = log_so3(photo.cam_from_board.rotation);
  const auto px = project(known.camera, centre_in_cam);
  return fmt::format("board's centre at ({:.0f}, {:.0f}) px, {:.2f} m away, turned {:.0f}° about x, {:.0f}° about y",
                     px ? px->x() : std::nan(""), px ? px->y() : std::nan(""), centre_in_cam.norm(), turn.x() / degree,
                     turn.y() / degree);
}

}  // namespace

JobOutcome outcome_of(const PhotoPlan& plan) {
  JobOutcome outcome;
  ResultDocument& document = outcome.document;
  document.command = "plan calibrate";
  document.counts = plan.counts;
  document.verdict = plan.verdict;
  if (plan.photos.empty()) return outcome;
  document.estimate["worst_3sigma_px"] = plan.worst_3sigma_px;
  document.estimate["planned_worst_3sigma_px"] = plan.photos.back().worst_3sigma_px;
  document.estimate["camera"] = camera_values(plan.now.camera);
  document.data.push_back(next_photos_table(plan));
  document.data.push_back(points_in_board_table(plan.now.board_points));
  for (std::size_t i = 0; i < plan.photos.size(); ++i) {
    outcome.lines.push_back(fmt::format("photo {}: {}: worst 3σ {:.2f} px", i + 1,
                                        photo_words(plan.now, plan.photos[i]), plan.photos[i].worst_3sigma_px));
  }
  return outcome;
}

}  // namespace alidade
