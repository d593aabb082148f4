#include "alidade/formats/camera_file.h"

#include <fmt/format.h>
#include <yaml-cpp/yaml.h>

#include <algorithm>
#include <array>
#include <cctype>

#include "alidade/formats/camera_formats.h"

namespace alidade {
namespace {

constexpr std::array<std::pair<CameraFormat, std::string_view>, 6> format_names{{{CameraFormat::alidade, "alidade"},
                                                                                 {CameraFormat::opencv, "opencv"},
                                                                                 {CameraFormat::ros, "ros"},
                                                                                 {CameraFormat::kalibr, "kalibr"},
                                                                                 {CameraFormat::mrcal, "mrcal"},
                                                                                 {CameraFormat::colmap, "colmap"}}};

constexpr const char* unknown_file =
    "is not a camera file of alidade, OpenCV, ROS, Kalibr, mrcal, COLMAP, SceneLib, Civera, Heikkilä or Bouguet";

std::string_view trimmed(std::string_view text) {
  const auto is_space = [](char c) { return std::isspace(static_cast<unsigned char>(c)) != 0; };
  while (!text.empty() && is_space(text.front())) text.remove_prefix(1);
  while (!text.empty() && is_space(text.back())) text.remove_suffix(1);
  return text;
}

/// The first line that is neither empty nor a comment, and everything after it.
std::string_view without_comments(std::string_view text) {
  text = trimmed(text);
  while (text.starts_with('#')) {
    const std::size_t end = text.find('\n');
    text = end == std::string_view::npos ? std::string_view() : trimmed(text.substr(end));
  }
  return text;
}

/// True of "1 PINHOLE 640 480 …": a number, then a word in capitals.
bool is_colmap_line(std::string_view text) {
  std::size_t i = 0;
  while (i < text.size() && std::isdigit(static_cast<unsigned char>(text[i]))) ++i;
  const std::size_t num_digits = i;
  while (i < text.size() && (text[i] == ' ' || text[i] == '\t' || text[i] == ',')) ++i;
  const std::size_t word = i;
  while (i < text.size() && (std::isupper(static_cast<unsigned char>(text[i])) || text[i] == '_')) ++i;
  return num_digits > 0 && word > num_digits && i - word >= 3;
}

bool has_cameras_of_kalibr(const YAML::Node& root) {
  for (const auto& entry : root) {
    if (entry.second.IsMap() && entry.second["camera_model"].IsDefined()) return true;
  }
  return false;
}

detail::CameraContent read_yaml(const detail::CameraText& file) {
  std::string text(file.text);
  if (text.starts_with("%YAML")) {  // OpenCV writes "%YAML:1.0", which is not a directive of YAML
    const std::size_t end = text.find('\n');
    text.erase(0, end == std::string::npos ? text.size() : end);
  }
  const YAML::Node root = detail::load_yaml(text, file.name);
  if (!root.IsMap()) detail::refuse(file.name, "", unknown_file);
  const YAML::Node& map = root;
  const auto has = [&](const char* key) { return map[key].IsDefined(); };
  if (has_cameras_of_kalibr(root)) return detail::read_kalibr(root, file);
  if (has("distortion_model")) return detail::read_ros(root, file);
  if (has("camera_matrix") || has("cameraMatrix") || has("distortion_coefficients") || (has("K") && has("D")) ||
      (has("M1") && has("D1")))
    return detail::read_opencv(root, file);
  if (has("model") || has("fx")) return {detail::read_alidade(root, file), {}};
  detail::refuse(file.name, "", unknown_file);
}

detail::CameraContent recognise_and_read(const detail::CameraText& file) {
  const std::string_view content = without_comments(file.text);
  if (content.empty()) detail::refuse(file.name, "", "is empty");
  if (content.starts_with("MATLAB 5.0"))
    detail::refuse(file.name, "",
                   "is a MAT-file, which is not read; Calib_Results.m, which the toolbox saves with it, is");
  if (file.text.find('\0') != std::string_view::npos)
    detail::refuse(file.name, "", "is not text; " + std::string(unknown_file));
  if (content.starts_with("<?xml")) return detail::read_opencv_xml(file);
  if (content.starts_with('{') && content.find("lensmodel") != std::string_view::npos) return detail::read_mrcal(file);
  if (content.starts_with("CAHV") || content.starts_with("Model = CAHV")) {
    detail::refuse(file.name, "", "a CAHVOR camera: no model of ours (pinhole, brown, kannala_brandt)");
  }
  constexpr std::size_t max_slam_bytes = 1u << 20;
  if (file.text.size() < max_slam_bytes && detail::is_slam_camera(file.text)) return detail::read_slam_camera(file);
  if (is_colmap_line(content)) return detail::read_colmap(file);
  return read_yaml(file);
}

detail::CameraContent parse_content(std::string_view text, const std::string& name, const std::string& choice) {
  constexpr std::size_t max_bytes = 64u << 20;  // a .cameramodel may carry all corners of its calibration
  if (text.size() > max_bytes) detail::refuse(name, "", "is larger than 64 MiB: no camera file");
  try {
    return recognise_and_read({text, name, choice});
  } catch (const YAML::Exception& error) {
    throw InputError(fmt::format("{}: is not a camera file: {}", name, error.msg));
  }
}

detail::CameraContent read_content(const std::filesystem::path& named) {
  const std::string name = named.string(), file = file_of_camera(named).string();
  return parse_content(read_file(file), file, name.size() > file.size() ? name.substr(file.size() + 1) : "");
}

}  // namespace

Camera parse_camera(std::string_view text, const std::string& name, const std::string& choice) {
  return parse_content(text, name, choice).camera;
}

Camera read_camera(const std::filesystem::path& file) { return read_content(file).camera; }

std::vector<std::string> unread_parts(const std::filesystem::path& file) { return read_content(file).unread; }

std::string lens_doubt(const std::filesystem::path& file) { return read_content(file).doubt; }

std::filesystem::path file_of_camera(const std::filesystem::path& named) {
  const std::string name = named.string();
  std::error_code ignored;
  if (std::filesystem::exists(named, ignored)) return named;
  for (std::size_t colon = name.rfind(':'); colon != std::string::npos && colon > 0; colon = name.rfind(':', colon - 1))
    if (std::filesystem::exists(name.substr(0, colon), ignored)) return name.substr(0, colon);
  return named;
}

Camera read_central_camera(const std::filesystem::path& file) {
  const Camera camera = read_camera(file);
  require_central(camera, file.string());
  return camera;
}

void require_central(const Camera& camera, const std::string& name) {
  if (is_central(camera.lens)) return;
  throw InputError(
      fmt::format("{}: model: a {} camera has no single viewpoint, which this command needs; give a central "
                  "lens (pinhole, brown, kannala_brandt), calibrated in the same water",
                  name, model_name(camera.lens)));
}

std::vector<std::string> lens_losses(const Camera& camera, CameraFormat format) {
  if (format == CameraFormat::alidade) return {};
  const Eigen::VectorXd values = params(camera.lens);
  std::vector<std::string> losses;
  if (values[4] != 0.0) losses.push_back(fmt::format("skew {} px", values[4]));
  const auto* brown = std::get_if<Calibrated<Brown>>(&camera.lens);
  if (format == CameraFormat::kalibr && brown && brown->params[9] != 0.0) {
    losses.push_back(fmt::format("k3 {}", brown->params[9]));
  }
  return losses;
}

std::vector<std::string> other_losses(const Camera& camera, CameraFormat format) {
  if (format == CameraFormat::alidade) return {};
  std::vector<std::string> losses;
  if (camera.cov.size() > 0) losses.emplace_back("the covariance");
  if (camera.rms_px > 0.0 && format != CameraFormat::opencv) losses.emplace_back("the RMS of the calibration");
  if (!camera.source.empty()) losses.emplace_back("where it came from");
  return losses;
}

std::string camera_text(const Camera& camera, CameraFormat format, bool lossy) {
  if (format != CameraFormat::alidade && std::holds_alternative<Calibrated<FlatPort>>(camera.lens)) {
    throw InputError(
        fmt::format("{} has no lens like flat_port; nothing was written (calibrate in water with --model "
                    "brown for a lens that it has)",
                    camera_format_name(format)));
  }
  if (format == CameraFormat::mrcal && std::holds_alternative<Calibrated<KannalaBrandt>>(camera.lens)) {
    throw InputError("mrcal has no lens like kannala_brandt; nothing was written");
  }
  const std::vector<std::string> losses = lens_losses(camera, format);
  if (!losses.empty() && !lossy) {
    throw InputError(fmt::format("the format {} cannot hold {}; --lossy writes the nearest without",
                                 camera_format_name(format), fmt::join(losses, " and ")));
  }
  const Camera kept = fitted_lens(camera, format).camera;
  switch (format) {
    case CameraFormat::alidade:
      return detail::write_alidade(kept);
    case CameraFormat::opencv:
      return detail::write_opencv(kept);
    case CameraFormat::ros:
      return detail::write_ros(kept);
    case CameraFormat::kalibr:
      return detail::write_kalibr(kept);
    case CameraFormat::mrcal:
      return detail::write_mrcal(kept);
    case CameraFormat::colmap:
      return detail::write_colmap(kept);
  }
  throw std::logic_error("unknown camera format");
}

CameraFormat camera_format(std::string_view name) {
  std::vector<std::string_view> known;
  for (const auto& [format, format_name] : format_names) {
    if (name == format_name) return format;
    known.push_back(format_name);
  }
  throw InputError(fmt::format("'{}' is no camera format; known: {}", name, fmt::join(known, ", ")));
}

std::string_view camera_format_name(CameraFormat format) {
  for (const auto& [known, name] : format_names) {
    if (known == format) return name;
  }
  return "?";
}

void write_camera(const std::filesystem::path& file, const Camera& camera, CameraFormat format, bool lossy) {
  write_file(file, camera_text(camera, format, lossy));
}

}  // namespace alidade
