#include "alidade/localize/filter/world_scale.h"

namespace alidade {

Eigen::Vector<double, 6> scale_direction(const Feature& feature) {
  Eigen::Vector<double, 6> N = Eigen::Vector<double, 6>::Zero();
  N.head<3>() = feature.values.head<3>();
  if (feature.kind == FeatureKind::inverse_depth) N[5] = -feature.values[5];
  return N;
}

RelativeDistance relative_distance(const Feature& feature, const Eigen::Vector3d& camera_in_world) {
  const FeaturePlace place = place_of(feature);
  const Eigen::Vector3d away = place.point_in_world - camera_in_world;
  const double distance2 = away.squaredNorm();
  RelativeDistance relative;
  if (!(distance2 > 0.0)) return relative;
  relative.J_position = -away / distance2;
  relative.J_feature = place.J.transpose() * (away / distance2);
  return relative;
}

void ScaleReading::add(const Feature& feature, const RelativeDistance& distance, double share) {
  const auto dim = static_cast<std::size_t>(feature.dim());
  if (num_ == 0) num_ = 3;
  if (num_ + dim > columns_.size()) return;
  for (std::size_t i = 0; i < 3; ++i) weights_[i] += share * distance.J_position[static_cast<Eigen::Index>(i)];
  for (std::size_t i = 0; i < dim; ++i) {
    columns_[num_] = feature.offset + static_cast<int>(i);
    weights_[num_++] = share * distance.J_feature[static_cast<Eigen::Index>(i)];
  }
}

}  // namespace alidade
