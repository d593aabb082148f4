#include "alidade/turned/turned_fit.h"

#include <algorithm>
#include <cmath>

#include "alidade/estimation/median.h"
#include "alidade/geometry/decompositions.h"

namespace alidade {
namespace {

constexpr double first_sigma = 0.003;  // half widths: until it is estimated from the residuals
constexpr double min_sigma = 2e-5;     // about 0.01 px
constexpr double max_sigma = 0.005;    // above it: not noise, but a wrong initial guess that accepts everything
constexpr double gate_sigmas = 4.5;
constexpr double zoom_sigma = 0.3;

/// σ of a coordinate from the median of the residual norms, which is √(2 ln 2) σ.
double sigma_by_median(const TurnedFit& fit) {
  std::vector<double> norms = freed_norms(fit.bundle, fit.solution.residuals);
  std::erase_if(norms, [](double norm) { return !std::isfinite(norm); });
  if (norms.empty()) return first_sigma;
  return std::clamp(median_of(std::move(norms)) / rayleigh_median, min_sigma, max_sigma);
}

/// The same from the mean square, with residuals beyond Huber's threshold downweighted.
double sigma_by_weights(const TurnedFit& fit) {
  double sum = 0.0;
  for (const Eigen::Vector2d& residual : fit.solution.residuals) {
    const double norm = residual.norm(), k = fit.solve.huber * fit.solve.sigma_px;
    if (std::isfinite(norm)) sum += norm > k ? k * norm : norm * norm;
  }
  return std::max(std::sqrt(sum / std::max(freedom_of(fit.bundle), 1.0)), min_sigma);
}

void turn_by_tree(const std::vector<PhotoLink>& links, const PhotoTree& tree, const FocalStart& start, bool frees_zoom,
                  TurnedBundle& bundle) {
  const std::size_t count = tree.photos.size();
  bundle.cam_from_world.assign(count, Eigen::Matrix3d::Identity());
  bundle.log_zoom.assign(count, 0.0);
  for (std::size_t k = 1; k < count; ++k) {
    const auto at = static_cast<std::size_t>(tree.link_of[k]);
    const PhotoLink& link = links[at];
    const bool is_b = link.photo_b == tree.photos[k];
    const int from_photo = is_b ? link.photo_a : link.photo_b;
    const auto from = static_cast<std::size_t>(std::ranges::find(tree.photos, from_photo) - tree.photos.begin());
    const Eigen::Matrix3d turn = is_b ? start.b_from_a[at] : Eigen::Matrix3d(start.b_from_a[at].transpose());
    bundle.cam_from_world[k] = turn * bundle.cam_from_world[from];
    if (!frees_zoom) continue;
    const double zoom = std::log(std::clamp(zoom_of(link, start.focal, start.aspect), 0.1, 10.0));
    bundle.log_zoom[k] = bundle.log_zoom[from] + (is_b ? zoom : -zoom);
  }
}

std::vector<int> places_of(const MatchedPhotos& photos, const PhotoTree& tree) {
  std::vector<int> place(photos.names.size(), -1);
  for (std::size_t k = 0; k < tree.photos.size(); ++k)
    place[static_cast<std::size_t>(tree.photos[k])] = static_cast<int>(k);
  return place;
}

}  // namespace

double freedom_of(const TurnedBundle& bundle) {
  return 2.0 * static_cast<double>(bundle.observations.size()) - 2.0 * static_cast<double>(bundle.rays.size()) -
         3.0 * static_cast<double>(bundle.cam_from_world.size() - 1) - 3.0;
}

TurnedPrior prior_about(double focal, const MatchedPhotos& photos, const TurnedConfig& config) {
  constexpr double exact = 1e-7, unknown_focal = 5.0, free_centre = 0.5, free_aspect = 0.5;
  constexpr double ordinary_centre = 0.03, ordinary_aspect = 1e-3;  // half widths; relative
  constexpr double corner_k1 = 0.08, corner_k2 = 0.04, corner_k3 = 0.02, corner_k4 = 0.01, ordinary_p = 1e-3;
  TurnedPrior prior;
  const double fx = focal / (0.5 * (1.0 + config.aspect)), fy = config.aspect * fx;
  prior.mean.head<2>() << fx, fy;
  if (config.start) {
    const PhotoScale scale(photos);
    const Eigen::Vector4d& k = *config.start;
    prior.mean.segment<2>(2) = scale.normalised(k.tail<2>());
  }
  const double tall = static_cast<double>(photos.height_px) / photos.width_px;
  const double corner = 1.0 / (fx * fx) + tall * tall / (fy * fy);  // r² at the corner of the image
  const double aspect = focal * (config.square_pixels ? exact : config.ordinary_aspect ? ordinary_aspect : free_aspect);
  const double centre = config.fixed_centre ? exact : config.ordinary_centre ? ordinary_centre : free_centre;
  const auto information = [](double sigma) { return 1.0 / (sigma * sigma); };
  TurnedInformation& Q = prior.information;
  const Eigen::Vector2d off(std::sqrt(config.aspect), -1.0 / std::sqrt(config.aspect));  // perpendicular to that aspect
  Q.topLeftCorner<2, 2>() = information(aspect) * off * off.transpose();
  Q.topLeftCorner<2, 2>().array() += 0.25 * information(unknown_focal * focal);  // prior of (fx + fy) / 2
  Q(2, 2) = Q(3, 3) = information(centre);
  Q(4, 4) = information(config.lens_terms > 0 ? corner_k1 / corner : exact);
  Q(5, 5) = information(config.lens_terms > 1 ? corner_k2 / (corner * corner) : exact);
  Q(6, 6) = Q(7, 7) = information(config.decentred ? ordinary_p : exact);
  Q(8, 8) = information(config.lens_terms > 2 ? corner_k3 / (corner * corner * corner) : exact);
  Q(9, 9) = information(config.lens_terms > 3 ? corner_k4 / std::pow(corner, 4) : exact);
  return prior;
}

namespace {

/// The rounds of fit_turned().
class Rounds {
 public:
  Rounds(const MatchedPhotos& photos, const TurnedConfig& config, bool frees_zoom, const Progress& progress,
         TurnedFit& fit)
      : photos_(photos),
        config_(config),
        frees_zoom_(frees_zoom),
        progress_(progress),
        given_(config.sigma_px / PhotoScale(photos).half_width_px),
        fit_(fit) {}

  void solve(bool is_last) {
    fit_.solve.max_iterations = is_last ? 60 : 15;
    fit_.solve.min_gain = is_last ? 1e-9 : 1e-4;
    fit_.solution = solve_turned(fit_.bundle, fit_.prior, fit_.solve, progress_);
  }

  void prepare(double focal) {
    fit_.prior = prior_about(focal, photos_, config_);
    if (frees_zoom_) fit_.prior.zoom_information = 1.0 / (zoom_sigma * zoom_sigma);
  }

  /// Adjusts all matches that the camera explains so far, then removes outliers. False: too few are left.
  bool again(const std::vector<int>& place, double gate) {
    const double given = std::max(sigma_by_median(fit_), given_);
    prepare(0.5 * (fit_.bundle.camera[0] + fit_.bundle.camera[1]));
    // the transfer of a match contains the noise of both ends
    const auto matches = explained_matches(photos_, fit_.bundle, place, gate * std::sqrt(2.0) * given);
    fit_.num_kept = set_tracks(photos_, matches, place, fit_.bundle);
    fit_.solve.sigma_px = given;
    constexpr int max_times = 3;
    for (int i = 0; i < max_times; ++i) {
      if (freedom_of(fit_.bundle) < 1.0) return false;
      solve(false);
      const double limit = gate * std::max(sigma_by_median(fit_), given_);
      if (leave_out(fit_.solution.residuals, limit, fit_.bundle) == 0) return true;
    }
    if (freedom_of(fit_.bundle) < 1.0) return false;
    solve(false);
    return true;
  }

  void settle() {
    for (int i = 0; i < 2; ++i) {
      fit_.solve.sigma_px = given_ > 0.0 ? given_ : sigma_by_weights(fit_);
      solve(true);
    }
  }

 private:
  const MatchedPhotos& photos_;
  const TurnedConfig& config_;
  bool frees_zoom_;
  const Progress& progress_;
  double given_;
  TurnedFit& fit_;
};

}  // namespace

TurnedFit fit_turned(const MatchedPhotos& photos, const std::vector<PhotoLink>& links, const PhotoTree& tree,
                     const FocalStart& start, const TurnedConfig& config, bool frees_zoom, const Progress& progress) {
  TurnedFit fit;
  Rounds rounds(photos, config, frees_zoom, progress, fit);
  rounds.prepare(0.5 * (1.0 + start.aspect) * start.focal);
  fit.bundle.camera = fit.prior.mean;
  turn_by_tree(links, tree, start, frees_zoom, fit.bundle);
  const std::vector<int> place = places_of(photos, tree);
  fit.solve.sigma_px = first_sigma;
  fit.num_kept = set_tracks(photos, agreeing_matches(links), place, fit.bundle);
  rounds.solve(false);
  for (const double gate : {2.0 * gate_sigmas, gate_sigmas, gate_sigmas}) {
    if (!rounds.again(place, gate)) return fit;
  }
  rounds.settle();
  return fit;
}

std::vector<TurnedFit> fits_from(const std::vector<FocalStart>& starts, const MatchedPhotos& photos,
                                 const std::vector<PhotoLink>& links, const PhotoTree& tree, const TurnedConfig& config,
                                 const Progress& progress) {
  std::vector<TurnedFit> fits;
  constexpr double far_worse = 4.0;
  for (const FocalStart& start : starts) {
    if (start.cost > far_worse * starts.front().cost + 1.0) continue;
    TurnedFit tried = fit_turned(photos, links, tree, start, config, false, progress);
    if (std::isfinite(tried.solution.cost) && freedom_of(tried.bundle) >= 1.0) fits.push_back(std::move(tried));
  }
  return fits;
}

std::vector<TurnedFit> fits_of_ordinary(const std::vector<TurnedFit>& fits, const MatchedPhotos& photos,
                                        const std::vector<PhotoLink>& links, const PhotoTree& tree,
                                        const TurnedConfig& config, const Progress& progress) {
  constexpr double doubtful = 0.0025;  // half widths: 1.6 px of 1280, several times the noise of a point detector
  const auto explains = [](const TurnedFit& fit) { return fit.solve.sigma_px < doubtful; };
  if (std::ranges::any_of(fits, explains)) return {};
  std::vector<FocalStart> starts;
  for (const double focal : {0.9, 1.3, 1.9, 2.8})  // half widths: horizontal field of view from 96° to 39°
    starts.push_back(start_at(focal, photos, links, config.aspect));
  std::ranges::sort(starts, {}, &FocalStart::cost);
  std::vector<TurnedFit> found = fits_from(starts, photos, links, tree, config, progress);
  std::erase_if(found, [&](const TurnedFit& fit) { return !explains(fit); });
  return found;
}

std::size_t best_of(std::vector<TurnedFit>& fits) {
  std::stable_sort(fits.begin(), fits.end(),
                   [](const TurnedFit& a, const TurnedFit& b) { return a.num_kept > b.num_kept; });
  std::size_t best = 0;
  for (std::size_t i = 1; i < fits.size(); ++i) {
    const bool as_many = static_cast<double>(fits[i].num_kept) > 0.9 * static_cast<double>(fits[best].num_kept);
    if (as_many && fits[i].solve.sigma_px < 0.9 * fits[best].solve.sigma_px) best = i;
  }
  return best;
}

OtherMinimum other_minimum(const std::vector<TurnedFit>& fits, std::size_t best) {
  OtherMinimum other;
  const TurnedFit& chosen = fits[best];
  constexpr double differs = 0.03;
  for (std::size_t i = 0; i < fits.size(); ++i) {
    const double focal = fits[i].bundle.camera[0];
    if (i == best || std::abs(focal / chosen.bundle.camera[0] - 1.0) < differs) continue;
    if (static_cast<double>(fits[i].num_kept) < 0.9 * static_cast<double>(chosen.num_kept)) continue;
    const double worse = std::pow(fits[i].solve.sigma_px / chosen.solve.sigma_px, 2) - 1.0;
    const double sigmas = std::sqrt(std::max(worse, 0.0) * freedom_of(chosen.bundle));
    if (other.focal == 0.0 || sigmas <= other.sigmas) other = {focal, sigmas};
  }
  return other;
}

bool is_far_better(const TurnedFit& fit, const TurnedFit& other) {
  const double kept = static_cast<double>(fit.num_kept) / static_cast<double>(std::max<std::size_t>(other.num_kept, 1));
  const double noise = fit.solve.sigma_px / other.solve.sigma_px;
  return (kept > 0.9 && noise < 0.7) || (kept > 1.3 && noise < 1.0);
}

TurnedFit fit_again(const MatchedPhotos& photos, const PhotoTree& tree, TurnedFit fit, const TurnedConfig& config,
                    const Progress& progress) {
  Rounds rounds(photos, config, false, progress, fit);
  for (std::size_t i = 0; i < radial_places.size(); ++i) {
    if (config.lens_terms <= static_cast<int>(i)) fit.bundle.camera[radial_places[i]] = 0.0;
  }
  if (!config.decentred) fit.bundle.camera.segment<2>(decentring_place).setZero();
  rounds.prepare(0.5 * (fit.bundle.camera[0] + fit.bundle.camera[1]));
  rounds.solve(false);
  if (rounds.again(places_of(photos, tree), gate_sigmas)) rounds.settle();
  return fit;
}

ZoomTest free_zooms(TurnedFit fit, const Progress& progress) {
  fit.prior.zoom_information = 1.0 / (zoom_sigma * zoom_sigma);
  fit.solution = solve_turned(fit.bundle, fit.prior, fit.solve, progress);
  const Eigen::MatrixXd cov = inverse_symmetric(turned_normal(fit.bundle, fit.prior, fit.solve).information);
  ZoomTest test{fit.bundle.log_zoom, {}};
  for (std::size_t k = 0; k < test.log_zoom.size(); ++k) {
    const auto at = num_camera + per_photo * static_cast<Eigen::Index>(k) + 3;
    test.sigma.push_back(std::sqrt(std::max(cov(at, at), 0.0)));
  }
  // the first photo's zoom is fixed: all are stated relative to the median one
  std::vector<double> sorted = test.log_zoom;
  const double middle = median_of(std::move(sorted));
  for (double& zoom : test.log_zoom) zoom -= middle;
  return test;
}

}  // namespace alidade
