#include <fmt/format.h>
#include <yaml-cpp/yaml.h>

#include <algorithm>
#include <cmath>

#include "alidade/formats/camera_formats.h"

namespace alidade::detail {
namespace {

/// How a parameter stands in the file: a port's normal as one vector, everything else under its own name.
bool is_of_normal(const std::string& name) { return name == "normal_x" || name == "normal_y"; }

/// The keys of a model's parameters.
std::vector<std::string> keys_of(const std::vector<std::string>& names) {
  std::vector<std::string> keys;
  for (const std::string& name : names) {
    if (!is_of_normal(name)) keys.push_back(name);
  }
  if (keys.size() < names.size()) keys.emplace_back("normal");
  return keys;
}

/// Unit normal of a port, away from the camera, of any length in the file.
Eigen::Vector3d read_normal(const Fields& fields) {
  Eigen::Vector3d normal = read_vector(fields, "normal");
  if (!(normal.z() > 0.0)) refuse(fields.file(), "normal", "does not point away from the camera: its z is not above 0");
  if (std::abs(normal.norm() - 1.0) > 1e-12) normal.normalize();  // what we wrote reads back as the same numbers
  return normal;
}

void check_port(const Fields& fields) {
  for (const char* key : {"gap_m", "glass_m"}) {
    if (fields.number(key) < 0.0) refuse(fields.file(), key, "is below zero");
  }
  for (const char* key : {"n_glass", "n_water"}) {
    const double index = fields.number(key);
    if (index < 1.0 || index > 4.0) refuse(fields.file(), key, "is no refractive index (1 to 4)");
  }
}

}  // namespace

Camera read_alidade(const YAML::Node& root, const CameraText& file) {
  const Fields fields(root, file.name);
  if (!file.choice.empty()) refuse(file.name, "", "holds one camera without a name; leave ':" + file.choice + "' out");
  const std::string model = fields.text("model");
  const std::optional<Lens> lens = make_lens(model);
  if (!lens) refuse(file.name, "model", "'" + model + "' is not known; known: pinhole brown kannala_brandt flat_port");
  const std::vector<std::string> names = param_names(*lens);
  std::vector<std::string> known{"model", "width", "height"};
  const std::vector<std::string> keys = keys_of(names);
  known.insert(known.end(), keys.begin(), keys.end());
  known.insert(known.end(), {"rms_px", "source", "covariance"});
  known.insert(known.end(), verdict_keys.begin(), verdict_keys.end());
  refuse_unknown_keys(fields, known, "this model");

  Camera camera;
  camera.width_px = fields.size("width");
  camera.height_px = fields.size("height");
  Eigen::VectorXd values = params(*lens);
  if (!is_central(*lens)) {
    check_port(fields);
    values.tail<2>() = read_normal(fields).head<2>();
  }
  for (std::size_t i = 0; i < names.size(); ++i) {
    if (is_of_normal(names[i])) continue;
    const bool is_optional = names[i] == "skew";  // no other format has it; what is not there is zero
    if (is_optional && !fields.has(names[i])) continue;
    values[static_cast<Eigen::Index>(i)] = fields.number(names[i]);
    if (i < 2 && !(fields.number(names[i]) > 0.0)) refuse(file.name, names[i], "is not above zero");
  }
  camera.lens = with_params(*lens, values);
  if (fields.has("rms_px")) {
    camera.rms_px = fields.number("rms_px");
    if (camera.rms_px < 0.0) refuse(file.name, "rms_px", "is below zero");
  }
  if (fields.has("source")) camera.source = fields.text("source");
  if (fields.has("covariance")) camera.cov = read_covariance(root["covariance"], fields, names, "the model");
  return camera;
}

std::string write_alidade(const Camera& camera) {
  const std::vector<std::string> names = param_names(camera.lens);
  const Eigen::VectorXd values = params(camera.lens);
  std::string text =
      fmt::format("model: {}\nwidth: {}\nheight: {}\n", model_name(camera.lens), camera.width_px, camera.height_px);
  for (std::size_t i = 0; i < names.size(); ++i) {
    if (is_of_normal(names[i])) continue;
    text += fmt::format("{}: {}\n", names[i], number_text(values[static_cast<Eigen::Index>(i)]));
  }
  if (const auto* port = std::get_if<Calibrated<FlatPort>>(&camera.lens)) {
    const Eigen::Vector3d normal = FlatPort::normal(port->params);
    text += fmt::format("normal: {}\n", number_list({normal.x(), normal.y(), normal.z()}));
  }
  if (camera.rms_px > 0.0) text += fmt::format("rms_px: {}\n", number_text(camera.rms_px));
  if (!camera.source.empty()) text += fmt::format("source: {}\n", quoted_text(camera.source));
  if (camera.cov.rows() != values.size() || camera.cov.cols() != values.size()) return text;
  text += fmt::format("covariance:  # upper triangle, row by row\n  names: [{}]\n  upper: [", fmt::join(names, ", "));
  for (Eigen::Index i = 0; i < camera.cov.rows(); ++i) {
    for (Eigen::Index j = i; j < camera.cov.cols(); ++j) {
      const bool is_last = i + 1 == camera.cov.rows();
      text += number_text(camera.cov(i, j)) + (is_last ? "]\n" : j + 1 < camera.cov.cols() ? ", " : ",\n          ");
    }
  }
  return text;
}

}  // namespace alidade::detail
