#include "cli/commands/observe_photos.h"

#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <numeric>
#include <opencv2/core.hpp>

#include "alidade/formats/camera_file.h"
#include "alidade/formats/intrinsics_file.h"
#include "alidade/matching/match_photos.h"
#include "alidade/results/turned_document.h"
#include "alidade/tables/pairs_file.h"
#include "cli/app/photo_options.h"

namespace alidade::cli {
namespace {

/// What was read: matches, and why photos take no part from the start.
struct Given {
  MatchedPhotos photos;
  std::vector<std::string> reasons;
};

void require_told_size_of(const TurnedArgs& args, const MatchedPhotos& photos) {
  const bool is_told = args.width_px > 0;
  if (!is_told || (args.width_px == photos.width_px && args.height_px == photos.height_px)) return;
  throw InputError(fmt::format("the photos are {}x{}, but the camera or --size says {}x{}", photos.width_px,
                               photos.height_px, args.width_px, args.height_px));
}

Given match_set(const TurnedArgs& args, const PhotoSet& set, Run& run) {
  const Photos photos = set.photos();
  PhotoMatches found = match_photos(photos.names, photos.load, {}, run.progress);
  set.require_readable(found.num_unreadable, found.reasons.front());
  require_told_size_of(args, found.photos);
  const std::size_t matches =
      std::transform_reduce(found.photos.pairs.begin(), found.photos.pairs.end(), std::size_t{0}, std::plus<>(),
                            [](const auto& pair) { return pair.matches.size(); });
  run.say(
      fmt::format("{} photos, {} matches between {} pairs of them", set.size(), matches, found.photos.pairs.size()));
  run.lap("match");
  return {std::move(found.photos), std::move(found.reasons)};
}

/// The least size that holds the features.
void guess_size(MatchedPhotos& photos) {
  double width = 1.0, height = 1.0;
  for (const auto& features : photos.features) {
    for (const Eigen::Vector2d& px : features) {
      width = std::max(width, px.x());
      height = std::max(height, px.y());
    }
  }
  photos.width_px = static_cast<int>(std::ceil(std::min(width, 1e6))) + 1;
  photos.height_px = static_cast<int>(std::ceil(std::min(height, 1e6))) + 1;
}

/// Matches outside the image are of another one. A few may be wrong.
void require_features_inside(const TurnedArgs& args, const MatchedPhotos& photos) {
  std::size_t outside = 0, all = 0;
  for (const auto& features : photos.features) {
    for (const Eigen::Vector2d& px : features) {
      const bool inside = px.minCoeff() > -1.0 && px.x() < photos.width_px && px.y() < photos.height_px;
      outside += inside ? 0 : 1;
      ++all;
    }
  }
  if (20 * outside <= all) return;
  throw InputError(fmt::format("{}: {} of {} points lie outside a picture of {}x{} px: check --size", args.pairs,
                               outside, all, photos.width_px, photos.height_px));
}

Given matches_of_file(const TurnedArgs& args, Run& run) {
  run.add_input("pairs", args.pairs);
  PairsFile read = read_pairs(args.pairs, args.skip_bad);
  Given given{std::move(read.photos), {}};
  given.reasons.resize(given.photos.names.size());
  given.photos.width_px = args.width_px;
  given.photos.height_px = args.height_px;
  if (args.width_px <= 0) {
    guess_size(given.photos);
    run.say(fmt::format("picture size {}x{} is the least that holds the points: give --size WIDTHxHEIGHT",
                        given.photos.width_px, given.photos.height_px));
  }
  require_features_inside(args, given.photos);
  run.document.counts.given = read.skipped.size();
  run.document.counts.skipped = std::move(read.skipped);
  run.lap("read");
  return given;
}

/// The features as a camera of the same fx, fy, cx, cy without distortion would have seen them.
void undistort_features(MatchedPhotos& photos, const Camera& camera) {
  const Eigen::VectorXd known = params(camera.lens);
  for (auto& features : photos.features) {
    for (Eigen::Vector2d& px : features) {
      const auto ray = unproject(camera, px);
      if (ray && ray->z() > 1e-6) {
        px = {known[0] * ray->x() / ray->z() + known[2], known[1] * ray->y() / ray->z() + known[3]};
      } else {
        px = {-1e6, -1e6};  // agrees with nothing
      }
    }
  }
}

void summarize_turned(const TurnedReport& report, const TurnedObservation& observation, Run& run) {
  for (const ObservedQuantity& quantity : observation.report.quantities) {
    run.say(fmt::format("{:<11} {:.6g} ± {:.2g}   (3σ)", quantity.name, quantity.value, 3.0 * quantity.sigma));
  }
  run.say(fmt::format("σ of a pixel {:.3g} px; {} of {} matches kept; turned by up to {:.3g}°", report.sigma_px,
                      report.num_kept, report.num_matches, report.largest_turn_rad * 180.0 / 3.14159265358979));
}

void tell_left_out(const TurnedReport& report, const MatchedPhotos& photos, Run& run) {
  for (std::size_t i = 0; i < photos.names.size(); ++i) {
    if (!report.photos[i].is_used) run.say(fmt::format("left out: {} {}", photos.names[i], report.photos[i].reason));
  }
}

}  // namespace

bool is_photo_argument(const std::string& argument) {
  static constexpr std::array endings{".jpg", ".jpeg", ".png",  ".tif", ".tiff", ".bmp", ".webp", ".ppm",
                                      ".pgm", ".heic", ".heif", ".dng", ".cr2",  ".nef", ".arw",  ".jp2"};
  std::error_code ignored;
  if (std::filesystem::is_directory(argument, ignored)) return true;
  std::string ending = std::filesystem::path(argument).extension().string();
  std::transform(ending.begin(), ending.end(), ending.begin(), [](unsigned char c) { return std::tolower(c); });
  return std::find(endings.begin(), endings.end(), ending) != endings.end();
}

ExitCode observe_photos(TurnedArgs args, Run& run) {
  std::optional<PhotoSet> set;
  if (args.pairs.empty()) set.emplace(args.photos);
  Given given = set ? match_set(args, *set, run) : matches_of_file(args, run);
  if (args.lens) {
    undistort_features(given.photos, *args.lens);
    args.config.lens_terms = 0;
  }
  TurnedReport report = observe_turned(given.photos, args.config, run.progress);
  for (std::size_t i = 0; i < given.reasons.size(); ++i) {
    if (!given.reasons[i].empty()) report.photos[i].reason = given.reasons[i];
  }
  run.lap("observe");
  Verdict verdict = turned_verdict(report, given.photos, args.config);
  const TurnedObservation observation = observation_of(report, given.photos);
  const Camera camera = observed_camera(observation.report, args.lens);
  fill_turned(report, given.photos, observation, camera, run.document);
  if (set) {
    tell_photos(*set, run.document.counts, verdict, run);
    run.add_file("pairs.csv", pairs_csv(given.photos));
  }
  tell_left_out(report, given.photos, run);
  if (has_estimate(verdict)) {
    summarize_turned(report, observation, run);
    run.add_file("camera.yaml", camera_text(camera, CameraFormat::alidade));
  }
  std::vector<double> times;
  for (const RotationRow& row : observation.log.rows) times.push_back(row.t_s);
  run.add_file("intrinsics.csv", intrinsics_csv(times, observation.report.steps));
  return run.finish(verdict);
}

}  // namespace alidade::cli
