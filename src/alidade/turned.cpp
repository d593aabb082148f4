#include <algorithm>
#include <cmath>
#include <limits>
#include <utility>

#include "alidade/estimation/config_error.h"
#include "alidade/matching/match_photos.h"
#include "alidade/observe.h"
#include "alidade/observe/solve/solve.h"
#include "alidade/turned/turned.h"

// observe() for photos and for matches between them.

namespace alidade {
namespace {

/// Throws ConfigError if something is requested that photos do not determine.
ObserveSetup photos_setup(const ObserveConfig& config) {
  ObserveSetup setup = setup_of(config);
  if (setup.rotation == RotationKnowledge::noisy) {
    throw ConfigError("--rotation noisy: photos and pairs have no measured rotation; leave it out, or say free");
  }
  ObserveNuisances others = setup.nuisances;
  others.k1 = others.k2 = false;
  if (CommonLayout(others).size > 4 || !setup.estimate_errors.empty() || setup.lever_m) {
    throw ConfigError("of photos and pairs, --estimate is auto, none, k1 or k2, and there is no --lever");
  }
  return setup;
}

/// `is_ordinary`: aspect ratio and centre are typical. For external matches, only what is given is known of the camera.
TurnedConfig turned_config(const ObserveSetup& setup, bool is_ordinary) {
  TurnedConfig config;
  config.square_pixels = setup.square_pixels;
  config.fixed_centre = setup.fixed_centre;
  config.ordinary_aspect = config.ordinary_centre = is_ordinary;
  config.start = setup.start;
  config.sigma_px = setup.sigma_px.value_or(0.0);
  config.sigma_parallax = setup.sigma_parallax;
  if (!setup.estimate.empty() && !setup.estimate_auto) {
    config.lens_terms = setup.nuisances.k2 ? 2 : setup.nuisances.k1 ? 1 : 0;
    config.keeps_terms = true;
  }
  if (setup.lens_is_given) {
    config.lens_terms = 0;
    config.keeps_terms = true;
  }
  return config;
}

void check_matches(const MatchedPhotos& matches) {
  const std::size_t count = matches.names.size();
  if (matches.features.size() != count) throw ConfigError("the matches do not have a list of features per photo");
  for (const auto& features : matches.features) {
    if (!std::ranges::all_of(features, is_seen)) throw ConfigError("a feature is not at finite pixels");
  }
  const auto is_of = [](int index, std::size_t size) { return index >= 0 && static_cast<std::size_t>(index) < size; };
  for (const MatchedPair& pair : matches.pairs) {
    if (!is_of(pair.photo_a, count) || !is_of(pair.photo_b, count) || pair.photo_a >= pair.photo_b) {
      throw ConfigError("a pair is not of two of the photos, the earlier one first");
    }
    const auto &a = matches.features[static_cast<std::size_t>(pair.photo_a)],
               &b = matches.features[static_cast<std::size_t>(pair.photo_b)];
    for (const FeatureMatch& match : pair.matches) {
      if (!is_of(match.a, a.size()) || !is_of(match.b, b.size())) throw ConfigError("a match is of no feature");
    }
  }
}

/// Adds one row per photo: its time is its index, its attitude the one estimated from the photos.
void add_photo_rows(const TurnedReport& solved, ObserveReport& report) {
  report.log.source = RotationSource::attitude;
  report.log.num_points = solved.bundle.rays.size();
  const Eigen::Vector4d sigma = solved.cov.diagonal().head<4>().cwiseMax(0.0).cwiseSqrt();
  for (std::size_t i = 0; i < solved.photos.size(); ++i) {
    const RotatedPhoto& photo = solved.photos[i];
    RotationRow row;
    row.t_s = static_cast<double>(i);
    if (photo.is_used) row.base_from_cam = Eigen::Quaterniond(Eigen::Matrix3d(photo.cam_from_world.transpose()));
    report.log.rows.push_back(std::move(row));
    IntrinsicsEstimate step;
    step.has_value = solved.status == TurnedReport::Status::ok && photo.is_used;
    step.fx = solved.camera[0];
    step.fy = solved.camera[1];
    step.cx = solved.camera[2];
    step.cy = solved.camera[3];
    step.k1 = solved.camera[4];
    step.sigma = sigma;
    report.steps.push_back(step);
  }
}

void add_photo_quantities(const TurnedReport& solved, ObserveReport& report) {
  static const char* const names[] = {"fx", "fy", "cx", "cy", "k1", "k2", "p1", "p2", "k3"};
  std::vector<int> places{0, 1, 2, 3};
  for (std::size_t i = 0; i < 3 && static_cast<int>(i) < solved.lens_terms; ++i) places.push_back(radial_places[i]);
  if (solved.decentred) places.insert(places.end(), {decentring_place, decentring_place + 1});
  std::ranges::sort(places);
  for (const int i : places) {
    const double model = std::sqrt(solved.cov_model(i, i));
    report.quantities.push_back({names[i], solved.camera[i], std::sqrt(solved.cov(i, i)), model, model});
  }
  report.covariance = solved.cov(places, places);
}

void add_photo_residuals(const TurnedReport& solved, const MatchedPhotos& matches, ObserveReport& report) {
  const double half_width = 0.5 * matches.width_px;
  const Eigen::Vector2d centre(0.5 * (matches.width_px - 1), 0.5 * (matches.height_px - 1));
  for (std::size_t i = 0; i < solved.bundle.observations.size(); ++i) {
    const TurnedDetection& seen = solved.bundle.observations[i];
    report.residuals.push_back({solved.bundle_photo[static_cast<std::size_t>(seen.photo)], seen.track,
                                half_width * seen.px + centre, half_width * solved.residuals[i]});
  }
}

void count_rotated_photos(const std::vector<std::string>& names, ObserveReport& report) {
  report.photo_names = names;
  report.counts.given = names.size();
  for (std::size_t i = 0; i < names.size(); ++i) {
    if (report.photos[i].is_used) {
      ++report.counts.used;
    } else {
      report.counts.skipped.push_back({names[i], 0, report.photos[i].reason});
    }
  }
  report.counts.dropped = report.counts.given - report.counts.used;
}

ObserveReport::Status status_of_photos(TurnedReport::Status status) {
  using Turned = TurnedReport::Status;
  using Status = ObserveReport::Status;
  return status == Turned::ok               ? Status::ok
         : status == Turned::too_few_photos ? Status::too_few_data
         : status == Turned::no_convergence ? Status::no_convergence
                                            : Status::unobservable;
}

/// `reasons`: why photos are excluded from the start; empty, or one per photo.
ObserveReport observe_matches(MatchedPhotos matches, const std::vector<std::string>& reasons, const ObserveSetup& setup,
                              const TurnedConfig& config, const Progress& progress) {
  if (setup.lens_is_given) {
    const Eigen::Vector2d nowhere(-1e6, -1e6);  // matches nothing
    for (auto& features : matches.features) undistort(*setup.camera, nowhere, features);
  }
  TurnedReport solved = observe_turned(matches, config, progress);
  for (std::size_t i = 0; i < reasons.size(); ++i) {
    if (!reasons[i].empty()) solved.photos[i].reason = reasons[i];
  }
  ObserveReport report;
  report.status = status_of_photos(solved.status);
  report.verdict = turned_verdict(solved, matches, config);
  report.width_px = matches.width_px;
  report.height_px = matches.height_px;
  report.sigma_px = solved.sigma_px;
  report.sigma_is_estimated = !setup.sigma_px;
  report.assumed = solved.assumed;
  report.shared_errors.design_effect = solved.design_effect;
  report.sigma_angle_rad = std::numeric_limits<double>::infinity();
  report.motion.span_rad = solved.largest_turn_rad;
  report.matches = solved.matches;
  report.parallax = solved.parallax;
  add_photo_rows(solved, report);
  if (report.status == ObserveReport::Status::ok) {
    add_photo_quantities(solved, report);
    report.camera = observed_camera(report, setup.lens_is_given ? setup.camera : std::nullopt);
  }
  add_photo_residuals(solved, matches, report);
  report.photos = std::move(solved.photos);
  count_rotated_photos(matches.names, report);
  return report;
}

/// The refusal of photos whose size differs from the configured one.
ObserveReport refused_photo_size(const PhotoMatches& found, const std::pair<int, int>& given) {
  ObserveReport report;
  report.status = ObserveReport::Status::too_few_data;
  report.width_px = found.photos.width_px;
  report.height_px = found.photos.height_px;
  report.photos.resize(found.photos.names.size());
  for (std::size_t i = 0; i < report.photos.size(); ++i) report.photos[i].reason = found.reasons[i];
  count_rotated_photos(found.photos.names, report);
  const auto text = [](int width, int height) { return std::to_string(width) + "x" + std::to_string(height); };
  report.verdict.state = State::refused;
  report.verdict.exit_code = ExitCode::undetermined;
  report.verdict.sentence = "the photos are " + text(report.width_px, report.height_px) +
                            ", but the camera or --size says " + text(given.first, given.second);
  report.verdict.to_add = "give the camera, and the size, of these photos";
  return report;
}

}  // namespace

ObserveReport observe(const Photos& photos, const ObserveConfig& config, const Progress& progress) {
  const ObserveSetup setup = photos_setup(config);
  if (!photos.load && !photos.names.empty()) throw ConfigError("photos have names, but nothing that loads them");
  PhotoMatches found = match_photos(photos.names, photos.load, {}, progress);
  const std::pair size(setup.width_px, setup.height_px);
  const bool is_other = setup.width_px > 0 && size != std::pair(found.photos.width_px, found.photos.height_px);
  const bool has_size = found.photos.width_px > 0;
  ObserveReport report =
      is_other && has_size ? refused_photo_size(found, size)
                           : observe_matches(found.photos, found.reasons, setup, turned_config(setup, true), progress);
  report.num_unreadable = found.num_unreadable;
  report.found_matches = std::move(found.photos);
  return report;
}

ObserveReport observe_matched(MatchedPhotos photos, const ObserveConfig& config, const Progress& progress) {
  const ObserveSetup setup = photos_setup(config);
  check_matches(photos);
  return observe_matches(std::move(photos), {}, setup, turned_config(setup, true), progress);
}

ObserveReport observe(MatchedPhotos matches, const ObserveConfig& config, const Progress& progress) {
  const ObserveSetup setup = photos_setup(config);
  check_matches(matches);
  if (setup.width_px > 0) std::tie(matches.width_px, matches.height_px) = std::pair(setup.width_px, setup.height_px);
  const bool is_guessed = matches.width_px <= 0 || matches.height_px <= 0;
  if (is_guessed) {
    RotationLog all;  // only a container of the features
    for (const auto& features : matches.features) all.rows.push_back({.px = features});
    matches.width_px = matches.height_px = 0;
    (void)pixel_scale(all, matches.width_px, matches.height_px);
  }
  ObserveReport report = observe_matches(std::move(matches), {}, setup, turned_config(setup, false), progress);
  report.size_is_guessed = is_guessed;
  return report;
}

}  // namespace alidade
