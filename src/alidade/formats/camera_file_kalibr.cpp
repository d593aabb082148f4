#include <fmt/format.h>
#include <yaml-cpp/yaml.h>

#include "alidade/formats/camera_formats.h"

namespace alidade::detail {
namespace {

/// Where the chain has the camera, as unread_parts() says it.
std::vector<std::string> place_in_chain(const Fields& fields, const std::vector<std::string>& names,
                                        std::size_t chosen) {
  std::vector<std::string> unread;
  for (const char* key : {"T_cn_cnm1", "T_cam_imu", "timeshift_cam_imu"}) {
    if (fields.has(key)) unread.emplace_back(key);
  }
  for (const std::string& place : place_among(names, chosen)) unread.push_back(place);
  return unread;
}

}  // namespace

CameraContent read_kalibr(const YAML::Node& root, const CameraText& file) {
  std::vector<std::string> names;
  for (const std::string& key : Fields(root, file.name).keys()) {
    if (root[key].IsMap() && root[key]["camera_model"].IsDefined()) names.push_back(key);
  }
  const std::size_t chosen = chosen_camera(names, file);
  const std::string name = names[chosen];
  const YAML::Node node = root[name];
  const Fields fields(node, file.name, name + ".");

  const std::string model = fields.text("camera_model");
  if (model != "pinhole") {
    refuse(file.name, fields.full("camera_model"),
           "'" + model + "' is no model of ours; known: pinhole with a distortion");
  }
  const std::vector<double> focal_centre = fields.numbers("intrinsics");
  if (focal_centre.size() != 4) refuse(file.name, fields.full("intrinsics"), "is not [fx, fy, cx, cy]");
  const std::string distortion_model = fields.text("distortion_model");
  const std::string key = fields.full("distortion_coeffs");
  Camera camera;
  if (distortion_model == "none") {
    camera = opencv_camera(focal_centre, {}, file.name, key);
  } else if (distortion_model == "radtan") {
    const std::vector<double> k = fields.numbers("distortion_coeffs");
    if (k.size() != 4) refuse(file.name, key, "is not [k1, k2, p1, p2]");
    camera = opencv_camera(focal_centre, k, file.name, key);
  } else if (distortion_model == "equidistant") {
    camera = fisheye_camera(focal_centre, fields.numbers("distortion_coeffs"), file.name, key);
  } else {
    refuse(file.name, fields.full("distortion_model"),
           "'" + distortion_model + "' is no model of ours; known: none radtan equidistant");
  }
  const std::vector<double> resolution = fields.numbers("resolution");
  if (resolution.size() != 2) refuse(file.name, fields.full("resolution"), "is not [width, height]");
  camera.width_px = checked_size(resolution[0], file.name, fields.full("resolution"));
  camera.height_px = checked_size(resolution[1], file.name, fields.full("resolution"));
  return {camera, place_in_chain(fields, names, chosen)};
}

std::string write_kalibr(const Camera& camera) {
  std::vector<double> k = distortion(camera);
  std::string name = "equidistant";
  if (std::holds_alternative<Calibrated<Pinhole>>(camera.lens)) name = "none";
  if (std::holds_alternative<Calibrated<Brown>>(camera.lens)) {
    name = "radtan";
    k.resize(4);  // k3 cannot be stored: lens_losses() says so
  }
  return fmt::format(
      "cam0:\n  camera_model: pinhole\n  intrinsics: {}\n  distortion_model: {}\n  distortion_coeffs: {}\n"
      "  resolution: [{}, {}]\n  rostopic: /cam0/image_raw\n",
      number_list(focal_and_centre(camera)), name, number_list(k), camera.width_px, camera.height_px);
}

}  // namespace alidade::detail
