#include "alidade/rig.h"

#include <algorithm>
#include <mutex>
#include <opencv2/core.hpp>
#include <stdexcept>
#include <utility>

#include "alidade/board_detector/find_boards.h"
#include "alidade/camera/camera_fault.h"
#include "alidade/rig/rig.h"

namespace alidade {
namespace {

void require_sense(std::span<const HeadView> views, const std::map<int, Camera>& cameras, const RigConfig& config) {
  std::vector<std::string> found = faults(config);
  for (const auto& [id, camera] : cameras) {
    const std::string of_camera = fault(camera);
    if (!of_camera.empty()) found.push_back("head " + std::to_string(id) + ": " + of_camera);
  }
  for (const HeadView& view : views) {
    if (view.pan_tilt_rad.allFinite()) continue;
    found.push_back(view.seen.photo + ": the readings of its encoders are not finite");
    break;
  }
  if (found.empty()) found.push_back(image_fault(views, cameras));
  if (found.back().empty()) found.pop_back();
  require_none(found);
}

std::string size_fault(const cv::Mat& photo, int head, const std::map<int, Camera>& cameras) {
  const auto found = cameras.find(head);
  if (found == cameras.end()) return "head " + std::to_string(head) + " has no camera";
  const Camera& camera = found->second;
  if (photo.cols == camera.width_px && photo.rows == camera.height_px) return "";
  return "is " + std::to_string(photo.cols) + "x" + std::to_string(photo.rows) + ", the camera of head " +
         std::to_string(head) + " is for " + std::to_string(camera.width_px) + "x" + std::to_string(camera.height_px);
}

/// Corners of the boards in the views' photos. A photo without a board is named.
void find_board_corners(RigCalibration& result, const std::map<int, Camera>& cameras, const PhotoByName& load_photo,
                        const Progress& progress) {
  std::vector<std::string> unusable(result.measured.size());
  const auto load = [&](std::size_t i) -> cv::Mat {
    try {
      cv::Mat photo = load_photo(result.measured[i].seen.photo);
      unusable[i] = size_fault(photo, result.measured[i].head, cameras);
      if (!unusable[i].empty()) throw std::runtime_error(unusable[i]);
      return photo;
    } catch (const Interrupted&) {
      throw;
    } catch (const std::exception& error) {
      unusable[i] = error.what();
      throw;
    }
  };
  const BoardDetections found =
      find_boards(result.measured.size(), load, *result.config.board, /*reject_partial=*/false, progress);
  std::vector<HeadView> seen;
  for (std::size_t i = 0; i < result.measured.size(); ++i) {
    HeadView& view = result.measured[i];
    if (unusable[i].empty() && found.photos[i].found()) {
      view.seen.corners = found.photos[i].view.corners;
      seen.push_back(std::move(view));
      continue;
    }
    result.no_board.push_back({view.seen.photo, 0, unusable[i].empty() ? found.photos[i].reason : unusable[i]});
    if (!unusable[i].empty()) result.unreadable.push_back(result.no_board.back());
  }
  result.measured = std::move(seen);
  result.counts.skipped = result.no_board;
}

}  // namespace

RigCalibration rig(std::vector<HeadView> views, const std::map<int, Camera>& cameras, const RigConfig& config,
                   const PhotoByName& load_photo, const Progress& progress) {
  require_sense(views, cameras, config);
  RigCalibration result;
  result.config = config;
  result.counts.given = views.size();
  result.measured = std::move(views);
  if (load_photo) find_board_corners(result, cameras, load_photo, progress);
  const auto calibrated = config.estimate_by_need ? calibrate_rig_by_need : calibrate_rig;
  static_cast<RigReport&>(result) =
      calibrated(result.measured, points_in_board(*config.board), cameras, config, progress);
  result.verdict = rig_verdict(result, config);
  result.counts.used = static_cast<std::size_t>(result.views_used);
  result.counts.dropped = static_cast<std::size_t>(result.views_dropped);
  if (result.status != RigReport::Status::converged) return result;
  result.covariance = result.rig.cov;
  result.parameter_names = parameter_names(result.rig);
  return result;
}

}  // namespace alidade
