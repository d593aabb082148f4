#include "alidade/pantilt/rig.h"

#include <fmt/format.h>

#include <cmath>
#include <set>

#include "alidade/camera/camera_fault.h"
#include "alidade/geometry/covariance.h"

namespace alidade {
namespace {

/// What is wrong with a covariance of `num` parameters; empty where nothing is, or where there is none.
std::string covariance_fault(const Eigen::MatrixXd& cov, Eigen::Index num, const std::string& what,
                             const std::string& of_what) {
  const bool is_of_it = cov.size() == 0 || (cov.rows() == num && cov.cols() == num && cov.allFinite());
  if (!is_of_it) return what + " is not of " + of_what;
  return is_covariance(cov) ? "" : what + " is not symmetric, or has a negative variance";
}

}  // namespace

std::string fault(const RigHead& rig_head) {
  const auto& [head, camera] = rig_head;
  const Encoder& encoder = head.encoder;
  const bool is_mounted = head.world_from_base.translation.allFinite() && head.pan_to_tilt_m.allFinite() &&
                          head.tilt_to_cam_m.allFinite() && std::isfinite(head.axes_skew_rad);
  constexpr double off = 1e-6;  // of a quaternion's norm
  const bool is_rotation =
      std::abs(head.world_from_base.rotation.norm() - 1.0) < off && std::abs(head.cam_from_tilt.norm() - 1.0) < off;
  const Eigen::Vector2d zero = encoder.readings(Eigen::Vector2d::Zero());
  const bool is_encoder = zero.allFinite() && encoder.pan_scale != 0.0 && encoder.tilt_scale != 0.0 &&
                          encoder.sigma_rad >= 0.0 && std::isfinite(encoder.sigma_rad);
  if (std::string of_camera = fault(camera); !of_camera.empty()) return of_camera;
  if (!is_mounted || !is_rotation) return "its mounting must be finite, and its rotations of unit norm";
  return is_encoder ? "" : "its encoders must be finite, with scales other than zero and σ not below";
}

std::string fault(const Rig& rig) {
  const std::size_t num_heads = rig.heads.size();
  Eigen::Index num = num_head_params * static_cast<Eigen::Index>(num_heads);
  if (std::string of_cov = covariance_fault(rig.cov, num, "the rig's covariance", "its heads' parameters");
      !of_cov.empty())
    return of_cov;
  std::set<int> ids;
  for (const RigHead& head : rig.heads) {
    if (!ids.insert(head.head.id).second) return fmt::format("two heads have the id {}", head.head.id);
    const std::string what = fault(head);
    if (!what.empty()) return fmt::format("head {}: {}", head.head.id, what);
    num += params(head.camera.lens).size();
  }
  if (std::string of_cov =
          covariance_fault(rig.cov_with_lenses, num, "the rig's covariance with its lenses", "their parameters");
      !of_cov.empty())
    return of_cov;
  if (!rig.encoder_errors.empty() && rig.encoder_errors.size() != num_heads)
    return fmt::format("the rig has {} heads, but errors of {} encoders are given", num_heads,
                       rig.encoder_errors.size());
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
