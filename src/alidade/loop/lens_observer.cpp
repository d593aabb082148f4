#include "alidade/loop/lens_observer.h"

#include <cmath>

#include "alidade/observe/filters/hybrid.h"

namespace alidade {
namespace {

/// σ of intrinsics where the camera file states none: that of a typical calibration.
constexpr double ordinary_focal_share = 0.003, ordinary_centre_px = 2.0;

IntrinsicsSample believed_at_first(const Camera& camera) {
  IntrinsicsSample now = own_lens(camera);
  if (!(now.sigma.head<2>().minCoeff() > 0.0)) now.sigma.head<2>() = ordinary_focal_share * now.k.head<2>();
  if (!(now.sigma.tail<2>().minCoeff() > 0.0)) now.sigma.tail<2>().setConstant(ordinary_centre_px);
  return now;
}

HybridConfig observer_config(const RigHead& head, std::size_t num_points, const IntrinsicsSample& first) {
  HybridConfig config;
  config.num_points = num_points;
  config.scale.scale = 0.5 * head.camera.width_px;
  config.scale.centre = {0.5 * (head.camera.width_px - 1), 0.5 * (head.camera.height_px - 1)};
  config.start.k = config.scale.normalised_intrinsics(first.k);
  config.start_is_given = true;
  config.fine_enough = 2.0 * ordinary_focal_share;  // a calibrated lens may zoom as soon as there is an estimate
  CommonPrior prior(config.start);
  prior.sigma_k = first.sigma / config.scale.scale;
  prior.is_given_k = {true, true, true, true};
  config.prior = prior;
  return config;
}

/// Spread of the angles that a camera was rotated to, so far. [rad²]
class TurnSpread {
 public:
  void add(const Eigen::Vector2d& pan_tilt_rad) {
    ++num_;
    const Eigen::Vector2d before = pan_tilt_rad - mean_rad_;
    mean_rad_ += before / num_;
    sum2_ += before.cwiseProduct(pan_tilt_rad - mean_rad_);
  }
  /// Readings with errors of this σ do so to the focal lengths (fx by pan, fy by tilt), as a share: all points of a
  /// image share the error, so that no number of points helps.
  [[nodiscard]] Eigen::Vector2d variance_of_share(double sigma_rad) const {
    return sigma_rad * sigma_rad * sum2_.cwiseMax(1e-12).cwiseInverse();
  }

 private:
  double num_ = 0.0;
  Eigen::Vector2d mean_rad_ = Eigen::Vector2d::Zero(), sum2_ = Eigen::Vector2d::Zero();
};

}  // namespace

struct LensObserver::State {
  RigHead head;
  IntrinsicsSample first, now;
  HybridObserver observer;
  double sigma_encoder_rad;
  TurnSpread spread;
  bool has_zoomed = false;
  MotionReader reader{RotationSource::attitude, 0.5};
  RotationRow row;
  bool has_estimate = false;

  State(const RigHead& of, std::size_t num_points, double sigma_rad)
      : head(of),
        first(believed_at_first(of.camera)),
        now(first),
        observer(observer_config(of, num_points, now)),
        sigma_encoder_rad(sigma_rad) {}

  /// An image that did not fit may be of another lens: one that much longer or shorter.
  [[nodiscard]] double share_of_misfit(const IntrinsicsEstimate& estimate) const {
    if (estimate.event != ObserveEvent::burst) return 0.0;
    double radius2 = 0.0;
    for (const Eigen::Vector2d& px : row.px)
      if (is_seen(px)) radius2 += (px - now.k.tail<2>()).squaredNorm();
    return std::sqrt(std::max(0.0, estimate.nis - estimate.nis_dof) / std::max(1.0, radius2)) * observer.sigma_px();
  }

  /// Focal lengths as observed, their σ with the encoders' share: no more than was known before any rotation. The
  /// principal point stays the camera's: rotation hardly distinguishes it from the mounting, and a zoom by m multiplies
  /// its error by m.
  [[nodiscard]] IntrinsicsSample lens_of(const IntrinsicsEstimate& estimate) const {
    const IntrinsicsSample own = own_lens(head.camera);
    const Eigen::Vector2d f = estimate.values().head<2>(), sigma = estimate.sigma.head<2>(),
                          known = first.sigma.head<2>().cwiseQuotient(first.k.head<2>());
    const Eigen::Vector2d by_encoders = spread.variance_of_share(sigma_encoder_rad).cwiseMin(known.cwiseAbs2());
    IntrinsicsSample lens;
    lens.k << f, own.k.tail<2>();
    const double misfit = share_of_misfit(estimate);
    const Eigen::Array2d by_turns = by_encoders.array() + misfit * misfit;
    lens.sigma << (sigma.array().square() + by_turns * f.array().square()).sqrt(), own.sigma.tail<2>();
    return lens;
  }
};

LensObserver::LensObserver(const RigHead& head, std::size_t num_points, double sigma_encoder_rad)
    : state_(std::make_unique<State>(head, num_points, sigma_encoder_rad)) {}
LensObserver::~LensObserver() = default;
LensObserver::LensObserver(LensObserver&&) noexcept = default;
LensObserver& LensObserver::operator=(LensObserver&&) noexcept = default;

void LensObserver::take(double t_capture_s, const Eigen::Vector2d& pan_tilt_rad, std::span<const Eigen::Vector2d> px) {
  State& own = *state_;
  own.row.t_s = t_capture_s;
  own.row.base_from_cam = world_from_cam(own.head.head, pan_tilt_rad).rotation;
  own.row.px.clear();
  const Zoomed zoomed(own.head.camera, own.now.k);
  for (const Eigen::Vector2d& seen : px) {
    // The observer's camera is without distortion: as the lens of the last image would have it straightened.
    const auto ray = is_seen(seen) ? unproject(own.head.camera, zoomed.own_px(seen)) : std::nullopt;
    const bool is_ahead = ray && ray->z() > 0.0;
    own.row.px.push_back(
        is_ahead ? Eigen::Vector2d(own.now.k.head<2>().cwiseProduct(ray->hnormalized()) + own.now.k.tail<2>())
                 : Eigen::Vector2d::Constant(not_seen));
  }
  const IntrinsicsEstimate estimate = own.observer.step(own.reader.next(own.row));
  // Once a lens has zoomed, what the encoders had wrong until then stays in the points that are followed.
  own.has_zoomed = own.has_zoomed || estimate.event == ObserveEvent::zoom;
  if (estimate.event == ObserveEvent::restart) {
    own.has_zoomed = false;
    own.spread = {};
  }
  if (!own.has_zoomed) own.spread.add(pan_tilt_rad);
  const bool is_believable = estimate.has_value && estimate.values().allFinite() && estimate.sigma.allFinite() &&
                             estimate.fx > 0.0 && estimate.fy > 0.0;
  if (!is_believable) return;  // it initialises, or reinitialises: the last lens is kept
  own.now = own.lens_of(estimate);
  own.has_estimate = true;
}

const IntrinsicsSample& LensObserver::lens() const { return state_->now; }
bool LensObserver::has_estimate() const { return state_->has_estimate; }

}  // namespace alidade
