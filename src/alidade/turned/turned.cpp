#include "alidade/turned/turned.h"

#include <algorithm>
#include <cmath>

#include "alidade/geometry/decompositions.h"
#include "alidade/geometry/degree.h"
#include "alidade/turned/burned_in.h"
#include "alidade/turned/parallax.h"
#include "alidade/turned/photo_scatter.h"
#include "alidade/turned/turned_fit.h"

namespace alidade {
namespace {

constexpr std::size_t min_photos = 3;
constexpr double ordinary_parallax = 0.003;  // 5 mm of lever at 1.7 m, 5 cm at 17 m
constexpr double zoom_is_other = 0.02;       // relative difference of a photo's focal length: zoomed if above

double angle_of(const Eigen::Matrix3d& R) { return std::acos(std::clamp(0.5 * (R.trace() - 1.0), -1.0, 1.0)); }

class TurnedRun {
 public:
  TurnedRun(MatchedPhotos photos, const TurnedConfig& config, const Progress& progress)
      : photos_(std::move(photos)), config_(config), free_(config), progress_(progress), scale_(photos_) {
    free_.ordinary_aspect |= config.square_pixels;
    free_.ordinary_centre |= config.fixed_centre;
    free_.square_pixels = free_.fixed_centre = false;
    report_.photos.resize(photos_.names.size());
    report_.camera.setZero();
    report_.cov.setZero();
    report_.cov_model.setZero();
  }

  TurnedReport run() {
    links_ = find_links(photos_, progress_);
    report_.matches.burned_in = remove_burned_in(links_, photos_);
    if (report_.matches.burned_in > 0) links_ = find_links(photos_, progress_);
    leave_out_same_images();
    tree_ = largest_tree(photos_.names.size(), links_);
    name_unconnected();
    if (tree_.photos.size() < min_photos) return std::move(report_);
    fit();
    if (report_.status == TurnedReport::Status::too_few_photos) judge();
    return std::move(report_);
  }

 private:
  /// Removes repeated images: the copy adds no information, and its matches have no noise.
  void leave_out_same_images() {
    std::vector<bool> is_same(photos_.names.size(), false);
    for (const PhotoLink& link : links_) {
      const auto a = static_cast<std::size_t>(link.photo_a), b = static_cast<std::size_t>(link.photo_b);
      if (!link.is_same_image || is_same[a]) continue;
      is_same[b] = true;
      report_.photos[b].reason = "is the same image as " + photos_.names[a];
      ++num_same_;
    }
    std::erase_if(links_, [&](const PhotoLink& link) {
      return is_same[static_cast<std::size_t>(link.photo_a)] || is_same[static_cast<std::size_t>(link.photo_b)];
    });
  }

  void name_unconnected() {
    for (std::size_t i = 0; i < report_.photos.size(); ++i) {
      RotatedPhoto& photo = report_.photos[i];
      const bool is_in =
          tree_.photos.size() > 1 && std::ranges::find(tree_.photos, static_cast<int>(i)) != tree_.photos.end();
      if (is_in || !photo.reason.empty()) continue;
      const bool has_link = std::ranges::any_of(links_, [&](const PhotoLink& link) {
        return link.photo_a == static_cast<int>(i) || link.photo_b == static_cast<int>(i);
      });
      photo.reason = has_link ? "overlaps others, but not those that most belong to" : "overlaps no other photo";
    }
  }

  void fit() {
    std::vector<FocalStart> starts = focal_starts(photos_, links_);
    std::vector<TurnedFit> fits = fits_from(starts, photos_, links_, tree_, free_, progress_);
    std::vector<TurnedFit> more = fits_of_ordinary(fits, photos_, links_, tree_, free_, progress_);
    if (!more.empty()) {
      fits = std::move(more);
      starts.assign(1, start_at(fits[best_of(fits)].bundle.camera[0], photos_, links_, free_.aspect));
    }
    num_agreeing_ = agreeing_matches(links_).size();
    std::size_t best = best_of(fits);
    if (try_other_aspect(fits, best)) starts = focal_starts(photos_, links_, free_.aspect);
    if (zooms_differ(starts)) return;
    if (fits.empty()) {
      report_.status = TurnedReport::Status::no_convergence;
      return;
    }
    const OtherMinimum other = other_minimum(fits, best);
    report_.other_focal_px = other.focal * scale_.half_width_px;
    report_.other_sigmas = other.sigmas;
    fit_ = std::move(fits[best]);
  }

  /// For squeezed images, for which a prior on square pixels is wrong: true if fits with another aspect are far better.
  bool try_other_aspect(std::vector<TurnedFit>& fits, std::size_t& best) {
    TurnedConfig config = free_;
    config.aspect = likely_aspect(photos_, links_);
    config.ordinary_aspect = false;
    if (config.aspect == 1.0) return false;
    const std::vector<FocalStart> starts = focal_starts(photos_, links_, config.aspect, 1);
    std::vector<TurnedFit> others = fits_from(starts, photos_, links_, tree_, config, progress_);
    TurnedConfig square = free_;
    square.ordinary_aspect = true;
    std::vector<TurnedFit> squares = fits;
    if (!free_.ordinary_aspect)
      squares = fits_from(focal_starts(photos_, links_, 1.0, 1), photos_, links_, tree_, square, progress_);
    if (others.empty() || (!squares.empty() && !is_far_better(others.front(), squares[best_of(squares)]))) return false;
    free_ = config;
    free_.aspect = others.front().bundle.camera[1] / others.front().bundle.camera[0];
    fits = std::move(others);
    best = 0;
    return true;
  }

  /// Tests whether some photos were zoomed, from the homographies alone, which also hold for a zooming camera.
  bool zooms_differ(const std::vector<FocalStart>& starts) {
    if (starts.empty()) return false;
    TurnedConfig config = free_;
    config.ordinary_aspect = config.ordinary_centre = true;  // otherwise, free parameters would be confused with zoom
    TurnedFit zoomed = fit_turned(photos_, links_, tree_, starts.front(), config, true, progress_);
    if (!std::isfinite(zoomed.solution.cost) || freedom_of(zoomed.bundle) < 1.0) return false;
    const ZoomTest test = free_zooms(zoomed, progress_);
    bool differs = false;
    for (std::size_t k = 0; k < test.log_zoom.size(); ++k) {
      RotatedPhoto& photo = photo_at(k);
      photo.zoom = std::exp(test.log_zoom[k]);
      photo.sigma_zoom = photo.zoom * test.sigma[k];
      differs |= std::abs(test.log_zoom[k]) > std::max(zoom_is_other, 6.0 * test.sigma[k]);
    }
    if (!differs) return false;
    report_.status = TurnedReport::Status::zoomed;
    for (std::size_t k = 0; k < test.log_zoom.size(); ++k) {
      if (std::abs(test.log_zoom[k]) <= std::max(zoom_is_other, 6.0 * test.sigma[k])) continue;
      photo_at(k).reason = "its focal length is " + text_of(photo_at(k).zoom, 3) + " times that of most";
    }
    return true;
  }

  RotatedPhoto& photo_at(std::size_t bundle_photo) {
    return report_.photos[static_cast<std::size_t>(tree_.photos[bundle_photo])];
  }

  void judge() {
    note_fit();
    count_matches();
    if (report_.status == TurnedReport::Status::no_convergence) return;
    constexpr double min_turn = 0.5 * degree, min_kept = 0.5;
    if (report_.largest_turn_rad < min_turn) {
      report_.status = TurnedReport::Status::no_turn;
      return;
    }
    if (static_cast<double>(report_.matches.kept) < min_kept * static_cast<double>(num_agreeing_)) {
      report_.status = TurnedReport::Status::moved;
      return;
    }
    state_covariance();
    test_photos_zooms();
    hold();
    const double f = report_.camera[0];
    constexpr double max_focal = 0.05, max_centre = 0.05;
    const Eigen::VectorXd sigma = report_.cov.diagonal().cwiseSqrt();
    const bool is_given = sigma.allFinite() && sigma.head<2>().maxCoeff() < max_focal * f &&
                          sigma.segment<2>(2).maxCoeff() < max_centre * photos_.width_px;
    report_.status = is_given ? TurnedReport::Status::ok : TurnedReport::Status::weak;
  }

  void note_fit() {
    report_.bundle = fit_.bundle;
    report_.bundle_photo = tree_.photos;
    report_.residuals = fit_.solution.residuals;
    report_.sigma_px = fit_.solve.sigma_px * scale_.half_width_px;
    report_.matches.agreeing = num_agreeing_;
    report_.matches.kept = fit_.num_kept;
    count_photos();
  }

  void count_photos() {
    const std::size_t count = tree_.photos.size();
    for (RotatedPhoto& photo : report_.photos) photo.num_points = 0;
    report_.largest_turn_rad = 0.0;
    std::vector<double> squares(count, 0.0);
    for (std::size_t i = 0; i < fit_.bundle.observations.size(); ++i) {
      const auto k = static_cast<std::size_t>(fit_.bundle.observations[i].photo);
      ++photo_at(k).num_points;
      squares[k] += fit_.solution.residuals[i].squaredNorm();
    }
    for (std::size_t k = 0; k < count; ++k) {
      RotatedPhoto& photo = photo_at(k);
      constexpr int min_points = 6;
      photo.is_used = photo.num_points >= min_points;
      if (photo.is_used) photo.reason.clear();
      if (!photo.is_used) photo.reason = "agrees with others, but not with one camera that rotated";
      photo.rms_px = scale_.half_width_px * std::sqrt(squares[k] / std::max(photo.num_points, 1));
      photo.cam_from_world = fit_.bundle.cam_from_world[k];
      photo.turn_rad = angle_of(photo.cam_from_world);
      for (std::size_t j = 0; j < k; ++j) {
        const double between = angle_of(turn_between(fit_.bundle, j, k));
        report_.largest_turn_rad = std::max(report_.largest_turn_rad, between);
      }
    }
  }

  void count_matches() {
    for (const PhotoLink& link : links_) report_.matches.given += photos_.pairs[link.pair].matches.size();
  }

  /// Covariance with the lens terms that differ significantly from zero; the uncertainty of the others is included.
  void state_covariance() {
    if (!config_.keeps_terms) {
      free_.lens_terms = num_radial;
      free_.decentred = true;
      fit_ = fit_again(photos_, tree_, std::move(fit_), free_, progress_);
    }
    ScatterCovariance scatter = scatter_covariance(fit_, progress_);
    if (!config_.keeps_terms) {
      const bool drops_k3 = is_nearly_zero(radial_places[2], fit_, scatter), drops_p = !is_decentred(scatter);
      if (drops_k3 || drops_p) drop(drops_k3 ? 2 : 3, !drops_p, scatter);
      while (free_.lens_terms > 0 &&
             is_nearly_zero(radial_places[static_cast<std::size_t>(free_.lens_terms - 1)], fit_, scatter))
        drop(free_.lens_terms - 1, free_.decentred, scatter);
    }
    if (!config_.keeps_terms && free_.lens_terms == num_radial) test_further_term();
    scatter.cov += by_lens_;
    report_.lens_terms = free_.lens_terms;
    report_.decentred = free_.decentred;
    note_fit();
    for (std::size_t k = 0; k < scatter.z2.size(); ++k) photo_at(k).z2 = scatter.z2[k];
    report_.parallax = parallax_of(fit_);
    if (report_.parallax.photo_a >= 0) {
      report_.parallax.photo_a = tree_.photos[static_cast<std::size_t>(report_.parallax.photo_a)];
      report_.parallax.photo_b = tree_.photos[static_cast<std::size_t>(report_.parallax.photo_b)];
    }
    report_.parallax.rms_px *= scale_.half_width_px;
    report_.design_effect = scatter.design_effect;
    report_.degrees_of_freedom = scatter.degrees_of_freedom;
    const TurnedCamera unit = note_camera();
    report_.cov_model = unit.asDiagonal() * scatter.cov_model * unit.asDiagonal();
    report_.cov = unit.asDiagonal() * scatter.cov * unit.asDiagonal();
    add_given();
  }

  /// Whether p1, p2 are significant and plausible for a lens: motion or zoom may imitate a lens that does not exist.
  [[nodiscard]] bool is_decentred(const ScatterCovariance& scatter) const {
    const Eigen::Matrix2d cov = scatter.cov.block<2, 2>(decentring_place, decentring_place);
    const Eigen::Vector2d p = fit_.bundle.camera.segment<2>(decentring_place);
    constexpr double most = 5e-3, both = 1.31;  // five σ of typical lenses; χ² of two as improbable as 3² of one
    const double as_likely =
        std::max(three_sigma_of(decentring_place, scatter), three_sigma_of(decentring_place + 1, scatter));
    return p.dot(cov.inverse() * p) > both * as_likely * as_likely && p.norm() < most;
  }

  /// Refits with fewer lens terms. σ includes the uncertainty of the dropped ones and the change of the answer: either
  /// lens may be correct.
  void drop(int lens_terms, bool decentred, ScatterCovariance& scatter) {
    std::vector<int> dropped(radial_places.begin() + lens_terms, radial_places.begin() + free_.lens_terms);
    if (free_.decentred && !decentred) dropped.insert(dropped.end(), {decentring_place, decentring_place + 1});
    const Eigen::MatrixXd with_dropped = scatter.cov(Eigen::all, dropped);
    by_lens_ += with_dropped * inverse_symmetric(scatter.cov(dropped, dropped)) * with_dropped.transpose();
    TurnedCamera moved = -fit_.bundle.camera;
    free_.lens_terms = lens_terms;
    free_.decentred = decentred;
    fit_ = fit_again(photos_, tree_, std::move(fit_), free_, progress_);
    moved += fit_.bundle.camera;
    by_lens_ += moved * moved.transpose();
    scatter = scatter_covariance(fit_, progress_);
  }

  /// Tests whether k4 is significant as well: then k1 to k3 do not describe the lens, and its effect is included in σ.
  void test_further_term() {
    TurnedConfig further = free_;
    ++further.lens_terms;
    const TurnedFit bent = fit_again(photos_, tree_, fit_, further, progress_);
    if (is_nearly_zero(radial_places[num_radial], bent, scatter_covariance(bent, progress_))) return;
    TurnedCamera moved = bent.bundle.camera - fit_.bundle.camera;
    moved[radial_places[num_radial]] = 0.0;
    by_lens_ += moved * moved.transpose();
    report_.lens_departs = moved[0] / fit_.bundle.camera[0];
  }

  /// Sets the camera in pixels; returns the size of the normalised unit of each parameter.
  TurnedCamera note_camera() {
    TurnedCamera unit = TurnedCamera::Ones();
    unit.head<4>().setConstant(scale_.half_width_px);
    report_.camera = unit.cwiseProduct(fit_.bundle.camera);
    report_.camera.segment<2>(2) += scale_.centre_px;
    return unit;
  }

  /// Assumptions that may change the answer: translation of the camera centre with rotation. A centre at ρ times the
  /// points' distance in front of the axes sees tan θ (1 + ρ / cos θ) for tan θ: f grows by ρ f, k1 by ρ/2, k2 by
  /// −ρ/8; one to the side of them shifts cx, cy by ρ f.
  void add_given() {
    const Eigen::Vector2d f = report_.camera.head<2>();
    const double estimated = std::max(report_.parallax.relative, ordinary_parallax);
    const double seen = report_.parallax.z < parallax_is_seen ? 0.0 : report_.parallax.relative;
    const double parallax = config_.sigma_parallax ? std::max(*config_.sigma_parallax, seen) : estimated;
    TurnedCamera moves = TurnedCamera::Zero();
    moves.head<2>() = f;
    if (report_.lens_terms > 0) moves[4] = 0.5;
    if (report_.lens_terms > 1) moves[5] = -0.125;
    report_.cov += parallax * parallax * moves * moves.transpose();
    report_.cov.diagonal().segment<2>(2) += parallax * parallax * f.cwiseAbs2();
    Assumption steps;
    steps.name = "steps of the camera's centre over the points' distance, a radian of turn";
    if (config_.sigma_parallax) steps.sigma = parallax;
    constexpr double careless = 0.02;  // 10 cm of lever at 5 m
    steps.ordinary = careless;
    steps.moved = "fx";
    steps.moved_by = (config_.sigma_parallax ? parallax : careless) * f.x();
    steps.moves = steps.moved_by / std::sqrt(report_.cov(0, 0));
    steps.remedy = "rotate the camera about its lens, look at things far away, and say --sigma-parallax";
    report_.assumed.push_back(steps);
  }

  [[nodiscard]] double sigma_of_aspect(const TurnedCamera& camera) const {
    const Eigen::Vector2d slope(-camera[1] / (camera[0] * camera[0]), 1.0 / camera[0]);
    return std::sqrt(slope.dot(report_.cov.topLeftCorner<2, 2>() * slope));
  }

  /// Refits with the parameters that the user fixes; the effect on the answer is included in σ.
  void hold() {
    const TurnedCamera free = report_.camera;
    report_.free_centre_px = free.segment<2>(2);
    report_.sigma_free_centre_px = report_.cov.diagonal().segment<2>(2).cwiseSqrt();
    report_.free_aspect = free[1] / free[0];
    report_.sigma_free_aspect = sigma_of_aspect(free);
    if (!config_.square_pixels && !config_.fixed_centre) return;
    TurnedConfig held = config_;
    held.ordinary_aspect = free_.ordinary_aspect;
    held.ordinary_centre = free_.ordinary_centre;
    held.lens_terms = report_.lens_terms;
    held.decentred = report_.decentred;
    fit_ = fit_again(photos_, tree_, std::move(fit_), held, progress_);
    note_fit();
    note_camera();
    const Eigen::Vector2d moved = report_.camera.head<2>() - free.head<2>();
    if (!config_.square_pixels) report_.cov.topLeftCorner<2, 2>() += moved * moved.transpose();
    if (config_.square_pixels) {  // variance of (fx + fy) / 2, and of the deviation of each from it
      const double variance = report_.cov.topLeftCorner<2, 2>().mean() + 0.5 * moved.squaredNorm();
      report_.cov.topLeftCorner<2, 2>().setConstant(variance);
      report_.cov.row(1) = report_.cov.row(0);
      report_.cov.col(1) = report_.cov.col(0);
    }
    if (!config_.fixed_centre) return;
    report_.cov.middleRows<2>(2).setZero();
    report_.cov.middleCols<2>(2).setZero();
    Assumption centre;
    centre.name = "centre of the image";
    centre.sigma = report_.sigma_free_centre_px.x();
    centre.moved = "fx";
    centre.moved_by = std::abs(moved.x());
    centre.moves = centre.moved_by / std::sqrt(report_.cov(0, 0));
    report_.assumed.push_back(centre);
  }

  /// Tests the zoom of each photo again with all matches that one camera explains: focus changes, a step forward.
  void test_photos_zooms() {
    const ZoomTest test = free_zooms(fit_, progress_);
    const double raise = std::sqrt(std::max(report_.design_effect, 1.0));
    for (std::size_t k = 0; k < test.log_zoom.size(); ++k) {
      photo_at(k).zoom = std::exp(test.log_zoom[k]);
      photo_at(k).sigma_zoom = raise * photo_at(k).zoom * test.sigma[k];
    }
  }

  MatchedPhotos photos_;
  const TurnedConfig& config_;
  TurnedConfig free_;  ///< The configuration with fixed parameters free within typical priors: they may be wrong.
  const Progress& progress_;
  PhotoScale scale_;
  TurnedReport report_;
  std::vector<PhotoLink> links_;
  PhotoTree tree_;
  TurnedFit fit_;
  TurnedInformation by_lens_ = TurnedInformation::Zero();  ///< Covariance due to lens terms that are not estimated.
  std::size_t num_same_ = 0, num_agreeing_ = 0;
};

}  // namespace

TurnedReport observe_turned(const MatchedPhotos& photos, const TurnedConfig& config, const Progress& progress) {
  return TurnedRun(photos, config, progress).run();
}

}  // namespace alidade
