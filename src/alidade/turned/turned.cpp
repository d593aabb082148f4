#include "alidade/turned/turned.h"

#include <algorithm>
#include <cmath>

#include "alidade/geometry/decompositions.h"
#include "alidade/geometry/degree.h"
#include "alidade/turned/parallax.h"
#include "alidade/turned/photo_scatter.h"
#include "alidade/turned/turned_fit.h"

namespace alidade {
namespace {

constexpr std::size_t min_photos = 3;
constexpr double ordinary_parallax = 0.003;  // 5 mm of lever at 1.7 m, 5 cm at 17 m
constexpr double zoom_is_other = 0.02;       // a photo's focal length differs by so much: not the camera of the others

double angle_of(const Eigen::Matrix3d& R) { return std::acos(std::clamp(0.5 * (R.trace() - 1.0), -1.0, 1.0)); }

class TurnedRun {
 public:
  TurnedRun(const MatchedPhotos& photos, const TurnedConfig& config, const Progress& progress)
      : photos_(photos), config_(config), free_(config), progress_(progress), scale_(photos) {
    free_.ordinary_aspect |= config.square_pixels;
    free_.ordinary_centre |= config.fixed_centre;
    free_.square_pixels = free_.fixed_centre = false;
    report_.photos.resize(photos.names.size());
    report_.camera.setZero();
    report_.cov.setZero();
    report_.cov_model.setZero();
  }

  TurnedReport run() {
    links_ = find_links(photos_, progress_);
    leave_out_same_images();
    tree_ = largest_tree(photos_.names.size(), links_);
    name_unconnected();
    if (tree_.photos.size() < min_photos) return std::move(report_);
    fit();
    if (report_.status == TurnedReport::Status::too_few_photos) judge();
    return std::move(report_);
  }

 private:
  /// An image that is there twice says nothing the second time, and says it without noise.
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
    const std::vector<FocalStart> starts = focal_starts(photos_, links_);
    std::vector<TurnedFit> fits;
    constexpr double far_worse = 4.0;
    for (const FocalStart& start : starts) {
      if (start.cost > far_worse * starts.front().cost + 1.0) continue;
      TurnedFit tried = fit_turned(photos_, links_, tree_, start, free_, false, progress_);
      if (std::isfinite(tried.solution.cost) && freedom_of(tried.bundle) >= 1.0) fits.push_back(std::move(tried));
    }
    num_agreeing_ = agreeing_matches(links_).size();
    if (zooms_differ(starts)) return;
    if (fits.empty()) {
      report_.status = TurnedReport::Status::no_convergence;
      return;
    }
    std::stable_sort(fits.begin(), fits.end(),
                     [](const TurnedFit& a, const TurnedFit& b) { return a.num_kept > b.num_kept; });
    std::size_t best = 0;
    for (std::size_t i = 1; i < fits.size(); ++i) {
      const bool as_many = static_cast<double>(fits[i].num_kept) > 0.9 * static_cast<double>(fits[best].num_kept);
      if (as_many && fits[i].solve.sigma_px < 0.9 * fits[best].solve.sigma_px) best = i;
    }
    name_other_minimum(fits, best);
    fit_ = std::move(fits[best]);
  }

  /// Another focal length that explains nearly as much nearly as well.
  void name_other_minimum(const std::vector<TurnedFit>& fits, std::size_t best) {
    const TurnedFit& chosen = fits[best];
    constexpr double differs = 0.03;
    for (std::size_t i = 0; i < fits.size(); ++i) {
      const double ratio = fits[i].bundle.camera[0] / chosen.bundle.camera[0];
      if (i == best || std::abs(ratio - 1.0) < differs) continue;
      if (static_cast<double>(fits[i].num_kept) < 0.9 * static_cast<double>(chosen.num_kept)) continue;
      const double worse = std::pow(fits[i].solve.sigma_px / chosen.solve.sigma_px, 2) - 1.0;
      const double sigmas = std::sqrt(std::max(worse, 0.0) * freedom_of(chosen.bundle));
      if (report_.other_focal_px > 0.0 && sigmas > report_.other_sigmas) continue;
      report_.other_focal_px = fits[i].bundle.camera[0] * scale_.half_width_px;
      report_.other_sigmas = sigmas;
    }
  }

  /// Were some photos zoomed? From the homographies alone, which hold for a camera that zooms as well.
  bool zooms_differ(const std::vector<FocalStart>& starts) {
    if (starts.empty()) return false;
    TurnedConfig config = free_;
    config.ordinary_aspect = config.ordinary_centre = true;  // what is free would be hidden in a zoom
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

  /// With fewer terms of the lens, where no free one differs significantly from zero; their uncertainty is still
  /// included.
  void state_covariance() {
    ScatterCovariance scatter = scatter_covariance(fit_, progress_);
    report_.lens_terms = free_.lens_terms;
    while (report_.lens_terms > 0 && !config_.keeps_terms) {
      constexpr double given_beyond = 3.0;  // σ
      const int last = num_camera - 3 + report_.lens_terms;
      if (std::abs(fit_.bundle.camera[last]) > given_beyond * std::sqrt(scatter.cov(last, last))) break;
      const Eigen::Vector4d before = fit_.bundle.camera.head<4>();
      free_.lens_terms = --report_.lens_terms;
      fit_ = fit_again(photos_, tree_, std::move(fit_), free_, progress_);
      ScatterCovariance less = scatter_covariance(fit_, progress_);
      // σ includes that of the fixed terms, and the change of the answer when they are estimated: either may be the
      // right lens
      const Eigen::Vector4d moved = fit_.bundle.camera.head<4>() - before;
      const Eigen::Vector4d more = (scatter.cov - less.cov).diagonal().head<4>().cwiseMax(0.0) + moved.cwiseAbs2();
      less.cov.diagonal().head<4>() += more;
      if (report_.lens_terms > 0) less.cov(4, 4) = std::max(less.cov(4, 4), scatter.cov(4, 4));
      less.cov(0, 1) += std::sqrt(more[0] * more[1]);  // a lens' terms move both alike
      less.cov(1, 0) = less.cov(0, 1);
      scatter = less;
    }
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
    const Eigen::Matrix<double, 6, 1> unit = note_camera();
    report_.cov_model = unit.asDiagonal() * scatter.cov_model * unit.asDiagonal();
    report_.cov = unit.asDiagonal() * scatter.cov * unit.asDiagonal();
    add_given();
  }

  /// The camera in pixels; what a normalised unit of each parameter is.
  Eigen::Matrix<double, 6, 1> note_camera() {
    Eigen::Matrix<double, 6, 1> unit = Eigen::Matrix<double, 6, 1>::Ones();
    unit.head<4>().setConstant(scale_.half_width_px);
    report_.camera = unit.cwiseProduct(fit_.bundle.camera);
    report_.camera.segment<2>(2) += scale_.centre_px;
    return unit;
  }

  /// Assumptions that may change the answer: the centre's translations as the camera rotated. A centre that is
  /// ρ of the points' distance before the axes sees tan θ (1 + ρ / cos θ) for tan θ: f grows by ρ f, k1 by ρ/2, k2 by
  /// −ρ/8; one beside them shifts cx, cy by ρ f.
  void add_given() {
    const Eigen::Vector2d f = report_.camera.head<2>();
    const double estimated = std::max(report_.parallax.relative, ordinary_parallax);
    const double parallax = config_.sigma_parallax ? *config_.sigma_parallax : estimated;
    Eigen::Matrix<double, 6, 1> moves = Eigen::Matrix<double, 6, 1>::Zero();
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

  /// The answer with the user's fixed values; their effect on it is included.
  void hold() {
    const Eigen::Matrix<double, 6, 1> free = report_.camera;
    report_.free_centre_px = free.segment<2>(2);
    report_.sigma_free_centre_px = report_.cov.diagonal().segment<2>(2).cwiseSqrt();
    if (!config_.square_pixels && !config_.fixed_centre) return;
    TurnedConfig held = config_;
    held.ordinary_aspect = free_.ordinary_aspect;
    held.ordinary_centre = free_.ordinary_centre;
    held.lens_terms = report_.lens_terms;
    fit_ = fit_again(photos_, tree_, std::move(fit_), held, progress_);
    note_fit();
    note_camera();
    const Eigen::Vector2d moved = report_.camera.head<2>() - free.head<2>();
    report_.cov.topLeftCorner<2, 2>() += moved * moved.transpose();
    if (config_.square_pixels) {
      const double variance = report_.cov.topLeftCorner<2, 2>().mean();
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

  /// Again with what one camera explains: focus that walks, a step forward.
  void test_photos_zooms() {
    const ZoomTest test = free_zooms(fit_, progress_);
    const double raise = std::sqrt(std::max(report_.design_effect, 1.0));
    for (std::size_t k = 0; k < test.log_zoom.size(); ++k) {
      photo_at(k).zoom = std::exp(test.log_zoom[k]);
      photo_at(k).sigma_zoom = raise * photo_at(k).zoom * test.sigma[k];
    }
  }

  const MatchedPhotos& photos_;
  const TurnedConfig& config_;
  TurnedConfig free_;  ///< With fixed values free within typical priors: a fixed value may be wrong.
  const Progress& progress_;
  PhotoScale scale_;
  TurnedReport report_;
  std::vector<PhotoLink> links_;
  PhotoTree tree_;
  TurnedFit fit_;
  std::size_t num_same_ = 0, num_agreeing_ = 0;
};

}  // namespace

TurnedReport observe_turned(const MatchedPhotos& photos, const TurnedConfig& config, const Progress& progress) {
  return TurnedRun(photos, config, progress).run();
}

}  // namespace alidade
