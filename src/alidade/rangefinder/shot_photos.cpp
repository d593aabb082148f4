#include "alidade/rangefinder/shot_photos.h"

#include <tbb/parallel_for.h>

#include <algorithm>
#include <atomic>
#include <cmath>
#include <opencv2/core.hpp>

#include "alidade/board/board_pose.h"
#include "alidade/board_detector/find_board.h"

namespace alidade {
namespace {

/// Corners of the board, found again where the lens and the pose are known by the first ones.
void find_corners(const cv::Mat& photo, const Camera& camera, const ShotPhotosConfig& config, Shot& shot,
                  std::optional<SeenBoard>& board_in_photo) {
  BoardDetection found = find_board(photo, *config.board);
  if (!found.found()) {
    shot.no_board = found.reason;
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
    shot.no_board = "no pose fits the board's corners with this camera";
    return;
  }
  board_in_photo = SeenBoard{*config.board, camera, fit->pose.cam_from_board};
  shot.board = std::move(found.view);
  shot.board->photo = shot.name;
}

void find_spot(const cv::Mat& photo, const cv::Mat& photo_off, const std::optional<SeenBoard>& board,
               const std::vector<Eigen::Vector2d>& region, const ShotPhotosConfig& config, Shot& shot,
               ShotPhoto& seen) {
  LaserSpotAids aids;
  if (!photo_off.empty()) aids.photo_off = &photo_off;
  aids.seen_board = board;
  aids.region = region;
  LaserSpot spot = find_laser_spot(photo, aids, config.spot);
  seen.no_spot.clear();
  if (spot.found()) {
    shot.spot = Spot{.px = spot.px, .sigma_px = std::sqrt(0.5 * spot.cov.trace()), .sigma_is_least = true};
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

cv::Mat loaded(const PhotoByName& load_photo, const std::string& name) {
  return name.empty() ? cv::Mat() : load_photo(name);
}

ShotPhoto look_at(Shot& shot, const PhotoByName& load_photo, const Camera& camera, const ShotPhotosConfig& config) {
  ShotPhoto seen;
  if (shot.spot && !config.board) return seen;  // nothing to look for
  const cv::Mat photo = loaded(load_photo, shot.photo);
  if (photo.empty()) return seen;
  seen.has_photo = true;
  const cv::Mat photo_off = loaded(load_photo, shot.photo_off);
  seen.fault = size_fault(photo, camera);
  if (seen.fault.empty() && !photo_off.empty() && photo_off.size() != photo.size())
    seen.fault = "has another size than its photo without the laser";
  if (!seen.fault.empty()) return seen;
  std::optional<SeenBoard> board;
  if (config.board) find_corners(photo_off.empty() ? photo : photo_off, camera, config, shot, board);
  if (config.find_spots && !shot.spot) find_spot(photo, photo_off, board, {}, config, shot, seen);
  return seen;
}

/// Where the boards' beam is seen at a reading, with how far off it may be.
struct PredictedSpot {
  Eigen::Vector2d px;
  double reach_px = 0.0;  ///< 5σ, and what a finder is off by.
};

std::optional<PredictedSpot> predicted_spot(const Beam& beam, const Camera& camera, const Shot& shot) {
  constexpr double sigmas = 5.0, finder_px = 3.0;
  if (!shot.board) return std::nullopt;
  const auto pixel = measured_pixel(beam, camera, shot.range_m, shot.sigma_range_m);
  if (!pixel) return std::nullopt;
  const double trace = 0.5 * pixel->cov.trace(), det = pixel->cov.determinant();
  const double largest = trace + std::sqrt(std::max(0.0, trace * trace - det));
  return PredictedSpot{pixel->px, sigmas * std::sqrt(largest) + finder_px};
}

std::string at_pixel_of(const Eigen::Vector2d& px) {
  return "(" + std::to_string(std::lround(px.x())) + ", " + std::to_string(std::lround(px.y())) + ")";
}

void look_again(Shot& shot, ShotPhoto& seen, const PhotoByName& load_photo, const Camera& camera,
                const PredictedSpot& where, const ShotPhotosConfig& config) {
  if (shot.spot) {
    if ((shot.spot->px - where.px).norm() <= where.reach_px) return;
    seen.false_spot = "the light at " + at_pixel_of(shot.spot->px) + " is not the spot: by the boards that is within " +
                      std::to_string(std::lround(where.reach_px)) + " px of " + at_pixel_of(where.px);
    shot.spot.reset();
    seen.spot.reset();
  }
  const cv::Mat photo = loaded(load_photo, shot.photo), photo_off = loaded(load_photo, shot.photo_off);
  std::optional<SeenBoard> board;
  const std::vector<Eigen::Vector3d> points = points_in_board(*config.board);
  if (const auto fit = fit_board_pose(camera, *shot.board, points))
    board = SeenBoard{*config.board, camera, fit->pose.cam_from_board};
  const double r = where.reach_px;
  std::vector<Eigen::Vector2d> region;
  for (const auto& [x, y] : {std::pair{-r, -r}, std::pair{r, -r}, std::pair{r, r}, std::pair{-r, r}})
    region.emplace_back(where.px + Eigen::Vector2d(x, y));
  const std::string at_first = seen.no_spot;
  find_spot(photo, photo_off, board, region, config, shot, seen);
  if (!seen.spot && !at_first.empty()) seen.no_spot = at_first;
}

/// Spots that hardly any photo shows are not the laser's.
void drop_rare_spots(std::span<Shot> shots, std::span<ShotPhoto> seen, std::size_t num_looked) {
  const auto num_found = static_cast<std::size_t>(
      std::count_if(seen.begin(), seen.end(), [](const ShotPhoto& photo) { return photo.spot.has_value(); }));
  if (num_found == 0 || 3 * num_found >= num_looked) return;
  for (std::size_t i = 0; i < shots.size(); ++i) {
    if (!seen[i].spot) continue;
    seen[i].false_spot = "the light at " + at_pixel_of(seen[i].spot->px) + " is not taken for the spot: only " +
                         std::to_string(num_found) + " of " + std::to_string(num_looked) + " photos show one";
    seen[i].spot.reset();
    shots[i].spot.reset();
  }
}

}  // namespace

void look_again_for_spots(std::span<Shot> shots, std::span<ShotPhoto> seen, const PhotoByName& load_photo,
                          const Camera& camera, const Beam& by_boards, const ShotPhotosConfig& config,
                          const Progress& progress) {
  std::vector<std::optional<PredictedSpot>> where(shots.size());
  std::size_t num_looked = 0;
  for (std::size_t i = 0; i < shots.size(); ++i) {
    const bool is_ours = seen[i].has_photo && seen[i].fault.empty() && (seen[i].spot || !shots[i].spot);
    constexpr double farthest_px = 100.0;  // known no better, the boards say nothing of where it is
    if (is_ours) where[i] = predicted_spot(by_boards, camera, shots[i]);
    if (where[i] && where[i]->reach_px > farthest_px) where[i].reset();
    num_looked += where[i] ? 1 : 0;
  }
  std::atomic<std::size_t> done{0};
  tbb::parallel_for(std::size_t{0}, shots.size(), [&](std::size_t i) {
    if (where[i]) look_again(shots[i], seen[i], load_photo, camera, *where[i], config);
    report_progress(progress, "looking again at spots", ++done, shots.size());
  });
  drop_rare_spots(shots, seen, num_looked);
}

std::vector<ShotPhoto> look_at_photos(std::span<Shot> shots, const PhotoByName& load_photo, const Camera& camera,
                                      const ShotPhotosConfig& config, const Progress& progress) {
  std::vector<ShotPhoto> seen(shots.size());
  std::atomic<std::size_t> done{0};
  report_progress(progress, "looking at photos", 0, shots.size());
  tbb::parallel_for(
      tbb::blocked_range<std::size_t>(0, shots.size(), 1),
      [&](const tbb::blocked_range<std::size_t>& range) {
        for (std::size_t i = range.begin(); i < range.end(); ++i) {
          try {
            seen[i] = look_at(shots[i], load_photo, camera, config);
          } catch (const Interrupted&) {
            throw;
          } catch (const std::exception& error) {
            seen[i] = {.has_photo = true, .fault = error.what(), .no_spot = {}};
          }
          report_progress(progress, "looking at photos", ++done, shots.size());
        }
      },
      tbb::simple_partitioner{});
  return seen;
}

}  // namespace alidade
