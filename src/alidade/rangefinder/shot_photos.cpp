#include "alidade/rangefinder/shot_photos.h"

#include <tbb/parallel_for.h>

#include <atomic>
#include <cmath>
#include <opencv2/core.hpp>

#include "alidade/board/board_pose.h"
#include "alidade/imaging/find_board.h"

namespace alidade {
namespace {

/// Corners of the board, found again where the lens and the pose are known by the first ones.
void find_corners(const cv::Mat& photo, const Camera& camera, const ShotPhotosConfig& config, Shot& shot,
                  ShotPhoto& seen, std::optional<SeenBoard>& board_in_photo) {
  BoardDetection found = find_board(photo, *config.board);
  if (!found.found()) {
    seen.no_board = found.reason;
    return;
  }
  const std::vector<Eigen::Vector3d> points = points_in_board(*config.board);
  std::optional<BoardPoseFit> fit = fit_board_pose(camera, found.view, points);
  if (fit) {
    BoardDetection again = refind_board(photo, *config.board, found.view, camera, fit->pose.cam_from_board);
    if (again.found()) {
      const auto better = fit_board_pose(camera, again.view, points);
      if (better) {
        found = std::move(again);
        fit = better;
      }
    }
  }
  if (!fit) {
    seen.no_board = "no pose fits the board's corners with this camera";
    return;
  }
  board_in_photo = SeenBoard{*config.board, camera, fit->pose.cam_from_board};
  shot.board = std::move(found.view);
  shot.board->photo = shot.name;
}

void find_spot(const cv::Mat& photo, const cv::Mat& photo_off, const std::optional<SeenBoard>& board,
               const ShotPhotosConfig& config, Shot& shot, ShotPhoto& seen) {
  LaserSpotAids aids;
  if (!photo_off.empty()) aids.photo_off = &photo_off;
  aids.seen_board = board;
  LaserSpot spot = find_laser_spot(photo, aids, config.spot);
  if (spot.found()) {
    shot.spot = Spot{.px = spot.px, .sigma_px = std::sqrt(0.5 * spot.cov.trace())};
    seen.spot = std::move(spot);
  } else {
    seen.no_spot = spot.reason;
  }
}

std::string size_fault(const cv::Mat& photo, const Camera& camera) {
  if (photo.cols == camera.width_px && photo.rows == camera.height_px) return "";
  return "is " + std::to_string(photo.cols) + "x" + std::to_string(photo.rows) + ", the camera is for " +
         std::to_string(camera.width_px) + "x" + std::to_string(camera.height_px);
}

ShotPhoto look_at(std::size_t i, Shot& shot, const ShotPhotoLoader& load_photo, const Camera& camera,
                  const ShotPhotosConfig& config) {
  ShotPhoto seen;
  const cv::Mat photo = load_photo(i, false);
  if (photo.empty()) return seen;
  seen.has_photo = true;
  const cv::Mat photo_off = load_photo(i, true);
  seen.fault = size_fault(photo, camera);
  if (seen.fault.empty() && !photo_off.empty() && photo_off.size() != photo.size())
    seen.fault = "has another size than its photo without the laser";
  if (!seen.fault.empty()) return seen;
  std::optional<SeenBoard> board;
  if (config.board) find_corners(photo_off.empty() ? photo : photo_off, camera, config, shot, seen, board);
  if (config.find_spots && !shot.spot) find_spot(photo, photo_off, board, config, shot, seen);
  return seen;
}

}  // namespace

std::vector<ShotPhoto> look_at_photos(std::span<Shot> shots, const ShotPhotoLoader& load_photo, const Camera& camera,
                                      const ShotPhotosConfig& config, const Progress& progress) {
  std::vector<ShotPhoto> seen(shots.size());
  std::atomic<std::size_t> done{0};
  report_progress(progress, "looking at photos", 0, shots.size());
  tbb::parallel_for(
      tbb::blocked_range<std::size_t>(0, shots.size(), 1),
      [&](const tbb::blocked_range<std::size_t>& range) {
        for (std::size_t i = range.begin(); i < range.end(); ++i) {
          try {
            seen[i] = look_at(i, shots[i], load_photo, camera, config);
          } catch (const Interrupted&) {
            throw;
          } catch (const std::exception& error) {
            seen[i] = {.has_photo = true, .fault = error.what(), .no_board = {}, .no_spot = {}};
          }
          report_progress(progress, "looking at photos", ++done, shots.size());
        }
      },
      tbb::simple_partitioner{});
  return seen;
}

}  // namespace alidade
