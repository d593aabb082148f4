#include "alidade/localize/filter/filter.h"

#include <algorithm>
#include <cassert>
#include <cmath>

namespace alidade {
namespace {

constexpr int pose_dim = 6;

}  // namespace

LocalizationFilter::LocalizationFilter(Camera camera, const CameraMotion& start, const MotionMatrix& start_cov,
                                       LocalizationFilterConfig config)
    : camera_(std::move(camera)), motion_(start), config_(std::move(config)), camera_at_delta_(camera_) {
  P_.reserve(config_.state_capacity + 1, 2 * config_.observations_capacity);
  [[maybe_unused]] const bool fits = P_.grow(motion_dim + num_lens());
  assert(fits && config_.lens_params.size() == config_.sigma_lens_params.size());
  for (int i = 0; i < motion_dim; ++i)
    for (int j = 0; j < motion_dim; ++j) P_.at(i, j) = start_cov(i, j);
  for (int k = 0; k < num_lens(); ++k) {
    const double sigma = config_.sigma_lens_params[static_cast<std::size_t>(k)];
    P_.at(motion_dim + k, motion_dim + k) = sigma * sigma;
  }
  const auto observations = static_cast<std::size_t>(config_.observations_capacity);
  given_ =
      GivenEffects(camera_, config_.lens_params, config_.sigma_scale, P_.capacity(), config_.observations_capacity);
  delta_.setZero(P_.capacity());
  start_.setZero(P_.capacity());
  next_.setZero(P_.capacity());
  before_.setZero(P_.capacity());
  shear_.setZero(P_.capacity(), 3);
  measured_.reserve(observations);
  waiting_.reserve(observations);
  doubtful_.reserve(observations);
  used_.reserve(observations);
  outcomes_.reserve(observations);
  nis_.reserve(observations);
  agrees_.reserve(observations);
  agrees_best_.reserve(observations);
  kept_.outcomes.reserve(observations);
  kept_.nis.reserve(observations);
  kept_.used.reserve(observations);
  kept_.delta.setZero(P_.capacity());
}

const Feature* LocalizationFilter::find(long id) const {
  const auto at = std::ranges::find(features_, id, &Feature::id);
  return at == features_.end() ? nullptr : &*at;
}

void LocalizationFilter::predict(double dt_s) {
  const MotionJacobians J = motion_jacobians(motion_, dt_s);
  const MotionMatrix Q = motion_noise(J, config_.sigma_a_m_s2, config_.sigma_alpha_rad_s2, dt_s);
  motion_ = moved(motion_, dt_s);
  given_.predict(J.F);
  for (int j = motion_dim; j < P_.dim(); ++j) {
    Eigen::Map<Eigen::Vector<double, motion_dim>> column(&P_.at(0, j));  // F changes position and rotation only
    const Eigen::Vector3d rotation = column.segment<3>(3), rate = column.tail<3>();
    column.head<3>() += dt_s * column.segment<3>(6);
    column.segment<3>(3) = J.F.block<3, 3>(3, 3) * rotation + J.F.block<3, 3>(3, 9) * rate;
  }
  for (int i = 0; i < motion_dim; ++i)
    for (int j = motion_dim; j < P_.dim(); ++j) P_.at(j, i) = P_.at(i, j);
  const MotionMatrix P = J.F * motion_covariance() * J.F.transpose() + Q;
  for (int i = 0; i < motion_dim; ++i)
    for (int j = 0; j < motion_dim; ++j) P_.at(i, j) = 0.5 * (P(i, j) + P(j, i));
}

bool LocalizationFilter::add_known(long id, const Eigen::Vector3d& point_in_world, double sigma_m) {
  if (has(id) || !has_room(3)) return false;
  Feature feature;
  feature.id = id;
  feature.values.head<3>() = point_in_world;
  feature.is_known = true;
  feature.given_in_world = point_in_world;
  feature.sigma_given_m = sigma_m;
  feature.offset = P_.dim();
  if (!P_.grow(3)) return false;
  for (int i = 0; i < 3; ++i) P_.at(feature.offset + i, feature.offset + i) = sigma_m * sigma_m;
  given_.add_known(feature.offset, point_in_world);
  features_.push_back(feature);
  return true;
}

bool LocalizationFilter::add(long id, const Eigen::Vector2d& px, const RangePrior& prior, FeatureKind kind) {
  if (has(id) || !has_room(kind == FeatureKind::xyz ? 3 : 6)) return false;
  const double sigma_px = config_.sigma_new_px > 0.0 ? config_.sigma_new_px : config_.sigma_px;
  const auto made = new_feature(camera_, motion_.world_from_cam, px, sigma_px, prior, kind);
  if (!made || !made->feature.values.allFinite() || !made->cov.allFinite()) return false;
  constexpr double surer = 0.5;  // than that of the new one, which is derived from them
  append_feature(*made, id,
                 prior.is_of_map && config_.holds_frame ? scale_reading(surer * prior.sigma_rel) : ScaleReading());
  return true;
}

/// P(new, ·) = J P(inputs, ·), P(new, new) = J P Jᵀ + the covariance of pixel and distance. Inputs: the camera, the
/// lens, and the components of the scale reading, if the distance derives from it.
void LocalizationFilter::append_feature(const NewFeature& made, long id, const ScaleReading& scale) {
  Feature feature = made.feature;
  feature.id = id;
  feature.offset = P_.dim();
  const int dim = feature.dim();
  constexpr std::size_t max_inputs = StateCovariance::max_support + ScaleReading::max_components;
  std::array<int, max_inputs> place{};
  Eigen::Matrix<double, 6, max_inputs> J;
  int num_inputs = 0;
  const auto put = [&](int column, const Eigen::Vector<double, 6>& derivative) {
    place[static_cast<std::size_t>(num_inputs)] = column;
    J.col(num_inputs++) = derivative;
  };
  for (int i = 0; i < pose_dim; ++i) put(i, made.J_pose.col(i));
  for (int k = 0; k < num_lens(); ++k)
    put(motion_dim + k, made.J_lens.col(config_.lens_params[static_cast<std::size_t>(k)]));
  for (std::size_t k = 0; k < scale.columns().size(); ++k) put(scale.columns()[k], scale.weights()[k] * made.J_range);
  if (!P_.grow(dim)) return;
  given_.add(feature.offset, made, config_.lens_params, scale);
  for (int j = 0; j < feature.offset; ++j) {
    Eigen::Vector<double, 6> sum = Eigen::Vector<double, 6>::Zero();
    for (int c = 0; c < num_inputs; ++c) sum += P_.at(place[static_cast<std::size_t>(c)], j) * J.col(c);
    for (int i = 0; i < dim; ++i) P_.at(feature.offset + i, j) = P_.at(j, feature.offset + i) = sum[i];
  }
  for (int i = 0; i < dim; ++i) {
    for (int j = i; j < dim; ++j) {
      double sum = made.cov(i, j);
      for (int c = 0; c < num_inputs; ++c)
        sum += J(j, c) * P_.at(feature.offset + i, place[static_cast<std::size_t>(c)]);
      P_.at(feature.offset + i, feature.offset + j) = P_.at(feature.offset + j, feature.offset + i) = sum;
    }
  }
  features_.push_back(feature);
}

void LocalizationFilter::remove_numbers(int offset, int count) {
  given_.remove(offset, count, P_.dim());
  P_.remove(offset, count);
  for (Feature& feature : features_)
    if (feature.offset > offset) feature.offset -= count;
}

void LocalizationFilter::remove(long id) {
  const Feature* feature = find(id);
  if (!feature) return;
  const int offset = feature->offset, dim = feature->dim();
  features_.erase(features_.begin() + (feature - features_.data()));
  remove_numbers(offset, dim);
}

int LocalizationFilter::convert_linear() {
  int num_converted = 0;
  for (Feature& feature : features_) {
    if (feature.kind != FeatureKind::inverse_depth) continue;
    const int at = feature.offset;
    const double sigma_rho = std::sqrt(P_.at(at + 5, at + 5));
    if (!(linearity_index(feature, sigma_rho, motion_.world_from_cam.translation) < config_.linear_below)) continue;
    const FeaturePlace place = place_of(feature);
    Eigen::Matrix3d own = Eigen::Matrix3d::Zero();
    for (int a = 0; a < 6; ++a)
      for (int b = 0; b < 6; ++b) own += P_.at(at + a, at + b) * place.J.col(a) * place.J.col(b).transpose();
    for (int j = 0; j < P_.dim(); ++j) {
      Eigen::Vector3d sum = Eigen::Vector3d::Zero();
      for (int a = 0; a < 6; ++a) sum += P_.at(at + a, j) * place.J.col(a);
      for (int i = 0; i < 3; ++i) P_.at(at + i, j) = P_.at(j, at + i) = sum[i];
    }
    for (int i = 0; i < 3; ++i)
      for (int j = 0; j < 3; ++j) P_.at(at + i, at + j) = own(i, j);
    given_.make_place(at, place.J);
    feature.kind = FeatureKind::xyz;
    feature.values.setZero();
    feature.values.head<3>() = place.point_in_world;
    remove_numbers(at + 3, 3);
    ++num_converted;
  }
  return num_converted;
}

void LocalizationFilter::place_camera(const CameraMotion& motion, const MotionMatrix& cov) {
  motion_ = motion;
  given_.forget_motion();
  for (int i = 0; i < motion_dim; ++i) {
    for (int j = 0; j < P_.dim(); ++j) P_.at(i, j) = P_.at(j, i) = 0.0;
  }
  for (int i = 0; i < motion_dim; ++i)
    for (int j = 0; j < motion_dim; ++j) P_.at(i, j) = cov(i, j);
}

std::optional<LocalizationFilter::Place> LocalizationFilter::place(long id) const {
  const Feature* feature = find(id);
  if (!feature) return std::nullopt;
  const FeaturePlace at = place_of(*feature);
  Place result{at.point_in_world, Eigen::Matrix3d::Zero()};
  for (int a = 0; a < feature->dim(); ++a)
    for (int b = 0; b < feature->dim(); ++b)
      result.cov += P_.at(feature->offset + a, feature->offset + b) * at.J.col(a) * at.J.col(b).transpose();
  if (given_.counts()) {
    const Eigen::MatrixXd J = at.J.leftCols(feature->dim()) * given_.rows(feature->offset, feature->dim());
    result.cov += J * given_.cov() * J.transpose();
  }
  return result;
}

MotionMatrix LocalizationFilter::motion_covariance() const {
  MotionMatrix P;
  for (int i = 0; i < motion_dim; ++i)
    for (int j = 0; j < motion_dim; ++j) P(i, j) = P_.at(i, j);
  return P;
}

Eigen::Matrix<double, 6, 6> LocalizationFilter::pose_covariance() const {
  Eigen::Matrix<double, 6, 6> J = Eigen::Matrix<double, 6, 6>::Identity();
  J.topLeftCorner<3, 3>() = motion_.world_from_cam.rotation.toRotationMatrix().transpose();
  Eigen::Matrix<double, 6, 6> cov = J * motion_covariance().topLeftCorner<6, 6>() * J.transpose();
  if (given_.counts()) {
    const Eigen::Matrix<double, 6, Eigen::Dynamic> J_given = J_pose_given();
    cov += J_given * given_.cov() * J_given.transpose();
  }
  return cov;
}

Eigen::Matrix<double, 6, Eigen::Dynamic> LocalizationFilter::J_pose_given() const {
  Eigen::Matrix<double, 6, Eigen::Dynamic> J = given_.rows(0, pose_dim);
  J.topRows<3>() = motion_.world_from_cam.rotation.toRotationMatrix().transpose() * given_.rows(0, 3);
  return J;
}

Eigen::VectorXd LocalizationFilter::lens_sigmas() const {
  Eigen::VectorXd sigmas(num_lens());
  for (int k = 0; k < num_lens(); ++k) sigmas[k] = std::sqrt(P_.at(motion_dim + k, motion_dim + k));
  return sigmas;
}

}  // namespace alidade
