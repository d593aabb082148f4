#include "alidade/results/documents/heads_document.h"

#include "alidade/files/number_list.h"
#include "alidade/formats/camera_file.h"
#include "alidade/formats/rig_file.h"

namespace alidade {
namespace {

JsonValue head_value(const Head& head) {
  JsonValue value;
  value["id"] = head.id;
  value["world_from_base"]["translation_m"] = list_of(head.world_from_base.translation);
  value["world_from_base"]["quaternion_wxyz"] = list_of(head.world_from_base.rotation);
  value["pan_to_tilt_m"] = list_of(head.pan_to_tilt_m);
  value["tilt_to_cam_m"] = list_of(head.tilt_to_cam_m);
  value["cam_from_tilt"]["quaternion_wxyz"] = list_of(head.cam_from_tilt);
  value["axes_skew_rad"] = head.axes_skew_rad;
  value["encoder"]["pan_zero_rad"] = head.encoder.pan_zero_rad;
  value["encoder"]["tilt_zero_rad"] = head.encoder.tilt_zero_rad;
  value["encoder"]["pan_scale"] = head.encoder.pan_scale;
  value["encoder"]["tilt_scale"] = head.encoder.tilt_scale;
  value["encoder"]["pan_cos_rad"] = head.encoder.pan_cos_rad;
  value["encoder"]["pan_sin_rad"] = head.encoder.pan_sin_rad;
  value["encoder"]["tilt_cos_rad"] = head.encoder.tilt_cos_rad;
  value["encoder"]["tilt_sin_rad"] = head.encoder.tilt_sin_rad;
  value["encoder"]["sigma_rad"] = head.encoder.sigma_rad;
  return value;
}

/// σ by the names of a head, from its part of a rig's covariance: of the position along the world's axes, as it is
/// given; of rotations three small angles on the right.
JsonValue head_sigma(const Rig& rig, const Eigen::MatrixXd& cov, std::size_t h) {
  const Head& head = rig.heads[h].head;
  const Eigen::Index at = num_head_params * static_cast<Eigen::Index>(h);
  const HeadVector sigma = cov.diagonal().segment<num_head_params>(at).cwiseMax(0.0).cwiseSqrt();
  JsonValue value;
  value["id"] = head.id;
  value["world_from_base"]["translation_m"] = list_of(sigma_of_base(rig, cov, h));
  value["world_from_base"]["rotation_rad"] = list_of(Eigen::Vector3d(sigma.segment<3>(base_rotation_param)));
  value["pan_to_tilt_m"] = list_of(Eigen::Vector3d(sigma.segment<3>(pan_to_tilt_param)));
  value["tilt_to_cam_m"] = list_of(Eigen::Vector3d(sigma.segment<3>(tilt_to_cam_param)));
  value["cam_from_tilt"]["rotation_rad"] = list_of(Eigen::Vector3d(sigma.segment<3>(cam_rotation_param)));
  value["axes_skew_rad"] = sigma[axes_skew_param];
  value["encoder"]["pan_scale"] = sigma[pan_scale_param];
  value["encoder"]["tilt_scale"] = sigma[tilt_scale_param];
  value["encoder"]["pan_cos_rad"] = sigma[pan_cos_param];
  value["encoder"]["pan_sin_rad"] = sigma[pan_sin_param];
  value["encoder"]["tilt_cos_rad"] = sigma[tilt_cos_param];
  value["encoder"]["tilt_sin_rad"] = sigma[tilt_sin_param];
  return value;
}

}  // namespace

Eigen::Vector3d sigma_of_base(const Rig& rig, const Eigen::MatrixXd& cov, std::size_t h) {
  const Eigen::Index at = num_head_params * static_cast<Eigen::Index>(h);
  const Eigen::Matrix3d R = rig.heads[h].head.world_from_base.rotation.toRotationMatrix();
  const Eigen::Matrix3d in_world = R * cov.block<3, 3>(at, at) * R.transpose();
  return in_world.diagonal().cwiseMax(0.0).cwiseSqrt();
}

void fill_heads(const Rig& rig, ResultDocument& document) {
  JsonValue heads = JsonValue::list(), sigmas = JsonValue::list();
  for (std::size_t h = 0; h < rig.heads.size(); ++h) {
    heads.push_back(head_value(rig.heads[h].head));
    sigmas.push_back(head_sigma(rig, rig.cov, h));
  }
  document.covariance_names = parameter_names(rig);
  document.estimate["heads"] = std::move(heads);
  document.stddev["heads"] = std::move(sigmas);
  for (Eigen::Index i = 0; i < rig.cov.rows(); ++i)
    for (Eigen::Index j = i; j < rig.cov.cols(); ++j) document.covariance_upper.push_back(rig.cov(i, j));
}

void fill_heads_model(const Rig& rig, const Eigen::MatrixXd& cov_model, ResultDocument& document) {
  JsonValue sigmas = JsonValue::list();
  for (std::size_t h = 0; h < rig.heads.size(); ++h) sigmas.push_back(head_sigma(rig, cov_model, h));
  document.stddev_model["heads"] = std::move(sigmas);
}

void add_rig_files(const Rig& rig, std::vector<NamedBytes>& files) {
  std::vector<std::string> camera_files;
  for (const RigHead& rig_head : rig.heads) {
    camera_files.push_back("camera_" + std::to_string(rig_head.head.id) + ".yaml");
    files.push_back({camera_files.back(), camera_text(rig_head.camera, CameraFormat::alidade)});
  }
  files.push_back({"rig.yaml", rig_text(rig, camera_files)});
}

}  // namespace alidade
