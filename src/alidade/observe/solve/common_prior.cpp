#include <Eigen/Cholesky>
#include <algorithm>
#include <cmath>
#include <utility>

#include "alidade/estimation/median.h"
#include "alidade/geometry/decompositions.h"
#include "alidade/geometry/so3.h"
#include "alidade/observe/solve/rotation_bundle.h"

namespace alidade {

CommonPrior::CommonPrior(const RotatingCamera& mean_in)
    : mean(mean_in), sigma_k(0.5 * mean_in.k[0], 0.5 * mean_in.k[1], 0.5, 0.5) {}

CommonMatrix CommonPrior::information(const CommonLayout& layout) const {
  CommonVector sigma = CommonVector::Ones(layout.size);
  sigma.head<4>() = sigma_k;
  for (const int at : {layout.k1, layout.k2, layout.k3}) {
    if (at >= 0) sigma[at] = sigma_k1;
  }
  if (layout.tangential >= 0) sigma.segment<2>(layout.tangential).setConstant(sigma_tangential);
  if (layout.mount >= 0) sigma.segment<3>(layout.mount).setConstant(sigma_mount_rad);
  if (layout.delay >= 0) sigma[layout.delay] = sigma_delay_s;
  if (layout.lever >= 0) sigma.segment<3>(layout.lever).setConstant(sigma_lever_m);
  if (layout.shutter >= 0) sigma[layout.shutter] = sigma_shutter_s;
  if (layout.drift >= 0) sigma[layout.drift] = sigma_drift_per_s;
  if (layout.errors >= 0) {
    // The accuracy of encoders and gyroscopes is known, and entered below.
    sigma.segment(layout.errors, layout.num_errors).setConstant(std::numeric_limits<double>::infinity());
  }
  CommonMatrix information = CommonMatrix::Zero(layout.size, layout.size);
  information.diagonal() = sigma.array().square().inverse();
  for (int i = 0; i < 4; ++i) {
    if (is_given_k[static_cast<std::size_t>(i)]) information(i, i) = 0.0;
  }
  return information + given_information(layout);
}

CommonMatrix CommonPrior::given_information(const CommonLayout& layout) const {
  CommonMatrix information = CommonMatrix::Zero(layout.size, layout.size);
  for (int i = 0; i < 4; ++i) {
    if (is_given_k[static_cast<std::size_t>(i)]) information(i, i) = 1.0 / (sigma_k[i] * sigma_k[i]);
  }
  if (layout.errors >= 0) {
    information.diagonal().segment(layout.errors, layout.num_errors).setConstant(1.0 / (sigma_error * sigma_error));
  }
  const double aspect = 1.0 / (sigma_aspect * sigma_aspect);
  information.topLeftCorner<2, 2>() += aspect * (Eigen::Matrix2d() << 1.0, -1.0, -1.0, 1.0).finished();
  return information;
}

CommonPrior CommonPrior::about(const RotatingCamera& camera) const {
  CommonPrior moved = *this;
  moved.mean = camera;
  for (int i = 0; i < 4; ++i) {
    if (is_given_k[static_cast<std::size_t>(i)]) moved.mean.k[i] = mean.k[i];
  }
  // A given aspect ratio is a prior of fx − fy with mean zero: fx and fy of the mean must be equal.
  if (std::isfinite(sigma_aspect) && !is_given_k[0] && !is_given_k[1]) {
    moved.mean.k.head<2>().setConstant(0.5 * (camera.k[0] + camera.k[1]));
  }
  return moved;
}

CommonVector CommonPrior::offset(const CommonLayout& layout, const RotatingCamera& camera) const {
  CommonVector offset = CommonVector::Zero(layout.size);
  offset.head<4>() = camera.k - mean.k;
  if (layout.k1 >= 0) offset[layout.k1] = camera.k1 - mean.k1;
  if (layout.k2 >= 0) offset[layout.k2] = camera.k2 - mean.k2;
  if (layout.k3 >= 0) offset[layout.k3] = camera.k3 - mean.k3;
  if (layout.tangential >= 0) {
    offset.segment<2>(layout.tangential) = Eigen::Vector2d(camera.p1 - mean.p1, camera.p2 - mean.p2);
  }
  if (layout.mount >= 0) {
    offset.segment<3>(layout.mount) = log_so3((mean.cam_from_mount.conjugate() * camera.cam_from_mount).normalized());
  }
  if (layout.delay >= 0) offset[layout.delay] = camera.delay_s - mean.delay_s;
  if (layout.lever >= 0) offset.segment<3>(layout.lever) = camera.lever_m - mean.lever_m;
  if (layout.shutter >= 0) offset[layout.shutter] = camera.shutter_s - mean.shutter_s;
  if (layout.drift >= 0) offset[layout.drift] = camera.drift_per_s - mean.drift_per_s;
  // Errors of the rotation have a prior mean of zero in total, including the part that was corrected before.
  for (const RotationErrors* part : {&camera.errors, &camera.undone}) {
    if (layout.errors >= 0 && part->size() == layout.num_errors) {
      offset.segment(layout.errors, layout.num_errors) += *part;
    }
  }
  return offset;
}

CommonMatrix BundleSolution::covariance() const {
  const CommonMatrix all = information + prior_information;
  return inverse_symmetric(all);
}

CommonMatrix BundleSolution::bound() const {
  const CommonMatrix all = information + given_information;
  return inverse_symmetric(all);
}

double robust_sigma(std::vector<double> residual_norms, int dof) {
  if (residual_norms.empty() || dof < 1) return 0.0;
  const double share = static_cast<double>(dof) / (2.0 * static_cast<double>(residual_norms.size()));
  return median_of(std::move(residual_norms)) / rayleigh_median / std::sqrt(share);
}

}  // namespace alidade
