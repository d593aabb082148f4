#include <algorithm>
#include <array>
#include <utility>

#include "alidade/localize/filter/filter.h"
#include "alidade/localize/filter/world_rotation.h"

// The error of the world's scale and how it is transferred when the state moves: world_scale.h.

namespace alidade {

/// Relative variance of the distance between camera and feature.
double LocalizationFilter::relative_variance(const Feature& feature, const RelativeDistance& distance) const {
  double variance = 0.0;
  const auto at = [&](int i) { return i < 3 ? i : feature.offset + i - 3; };
  const auto weight = [&](int i) { return i < 3 ? distance.J_position[i] : distance.J_feature[i - 3]; };
  for (int i = 0; i < 3 + feature.dim(); ++i)
    for (int j = 0; j < 3 + feature.dim(); ++j) variance += weight(i) * weight(j) * P_.at(at(i), at(j));
  return variance;
}

/// Reading by the most certain distances of the map with a relative σ below the limit; empty if there is none.
ScaleReading LocalizationFilter::scale_reading(double max_sigma_rel) const {
  using Candidate = std::pair<double, const Feature*>;
  std::array<Candidate, ScaleReading::max_features> surest{};
  std::size_t num = 0;
  const Eigen::Vector3d& camera_in_world = motion_.world_from_cam.translation;
  for (const Feature& feature : features_) {
    const double variance = relative_variance(feature, relative_distance(feature, camera_in_world));
    if (!(variance > 0.0 && variance < max_sigma_rel * max_sigma_rel)) continue;
    if (num == surest.size() && !(variance < surest[num - 1].first)) continue;
    num = std::min(num + 1, surest.size());
    surest[num - 1] = {variance, &feature};
    for (std::size_t i = num - 1; i > 0 && surest[i].first < surest[i - 1].first; --i)
      std::swap(surest[i], surest[i - 1]);
  }
  double sum = 0.0;
  for (std::size_t i = 0; i < num; ++i) sum += 1.0 / surest[i].first;
  ScaleReading reading;
  for (std::size_t i = 0; i < num; ++i)
    reading.add(*surest[i].second, relative_distance(*surest[i].second, camera_in_world),
                1.0 / (surest[i].first * sum));
  return reading;
}

/// Appends the scale reading cᵀe to the state for the duration of an update.
void LocalizationFilter::begin_scale() {
  constexpr double sure_enough = 0.1;  // less certain distances carry no information about the scale
  scale_at_.reset();
  scale_ = scale_reading(sure_enough);
  const int at = P_.dim();
  if (scale_.is_empty() || !P_.grow(1)) return;
  const auto read = [&](int row) {
    double sum = 0.0;
    for (std::size_t k = 0; k < scale_.columns().size(); ++k)
      sum += scale_.weights()[k] * P_.at(scale_.columns()[k], row);
    return sum;
  };
  for (int i = 0; i < at; ++i) P_.at(i, at) = P_.at(at, i) = read(i);
  P_.at(at, at) = read(at);
  scale_at_ = at;
}

void LocalizationFilter::end_scale() {
  if (!scale_at_) return;
  delta_[*scale_at_] = 0.0;
  P_.remove(*scale_at_, 1);
  scale_at_.reset();
}

/// Applies the scale, and transfers the covariance along the old scale direction to the new one. An update that would
/// shrink the world by more than half is far from linear: the scale is then limited to one half.
void LocalizationFilter::count_scale() {
  constexpr double smallest = -0.5;
  const double eps = delta_[*scale_at_], scale = 1.0 + std::max(eps, smallest);
  const WorldRotation turn(motion_.world_from_cam, delta_.segment<3>(3));
  Eigen::VectorXd& u = next_;
  u.head(P_.dim()).setZero();
  const auto move = [&](const Eigen::Vector3d& place, int offset) {
    const Eigen::Vector3d error = delta_.segment<3>(offset);
    const Eigen::Vector3d moved = turns_world_ ? (turn.position_before(place, error) - place).eval() : error;
    u.segment<3>(offset) = scale * (place + moved - eps * place) - place;
    delta_.segment<3>(offset) += u.segment<3>(offset) - moved;
  };
  move(motion_.world_from_cam.translation, 0);
  move(motion_.velocity_in_world, 6);
  for (const Feature& feature : features_) {
    move(feature.values.head<3>(), feature.offset);
    if (feature.kind == FeatureKind::xyz) continue;
    const double rho = feature.values[5];
    double& error = delta_[feature.offset + 5];
    error = (rho + error + rho * eps) / scale - rho;
    u[feature.offset + 5] = -error;
  }
  P_.shear_along(*scale_at_, u.data());
  given_.shear_along(scale_.columns(), scale_.weights(), u.data(), P_.dim());
}

}  // namespace alidade
