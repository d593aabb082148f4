#include "alidade/formats/rig_file.h"

#include <fmt/format.h>
#include <yaml-cpp/yaml.h>

#include <algorithm>
#include <cmath>
#include <limits>
#include <numbers>

#include "alidade/files/yaml_fields.h"
#include "alidade/formats/camera_file.h"
#include "alidade/formats/intrinsics_file.h"
#include "alidade/pantilt/head_cameras.h"

namespace alidade {
namespace {

using detail::Fields;
using detail::number_list;
using detail::number_text;
using detail::refuse;
using detail::refuse_unknown_keys;

/// The lens that a rig was calibrated with, beside the name of its file: that may become another's.
std::string lens_numbers(const Camera& camera) {
  const Eigen::VectorXd values = params(camera.lens);
  return number_list({values.data(), values.data() + values.size()});
}

std::string vector_text(const Eigen::Vector3d& v) { return number_list({v.x(), v.y(), v.z()}); }

std::string quaternion_text(const Eigen::Quaterniond& rotation) {
  const double sign = rotation.w() < 0.0 ? -1.0 : 1.0;
  return number_list({sign * rotation.w(), sign * rotation.x(), sign * rotation.y(), sign * rotation.z()});
}

std::string indented(const std::string& text, const std::string& margin) {
  std::string out = margin;
  for (std::size_t i = 0; i < text.size(); ++i) {
    out += text[i];
    if (text[i] == '\n' && i + 1 < text.size()) out += margin;
  }
  return out;
}

std::string head_text(const RigHead& rig_head, const EncoderError& error, const std::string& camera_file) {
  const Head& head = rig_head.head;
  const Encoder& encoder = head.encoder;
  std::string text = fmt::format("  - id: {}\n", head.id);
  text += camera_file.empty()
              ? "    camera:\n" + indented(camera_text(rig_head.camera, CameraFormat::alidade), "      ")
              : fmt::format("    camera: {}\n    camera_values: {}\n", camera_file, lens_numbers(rig_head.camera));
  text += fmt::format("    world_from_base:\n      translation_m: {}\n      quaternion_wxyz: {}\n",
                      vector_text(head.world_from_base.translation), quaternion_text(head.world_from_base.rotation));
  text += fmt::format("    pan_to_tilt_m: {}\n    tilt_to_cam_m: {}\n", vector_text(head.pan_to_tilt_m),
                      vector_text(head.tilt_to_cam_m));
  text += fmt::format("    cam_from_tilt:\n      quaternion_wxyz: {}\n", quaternion_text(head.cam_from_tilt));
  if (head.axes_skew_rad != 0.0) text += fmt::format("    axes_skew_rad: {}\n", number_text(head.axes_skew_rad));
  text += fmt::format("    encoder:\n      pan_zero_rad: {}\n      tilt_zero_rad: {}\n",
                      number_text(encoder.pan_zero_rad), number_text(encoder.tilt_zero_rad));
  if (encoder.pan_scale != 1.0) text += fmt::format("      pan_scale: {}\n", number_text(encoder.pan_scale));
  if (encoder.tilt_scale != 1.0) text += fmt::format("      tilt_scale: {}\n", number_text(encoder.tilt_scale));
  for (const auto& [name, value] : {std::pair{"pan_cos_rad", encoder.pan_cos_rad},
                                    {"pan_sin_rad", encoder.pan_sin_rad},
                                    {"tilt_cos_rad", encoder.tilt_cos_rad},
                                    {"tilt_sin_rad", encoder.tilt_sin_rad}})
    if (value != 0.0) text += fmt::format("      {}: {}\n", name, number_text(value));
  if (error.sigma_zero_rad >= 0.0) text += fmt::format("      sigma_zero_rad: {}\n", number_text(error.sigma_zero_rad));
  if (error.sigma_scale >= 0.0) text += fmt::format("      sigma_scale: {}\n", number_text(error.sigma_scale));
  return text + fmt::format("      sigma_rad: {}\n", number_text(encoder.sigma_rad));
}

/// Names of all parameters of all heads, "head1.base_x_m", and behind them those of their lenses, "head1.camera.fx".
std::vector<std::string> covariance_names(const std::vector<RigHead>& heads) {
  std::vector<std::string> names;
  for (const RigHead& rig_head : heads)
    for (const char* name : head_param_names) names.push_back(fmt::format("head{}.{}", rig_head.head.id, name));
  for (const RigHead& rig_head : heads)
    for (const std::string& name : param_names(rig_head.camera.lens))
      names.push_back(fmt::format("head{}.camera.{}", rig_head.head.id, name));
  return names;
}

/// A fixed parameter has zero rows, and is not written.
std::string covariance_text(const Rig& rig) {
  if (rig.cov.isZero(0.0)) return "covariance: exact\n";
  const std::vector<std::string> names = covariance_names(rig.heads);
  const Eigen::MatrixXd& cov = rig.cov_with_lenses.size() > 0 ? rig.cov_with_lenses : rig.cov;
  std::vector<std::string> free_names;
  std::vector<Eigen::Index> free;
  for (Eigen::Index i = 0; i < cov.rows(); ++i) {
    if (!(cov(i, i) > 0.0)) continue;
    free.push_back(i);
    free_names.push_back(names[static_cast<std::size_t>(i)]);
  }
  std::vector<double> upper;
  for (std::size_t i = 0; i < free.size(); ++i)
    for (std::size_t j = i; j < free.size(); ++j) upper.push_back(cov(free[i], free[j]));
  return fmt::format(
      "covariance:  # upper triangle, row by row; base and cam: small motions on the right\n"
      "  names: [{}]\n  upper: {}\n",
      fmt::join(free_names, ", "), number_list(upper));
}

/// Three numbers, zero where they are omitted.
Eigen::Vector3d vector_of(const Fields& fields, const std::string& key) {
  return fields.has(key) ? detail::read_vector(fields, key) : Eigen::Vector3d::Zero();
}

Eigen::Quaterniond quaternion_of(const Fields& fields) {
  if (!fields.has("quaternion_wxyz")) return Eigen::Quaterniond::Identity();
  const std::vector<double> q = fields.numbers("quaternion_wxyz");
  const std::string key = fields.full("quaternion_wxyz");
  if (q.size() != 4) refuse(fields.file(), key, "must be four numbers: w, x, y, z");
  const Eigen::Quaterniond rotation(q[0], q[1], q[2], q[3]);
  if (!(std::abs(rotation.norm() - 1.0) < 1e-3))
    refuse(fields.file(), key, fmt::format("has the length {:.6g}, not 1", rotation.norm()));
  return rotation.normalized();
}

double angle_of(const Fields& fields, const std::string& key) {
  if (!fields.has(key)) return 0.0;
  const double angle = fields.number(key);
  if (!(std::abs(angle) <= 2.0 * std::numbers::pi))
    refuse(fields.file(), fields.full(key), fmt::format("{:.6g} is more than a turn; angles are radians", angle));
  return angle;
}

double scale_of(const Fields& fields, const std::string& key) {
  if (!fields.has(key)) return 1.0;
  const double scale = fields.number(key);
  // A degree, or a servo's microsecond, for a radian is another unit, not a scale.
  if (!(std::abs(scale) > 0.1 && std::abs(scale) < 10.0))
    refuse(fields.file(), fields.full(key), fmt::format("{:.6g} is not between 0.1 and 10 in size", scale));
  return scale;
}

/// The amplitude of an error of one period per turn; a third of a radian is no eccentric disc.
double amplitude_of(const Fields& fields, const std::string& key) {
  if (!fields.has(key)) return 0.0;
  const double amplitude = fields.number(key);
  if (!(std::abs(amplitude) < 0.3))
    refuse(fields.file(), fields.full(key), fmt::format("{:.6g} is not below 0.3 in size", amplitude));
  return amplitude;
}

/// A σ that may be omitted: NaN.
double sigma_of(const Fields& fields, const std::string& key) {
  if (!fields.has(key)) return std::numeric_limits<double>::quiet_NaN();
  const double sigma = fields.number(key);
  if (!(sigma >= 0.0)) refuse(fields.file(), fields.full(key), "is below zero");
  return sigma;
}

EncoderError encoder_error_of(const YAML::Node& head, const std::string& file, std::size_t index) {
  const YAML::Node node = head["encoder"];
  if (!node.IsDefined()) return {};
  const Fields fields(node, file, fmt::format("heads[{}].encoder.", index));
  return {sigma_of(fields, "sigma_zero_rad"), sigma_of(fields, "sigma_scale")};
}

Encoder encoder_of(const YAML::Node& node, const Fields& parent) {
  const Fields fields(node, parent.file(), parent.full("encoder."));
  refuse_unknown_keys(fields,
                      {"pan_zero_rad", "tilt_zero_rad", "pan_scale", "tilt_scale", "pan_cos_rad", "pan_sin_rad",
                       "tilt_cos_rad", "tilt_sin_rad", "sigma_rad", "sigma_zero_rad", "sigma_scale"},
                      "an encoder");
  Encoder encoder;
  encoder.pan_zero_rad = angle_of(fields, "pan_zero_rad");
  encoder.tilt_zero_rad = angle_of(fields, "tilt_zero_rad");
  encoder.pan_scale = scale_of(fields, "pan_scale");
  encoder.tilt_scale = scale_of(fields, "tilt_scale");
  encoder.pan_cos_rad = amplitude_of(fields, "pan_cos_rad");
  encoder.pan_sin_rad = amplitude_of(fields, "pan_sin_rad");
  encoder.tilt_cos_rad = amplitude_of(fields, "tilt_cos_rad");
  encoder.tilt_sin_rad = amplitude_of(fields, "tilt_sin_rad");
  encoder.sigma_rad = angle_of(fields, "sigma_rad");
  if (encoder.sigma_rad < 0.0) refuse(fields.file(), fields.full("sigma_rad"), "is below zero");
  return encoder;
}

Camera camera_of(const YAML::Node& node, const Fields& fields, const std::filesystem::path& file) {
  if (!node["camera"].IsDefined()) refuse(fields.file(), fields.full("camera"), "is missing");
  if (node["camera"].IsMap()) {
    YAML::Emitter text;
    text << node["camera"];
    const std::string name = fields.file() + ": " + fields.full("camera");
    const Camera camera = parse_camera(text.c_str(), name);
    require_central(camera, name);
    return camera;
  }
  return read_central_camera(file.parent_path() / fields.text("camera"));
}

RigHead head_of(const YAML::Node& node, std::size_t index, const std::filesystem::path& file) {
  const Fields fields(node, file.string(), fmt::format("heads[{}].", index));
  refuse_unknown_keys(fields,
                      {"id", "camera", "camera_values", "world_from_base", "pan_to_tilt_m", "tilt_to_cam_m",
                       "cam_from_tilt", "axes_skew_rad", "encoder", "intrinsics"},
                      "a head");
  RigHead read;
  Head& head = read.head;
  const double id = fields.has("id") ? fields.number("id") : static_cast<double>(index + 1);
  if (!(id >= 0.0 && id <= 1e6) || id != std::floor(id))
    refuse(fields.file(), fields.full("id"), fmt::format("{} is not a whole number from 0 to 1000000", id));
  head.id = static_cast<int>(id);
  read.camera = camera_of(node, fields, file);
  if (fields.has("world_from_base")) {
    const YAML::Node base = node["world_from_base"];
    const Fields pose(base, fields.file(), fields.full("world_from_base."));
    refuse_unknown_keys(pose, {"translation_m", "quaternion_wxyz"}, "a pose");
    head.world_from_base = {quaternion_of(pose), vector_of(pose, "translation_m")};
  }
  head.pan_to_tilt_m = vector_of(fields, "pan_to_tilt_m");
  head.tilt_to_cam_m = vector_of(fields, "tilt_to_cam_m");
  if (fields.has("cam_from_tilt")) {
    const YAML::Node mounting = node["cam_from_tilt"];
    const Fields rotation(mounting, fields.file(), fields.full("cam_from_tilt."));
    refuse_unknown_keys(rotation, {"quaternion_wxyz"}, "a rotation");
    head.cam_from_tilt = quaternion_of(rotation);
  }
  head.axes_skew_rad = angle_of(fields, "axes_skew_rad");
  if (fields.has("encoder")) head.encoder = encoder_of(node["encoder"], fields);
  return read;
}

/// `intrinsics`, a file of them over time, where a head's camera zooms.
void read_intrinsics_history_of(const YAML::Node& node, std::size_t index, const std::filesystem::path& file,
                                Rig& rig) {
  const Fields fields(node, file.string(), fmt::format("heads[{}].", index));
  if (!fields.has("intrinsics")) return;
  rig.intrinsics_histories.resize(index + 1);
  rig.intrinsics_histories[index] = read_intrinsics_history(file.parent_path() / fields.text("intrinsics"));
}

/// What a rig's covariance is: of the heads, or of heads and lenses where it names one of these.
void read_rig_covariance(const YAML::Node& node, const Fields& fields, Rig& rig) {
  const auto num = static_cast<Eigen::Index>(rig.heads.size()) * num_head_params;
  if (node.IsScalar() && node.as<std::string>() == "exact") {
    rig.cov.setZero(num, num);
    return;
  }
  const Eigen::MatrixXd all = detail::read_covariance(node, fields, covariance_names(rig.heads), "these heads");
  rig.cov = all.topLeftCorner(num, num);
  if (!all.bottomRows(all.rows() - num).isZero(0.0)) rig.cov_with_lenses = all;
}

/// How a camera's file differs from the lens that the rig was calibrated with; empty where it is that.
std::string lens_change(const Camera& camera, const std::vector<double>& calibrated) {
  constexpr double as_written = 1e-6;
  const std::vector<std::string> names = param_names(camera.lens);
  const Eigen::VectorXd values = params(camera.lens);
  if (static_cast<std::size_t>(values.size()) != calibrated.size())
    return " is of another lens model than the one that the rig was calibrated with";
  std::size_t most = 0;
  double largest = 0.0;
  for (std::size_t k = 0; k < calibrated.size(); ++k) {
    const double off =
        std::abs(values[static_cast<Eigen::Index>(k)] - calibrated[k]) / (1e-3 + std::abs(calibrated[k]));
    if (off > largest) largest = off, most = k;
  }
  if (!(largest > as_written)) return "";
  return fmt::format(" has {} {:.7g}, but the rig was calibrated with {:.7g}", names[most],
                     values[static_cast<Eigen::Index>(most)], calibrated[most]);
}

/// `camera_values`: the lens that the rig was calibrated with, beside the name of its file.
void note_changed_camera(const YAML::Node& node, std::size_t index, const std::filesystem::path& file, Rig& rig) {
  const Fields fields(node, file.string(), fmt::format("heads[{}].", index));
  if (!fields.has("camera_values") || !node["camera"].IsScalar()) return;
  const std::string change = lens_change(rig.heads[index].camera, fields.numbers("camera_values"));
  if (!change.empty()) rig.doubts.push_back(fmt::format("{}: {}{}", file.string(), fields.text("camera"), change));
}

}  // namespace

std::string rig_text(const Rig& rig, std::span<const std::string> camera_files) {
  std::string text =
      "# Pan-tilt heads; angle = scale * (reading + cos, sin errors - zero), pan > 0 left, tilt > 0 up\nheads:\n";
  for (std::size_t i = 0; i < rig.heads.size(); ++i)
    text += head_text(rig.heads[i], i < rig.encoder_errors.size() ? rig.encoder_errors[i] : EncoderError{},
                      i < camera_files.size() ? camera_files[i] : "");
  return rig.cov.size() > 0 ? text + covariance_text(rig) : text;
}

Rig read_rig(const std::filesystem::path& file) {
  const YAML::Node root = detail::load_yaml(read_file(file), file.string());
  const Fields fields(root, file.string());
  refuse_unknown_keys(
      fields, {"heads", "covariance", detail::verdict_keys[0], detail::verdict_keys[1], detail::verdict_keys[2]},
      "a rig");
  const YAML::Node heads = root["heads"];
  if (!heads.IsDefined() || !heads.IsSequence() || heads.size() == 0)
    refuse(file.string(), "heads", "must be a list of at least one head");
  Rig rig;
  for (std::size_t i = 0; i < heads.size(); ++i) {
    const YAML::Node node = heads[i];
    rig.heads.push_back(head_of(node, i, file));
    rig.encoder_errors.push_back(encoder_error_of(node, file.string(), i));
    read_intrinsics_history_of(node, i, file, rig);
    note_changed_camera(node, i, file, rig);
    for (std::size_t k = 0; k < i; ++k) {
      if (rig.heads[k].head.id == rig.heads[i].head.id)
        refuse(file.string(), fmt::format("heads[{}].id", i), fmt::format("{} appears twice", rig.heads[i].head.id));
    }
  }
  if (fields.has("covariance")) read_rig_covariance(root["covariance"], fields, rig);
  return rig;
}

std::vector<std::filesystem::path> camera_files_of_rig(const std::filesystem::path& file) {
  const YAML::Node heads = detail::load_yaml(read_file(file), file.string())["heads"];
  std::vector<std::filesystem::path> files;
  for (std::size_t i = 0; heads.IsDefined() && heads.IsSequence() && i < heads.size(); ++i) {
    const YAML::Node camera = heads[i].IsMap() ? heads[i]["camera"] : YAML::Node();
    if (camera.IsDefined() && camera.IsScalar()) files.push_back(file.parent_path() / camera.as<std::string>());
  }
  return files;
}

std::map<int, Camera> read_cameras_by_head(const std::vector<std::filesystem::path>& files, const std::vector<int>& ids,
                                           const std::filesystem::path& table) {
  const std::string fault = camera_count_fault(ids, files.size());
  if (!fault.empty()) throw InputError(table.string() + ": " + fault);
  std::vector<Camera> cameras;
  for (const std::filesystem::path& file : files) cameras.push_back(read_central_camera(file));
  return cameras_by_head(ids, cameras);
}

}  // namespace alidade
