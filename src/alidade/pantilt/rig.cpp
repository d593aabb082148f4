#include "alidade/pantilt/rig.h"

#include <fmt/format.h>

#include <cmath>

namespace alidade {
namespace {

bool is_covariance_of(const Eigen::MatrixXd& cov, Eigen::Index num) {
  return cov.size() == 0 || (cov.rows() == num && cov.cols() == num && cov.allFinite());
}

}  // namespace

std::string fault(const RigHead& rig_head) {
  const auto& [head, camera] = rig_head;
  const Eigen::VectorXd lens = params(camera.lens);
  const Encoder& encoder = head.encoder;
  const bool is_lens = lens.allFinite() && lens[0] > 0.0 && lens[1] > 0.0;
  const bool is_mounted = head.world_from_base.translation.allFinite() && head.pan_to_tilt_m.allFinite() &&
                          head.tilt_to_cam_m.allFinite() && std::isfinite(head.axes_skew_rad);
  constexpr double off = 1e-6;  // of a quaternion's norm
  const bool is_rotation =
      std::abs(head.world_from_base.rotation.norm() - 1.0) < off && std::abs(head.cam_from_tilt.norm() - 1.0) < off;
  const Eigen::Vector2d zero = encoder.readings(Eigen::Vector2d::Zero());
  const bool is_encoder = zero.allFinite() && encoder.pan_scale != 0.0 && encoder.tilt_scale != 0.0 &&
                          encoder.sigma_rad >= 0.0 && std::isfinite(encoder.sigma_rad);
  if (camera.width_px < 1 || camera.height_px < 1) return "its camera has no image size";
  if (!is_lens) return "its camera's parameters must be finite, and focal lengths above zero";
  if (camera.cov.size() > 0 &&
      (camera.cov.rows() != lens.size() || camera.cov.cols() != lens.size() || !camera.cov.allFinite()))
    return "its camera's covariance is not of the lens' parameters";
  if (!is_mounted || !is_rotation) return "its mounting must be finite, and its rotations of unit norm";
  return is_encoder ? "" : "its encoders must be finite, with scales other than zero and σ not below";
}

std::string fault(const Rig& rig) {
  const std::size_t num_heads = rig.heads.size();
  Eigen::Index num = num_head_params * static_cast<Eigen::Index>(num_heads);
  if (!is_covariance_of(rig.cov, num)) return "the rig's covariance is not of its heads' parameters";
  for (const RigHead& head : rig.heads) {
    const std::string what = fault(head);
    if (!what.empty()) return fmt::format("head {}: {}", head.head.id, what);
    num += params(head.camera.lens).size();
  }
  if (!is_covariance_of(rig.cov_with_lenses, num))
    return "the rig's covariance with its lenses is not of their parameters";
  if (!rig.intrinsics_histories.empty() && rig.intrinsics_histories.size() != num_heads)
    return fmt::format("the rig has {} heads, but intrinsics over time for {} are given", num_heads,
                       rig.intrinsics_histories.size());
  return "";
}

std::vector<std::string> parameter_names(const Rig& rig) {
  std::vector<std::string> names;
  for (const RigHead& one : rig.heads)
    for (const char* name : head_param_names) names.push_back("head" + std::to_string(one.head.id) + "." + name);
  return names;
}

}  // namespace alidade
