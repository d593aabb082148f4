#include "alidade/rangefinder.h"

#include <algorithm>
#include <cmath>
#include <opencv2/core.hpp>
#include <optional>
#include <utility>

#include "alidade/board_detector/board_guess.h"
#include "alidade/camera/camera_fault.h"
#include "alidade/rangefinder/checks/repeated_shots.h"
#include "alidade/rangefinder/checks/shot_checks.h"
#include "alidade/rangefinder/rangefinder.h"
#include "alidade/rangefinder/shot_photos.h"
#include "alidade/rangefinder/solve/align_edges.h"

namespace alidade {
namespace {

void require_sense(std::span<const Shot> shots, const Camera& camera, const RangefinderConfig& config) {
  std::vector<std::string> found = faults(config);
  if (const std::string of_camera = fault(camera); !of_camera.empty()) found.push_back(of_camera);
  const bool has_corners = std::ranges::any_of(shots, [](const Shot& shot) { return shot.board.has_value(); });
  if (has_corners && !config.board) found.emplace_back("the shots have corners of a board, but no board is given");
  require_none(found);
}

std::vector<Eigen::Vector3d> points_of(const RangefinderConfig& config) {
  return config.board ? points_in_board(*config.board) : std::vector<Eigen::Vector3d>{};
}

/// Enough boards determine the beam by themselves: a light that is elsewhere is no spot.
void look_where_boards_say(RangefinderCalibration& result, const PhotoByName& load_photo, const Camera& camera,
                           const ShotPhotosConfig& photos, const Progress& progress) {
  RangefinderConfig config = result.config;
  config.method = RangefinderMethod::plane;
  const std::vector<Eigen::Vector3d> points = points_of(config);
  RangefinderReport report = calibrate_rangefinder(result.measured, points, camera, config, progress);
  if (wants_scale(report, config)) {
    config.estimate_scale = true;
    report = calibrate_rangefinder(result.measured, points, camera, config, progress);
  }
  if (report.status != RangefinderReport::Status::converged) return;
  look_again_for_spots(result.measured, result.photos, load_photo, report.camera, report.beam, photos, progress);
}

/// A shot whose photo cannot be used is taken out, and named.
void reject_unreadable(RangefinderCalibration& result) {
  std::vector<Shot> kept;
  std::vector<ShotPhoto> seen;
  for (std::size_t i = 0; i < result.measured.size(); ++i) {
    Shot& shot = result.measured[i];
    if (result.photos[i].fault.empty()) {
      kept.push_back(std::move(shot));
      seen.push_back(std::move(result.photos[i]));
      continue;
    }
    result.counts.skipped.push_back({shot.table, shot.line, result.photos[i].fault});
    result.unreadable.push_back(std::move(shot));
  }
  result.measured = std::move(kept);
  result.photos = std::move(seen);
}

/// Boards and spots out of the photos.
void measure_photos(RangefinderCalibration& result, const PhotoByName& load_photo, const Camera& camera,
                    const Progress& progress) {
  const RangefinderConfig& config = result.config;
  ShotPhotosConfig photos{.board = config.board, .find_spots = config.method != RangefinderMethod::plane};
  photos.spot.colour = config.spot;
  result.photos = look_at_photos(result.measured, load_photo, camera, photos, progress);
  if (config.board && config.method == RangefinderMethod::joint)
    look_where_boards_say(result, load_photo, camera, photos, progress);
  reject_unreadable(result);
}

/// The board that the photos show where it is not the one given.
std::optional<WrongBoard> given_wrongly(const RangefinderCalibration& result, const PhotoByName& load_photo,
                                        const Progress& progress) {
  if (!result.config.board || result.config.method == RangefinderMethod::spot) return std::nullopt;
  std::vector<std::string> reasons;
  std::vector<std::size_t> in_vain;
  std::size_t num_found = 0;
  for (std::size_t i = 0; i < result.measured.size(); ++i) {
    const Shot& shot = result.measured[i];
    reasons.push_back(shot.no_board);
    num_found += shot.board ? 1 : 0;
    if (!shot.board && result.photos[i].has_photo) in_vain.push_back(i);
  }
  const PhotoLoader load = [&](std::size_t i) {
    const Shot& shot = result.measured[i];
    return load_photo(shot.photo_off.empty() ? shot.photo : shot.photo_off);
  };
  return wrong_board(reasons, num_found, in_vain, load, *result.config.board, progress);
}

/// No beam comes from boards that are parts of another one.
void refuse(const WrongBoard& wrong, const Camera& camera, RangefinderCalibration& result) {
  result.camera = camera;
  result.shots.resize(result.measured.size());
  for (std::size_t i = 0; i < result.shots.size(); ++i) {
    const std::string& reason = result.measured[i].no_board;
    result.shots[i].reason = reason.empty() ? wrong.reason : reason;
  }
  result.counts.dropped = result.shots.size();
  result.shots_dropped = static_cast<int>(result.shots.size());
  result.verdict = {.state = State::refused,
                    .exit_code = ExitCode::undetermined,
                    .sentence = wrong.reason,
                    .to_add = wrong.to_add,
                    .checks = {}};
}

/// The shots of one placement of the board as one.
void average_placements(RangefinderCalibration& result) {
  AveragedShots averaged = averaged_shots(result.measured);
  std::vector<ShotPhoto> photos;
  for (const std::size_t first : averaged.first)
    if (first < result.photos.size()) photos.push_back(std::move(result.photos[first]));
  result.photos = std::move(photos);
  result.measured = std::move(averaged.shots);
  result.repeated = std::move(averaged.repeated);
  result.counts.skipped.insert(result.counts.skipped.end(), result.repeated.begin(), result.repeated.end());
}

/// What stands beside the answer: what more shots bring, and how well each shot is predicted by the others.
void study(RangefinderCalibration& result, const Camera& camera, const Progress& progress) {
  const std::vector<Eigen::Vector3d> points = points_of(result.config);
  result.by_count = sigma_by_count(result.measured, result, points, camera, result.config, progress);
  result.left_out = leave_one_out(result.measured, result, points, camera, result.config, progress);
  if (result.config.rates_next_shots) result.gains = next_shot_gains(beam_now(result, result.config), {});
  result.assumed = rangefinder_assumptions(result);
  result.covariance = embedded_covariance(result.beam);
  result.parameter_names.assign(embedded_beam_names.begin(), embedded_beam_names.end());
}

}  // namespace

RangefinderCalibration rangefinder(std::vector<Shot> shots, const Camera& camera, const RangefinderConfig& config,
                                   const PhotoByName& load_photo, const Progress& progress) {
  require_sense(shots, camera, config);
  RangefinderCalibration result;
  result.config = config;
  result.counts.given = shots.size();
  result.measured = std::move(shots);
  if (load_photo) {
    measure_photos(result, load_photo, camera, progress);
    if (const auto wrong = given_wrongly(result, load_photo, progress)) {
      refuse(*wrong, camera, result);
      return result;
    }
  }
  average_placements(result);
  SolvedRangefinder solved = solve_rangefinder(result.measured, points_of(config), camera, config, progress);
  static_cast<RangefinderReport&>(result) = std::move(solved.report);
  result.config = std::move(solved.config);
  result.verdict = std::move(solved.verdict);
  result.counts.used = static_cast<std::size_t>(result.shots_used);
  result.counts.dropped = static_cast<std::size_t>(result.shots_dropped) + result.repeated.size();
  if (result.status == RangefinderReport::Status::converged) study(result, solved.camera, progress);
  if (result.verdict.exit_code == ExitCode::ok) heed_assumptions(result.assumed, result.verdict);
  return result;
}

EdgesCalibration rangefinder_by_edges(const std::vector<ScanRow>& scan, const GreyImage& photo, const Camera& camera,
                                      const EdgesConfig& config, const Progress& progress) {
  std::vector<std::string> found = faults(config);
  if (const std::string of_camera = fault(camera); !of_camera.empty()) found.push_back(of_camera);
  if (photo.width_px != camera.width_px || photo.height_px != camera.height_px ||
      photo.values.size() != static_cast<std::size_t>(photo.width_px) * static_cast<std::size_t>(photo.height_px)) {
    found.emplace_back("the photo must be of the camera's size");
  }
  require_none(found);
  EdgesConfig scaled = config;
  constexpr double usual_width_px = 640.0;  // of the images that the blurs are meant for
  for (double& blur_px : scaled.blur_px) blur_px *= camera.width_px / usual_width_px;
  EdgesCalibration result;
  static_cast<EdgesReport&>(result) = align_edges(scan, photo, camera, config.initial_guess, scaled, progress);
  result.camera = camera;
  result.verdict = edges_verdict(result);
  result.counts.given = scan.size();
  result.counts.used = static_cast<std::size_t>(result.num_edges);
  result.covariance = embedded_covariance(result.beam);
  result.parameter_names.assign(embedded_beam_names.begin(), embedded_beam_names.end());
  return result;
}

}  // namespace alidade
