#include "alidade/rig.h"

#include <algorithm>
#include <cmath>
#include <mutex>
#include <opencv2/core.hpp>
#include <optional>
#include <stdexcept>
#include <utility>

#include "alidade/board_detector/board_guess.h"
#include "alidade/board_detector/find_boards.h"
#include "alidade/camera/camera_fault.h"
#include "alidade/rig/checks/repeated_stops.h"
#include "alidade/rig/checks/wrong_corners.h"
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

/// Why each photo shows no board; empty where it does.
std::vector<std::string> reasons_of(const BoardDetections& found, const std::vector<std::string>& unusable) {
  std::vector<std::string> reasons = unusable;
  for (std::size_t i = 0; i < reasons.size(); ++i)
    if (reasons[i].empty()) reasons[i] = found.photos[i].reason;
  return reasons;
}

/// The board that the photos show where it is not the one given.
std::optional<WrongBoard> given_wrongly(const std::vector<std::string>& reasons,
                                        const std::vector<std::string>& unusable, const PhotoLoader& load_photo,
                                        const Board& given, const Progress& progress) {
  std::vector<std::size_t> in_vain;
  for (std::size_t i = 0; i < reasons.size(); ++i)
    if (unusable[i].empty() && !reasons[i].empty()) in_vain.push_back(i);
  const auto num_found = static_cast<std::size_t>(std::ranges::count(reasons, std::string()));
  return wrong_board(reasons, num_found, in_vain, load_photo, given, progress);
}

/// Corners of the boards in the views' photos. A photo without a board is named. What they show where it is not the
/// board given: no view is then used.
std::optional<WrongBoard> find_board_corners(RigCalibration& result, const std::map<int, Camera>& cameras,
                                             const PhotoByName& load_photo, const Progress& progress) {
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
  std::vector<std::string> reasons = reasons_of(found, unusable);
  auto wrong = given_wrongly(reasons, unusable, load, *result.config.board, progress);
  std::vector<HeadView> seen;
  for (std::size_t i = 0; i < result.measured.size(); ++i) {
    HeadView& view = result.measured[i];
    if (wrong && reasons[i].empty()) reasons[i] = wrong->reason;
    if (reasons[i].empty()) {
      view.seen.corners = found.photos[i].view.corners;
      seen.push_back(std::move(view));
      continue;
    }
    result.no_board.push_back({view.seen.photo, 0, reasons[i]});
    if (!unusable[i].empty()) result.unreadable.push_back(result.no_board.back());
  }
  result.measured = std::move(seen);
  result.counts.skipped = result.no_board;
  return wrong;
}

/// Without corners that are elsewhere than the others of their view say.
void drop_wrong_corners(RigCalibration& result, const std::map<int, Camera>& cameras) {
  CheckedCorners checked = without_wrong_corners(result.measured, points_in_board(*result.config.board), cameras);
  result.measured = std::move(checked.views);
  result.wrong_corners = std::move(checked.wrong);
  result.counts.skipped.insert(result.counts.skipped.end(), result.wrong_corners.begin(), result.wrong_corners.end());
}

/// The views of one stop as one. Returns σ of a reading within a stop [rad].
double average_stops(RigCalibration& result) {
  AveragedStops stops = averaged_stops(result.measured);
  result.measured = std::move(stops.views);
  result.repeated = std::move(stops.repeated);
  result.counts.skipped.insert(result.counts.skipped.end(), result.repeated.begin(), result.repeated.end());
  return stops.sigma_within_rad;
}

}  // namespace

RigCalibration rig(std::vector<HeadView> views, const std::map<int, Camera>& cameras, const RigConfig& config,
                   const PhotoByName& load_photo, const Progress& progress) {
  require_sense(views, cameras, config);
  RigCalibration result;
  result.config = config;
  result.counts.given = views.size();
  result.measured = std::move(views);
  unwrap_readings(result.measured);
  std::optional<WrongBoard> wrong;
  if (load_photo) wrong = find_board_corners(result, cameras, load_photo, progress);
  if (config.reject_outliers) drop_wrong_corners(result, cameras);
  const double sigma_within_rad = average_stops(result);
  const auto calibrated = config.estimate_by_need ? calibrate_rig_by_need : calibrate_rig;
  static_cast<RigReport&>(result) =
      calibrated(result.measured, points_in_board(*config.board), cameras, config, progress);
  result.verdict = rig_verdict(result, config);
  if (wrong) {
    result.verdict.sentence = wrong->reason;
    result.verdict.to_add = wrong->to_add;
  }
  result.counts.used = static_cast<std::size_t>(result.views_used);
  result.counts.dropped = static_cast<std::size_t>(result.views_dropped) + result.repeated.size();
  if (result.status != RigReport::Status::converged) return result;
  for (RigHead& one : result.rig.heads) {
    double& sigma_rad = one.head.encoder.sigma_rad;  // of one reading: that of a stop's mean, and what is within it
    if (result.sigma_encoder_is_estimated) sigma_rad = std::hypot(sigma_rad, sigma_within_rad);
  }
  result.covariance = result.rig.cov;
  result.parameter_names = parameter_names(result.rig);
  return result;
}

}  // namespace alidade
