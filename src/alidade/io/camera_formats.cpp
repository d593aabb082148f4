#include "alidade/io/camera_formats.h"

#include <fmt/format.h>
#include <yaml-cpp/yaml.h>

#include <algorithm>
#include <charconv>
#include <cmath>
#include <set>

namespace alidade::detail {

void refuse(const std::string& file, const std::string& key, const std::string& what) {
  throw InputError(key.empty() ? file + ": " + what : file + ": " + key + ": " + what);
}

double checked_number(std::string_view text, const std::string& file, const std::string& key) {
  std::string_view digits = text;
  if (digits.starts_with('+')) digits.remove_prefix(1);
  double value = 0.0;
  const auto [end, error] = std::from_chars(digits.data(), digits.data() + digits.size(), value);
  const bool is_number = error == std::errc{} && end == digits.data() + digits.size() && std::isfinite(value);
  if (!is_number) refuse(file, key, fmt::format("'{}' is not a finite number", text.substr(0, 40)));
  if (!(std::abs(value) <= 1e12)) refuse(file, key, fmt::format("{} is beyond 1e12", text.substr(0, 40)));
  return value;
}

int checked_size(double value, const std::string& file, const std::string& key) {
  if (!(value >= 1.0 && value <= 1e6) || value != std::floor(value)) {
    refuse(file, key, fmt::format("{} is not a picture's size in pixels (1 to 1000000)", value));
  }
  return static_cast<int>(value);
}

std::size_t chosen_camera(const std::vector<std::string>& names, const CameraText& file) {
  const std::string all = fmt::format("{}", fmt::join(names, ", "));
  if (names.empty()) refuse(file.name, "", "holds no camera");
  if (file.choice.empty()) {
    if (names.size() == 1) return 0;
    refuse(file.name, "",
           fmt::format("holds {} cameras ({}); choose one: {}:{}", names.size(), all, file.name, names[0]));
  }
  const auto found = std::find(names.begin(), names.end(), file.choice);
  if (found == names.end()) refuse(file.name, "", fmt::format("has no camera '{}'; it has {}", file.choice, all));
  return static_cast<std::size_t>(found - names.begin());
}

std::string number_text(double value) {
  std::string text = fmt::format("{}", value);
  if (text.find_first_of(".en") == std::string::npos) text += ".0";
  return text;
}

std::string number_list(const std::vector<double>& values) {
  std::vector<std::string> texts;
  for (const double value : values) texts.push_back(number_text(value));
  return fmt::format("[{}]", fmt::join(texts, ", "));
}

std::vector<double> focal_and_centre(const Camera& camera) {
  const Eigen::VectorXd values = params(camera.lens);
  return {values[0], values[1], values[2], values[3]};
}

std::vector<double> distortion(const Camera& camera) {
  const Eigen::VectorXd values = params(camera.lens);
  return {values.data() + 5, values.data() + values.size()};
}

namespace {

void require_focal_lengths(const std::vector<double>& focal_centre, const std::string& file) {
  const char* names[] = {"fx", "fy"};
  for (std::size_t i = 0; i < 2; ++i) {
    if (!(focal_centre[i] > 0.0)) refuse(file, names[i], fmt::format("{} is not above zero", focal_centre[i]));
  }
}

}  // namespace

Camera opencv_camera(const std::vector<double>& focal_centre, const std::vector<double>& coefficients,
                     const std::string& file, const std::string& key) {
  static const char* const names[] = {"k1", "k2", "p1", "p2", "k3", "k4",    "k5",
                                      "k6", "s1", "s2", "s3", "s4", "tau_x", "tau_y"};
  require_focal_lengths(focal_centre, file);
  const std::size_t count = coefficients.size();
  if (count != 0 && count != 4 && count != 5 && count != 8 && count != 12 && count != 14) {
    refuse(file, key, fmt::format("{} coefficients; OpenCV has 4, 5, 8, 12 or 14", count));
  }
  for (std::size_t i = 5; i < count; ++i) {
    if (coefficients[i] == 0.0) continue;
    const char* kind = i < 8 ? "a rational lens" : i < 12 ? "a thin prism" : "a tilted sensor";
    refuse(file, key,
           fmt::format("{} is {}: {} is no model of ours (pinhole, brown, kannala_brandt)", names[i], coefficients[i],
                       kind));
  }
  Camera camera;
  const bool is_pinhole = std::all_of(coefficients.begin(), coefficients.end(), [](double k) { return k == 0.0; });
  if (is_pinhole) {
    camera.lens = Calibrated<Pinhole>{{focal_centre[0], focal_centre[1], focal_centre[2], focal_centre[3], 0.0}};
    return camera;
  }
  Calibrated<Brown> lens;
  for (int i = 0; i < 4; ++i) lens.params[i] = focal_centre[static_cast<std::size_t>(i)];
  for (std::size_t i = 0; i < std::min<std::size_t>(count, 5); ++i)
    lens.params[5 + static_cast<int>(i)] = coefficients[i];
  camera.lens = lens;
  return camera;
}

Camera fisheye_camera(const std::vector<double>& focal_centre, const std::vector<double>& coefficients,
                      const std::string& file, const std::string& key) {
  require_focal_lengths(focal_centre, file);
  if (coefficients.size() != 4) refuse(file, key, fmt::format("{} coefficients; a fisheye has 4", coefficients.size()));
  Calibrated<KannalaBrandt> lens;
  for (int i = 0; i < 4; ++i) lens.params[i] = focal_centre[static_cast<std::size_t>(i)];
  for (int i = 0; i < 4; ++i) lens.params[5 + i] = coefficients[static_cast<std::size_t>(i)];
  Camera camera;
  camera.lens = lens;
  return camera;
}

Fields::Fields(const YAML::Node& map, std::string file, std::string prefix)
    : map_(map), file_(std::move(file)), prefix_(std::move(prefix)) {
  if (!map_.IsMap())
    refuse(file_, prefix_.empty() ? "" : prefix_.substr(0, prefix_.size() - 1), "is not a table of keys");
  std::set<std::string> seen;
  for (const std::string& key : keys()) {
    if (!seen.insert(key).second) refuse(file_, full(key), "stands twice");
  }
}

std::vector<std::string> Fields::keys() const {
  std::vector<std::string> names;
  for (const auto& entry : map_) {
    if (!entry.first.IsScalar()) refuse(file_, prefix_, "has a key that is not a word");
    names.push_back(entry.first.Scalar());
  }
  return names;
}

bool Fields::has(const std::string& key) const { return map_[key].IsDefined() && !map_[key].IsNull(); }

YAML::Node Fields::at(const std::string& key) const {
  const YAML::Node node = map_[key];
  if (!node.IsDefined() || node.IsNull()) refuse(file_, full(key), "is missing");
  return node;
}

double Fields::number(const std::string& key) const { return checked_number(text(key), file_, full(key)); }

int Fields::size(const std::string& key) const { return checked_size(number(key), file_, full(key)); }

std::string Fields::text(const std::string& key) const {
  const YAML::Node node = at(key);
  if (!node.IsScalar()) refuse(file_, full(key), "is not a single value");
  return node.Scalar();
}

std::vector<std::string> Fields::texts(const std::string& key) const {
  const YAML::Node node = at(key);
  if (!node.IsSequence()) refuse(file_, full(key), "is not a list");
  if (node.size() > 10000) refuse(file_, full(key), "has more than 10000 entries");
  std::vector<std::string> entries;
  for (const auto& entry : node) {
    if (!entry.IsScalar()) refuse(file_, full(key), "has an entry that is not a single value");
    entries.push_back(entry.Scalar());
  }
  return entries;
}

std::vector<double> Fields::numbers(const std::string& key) const {
  std::vector<double> values;
  for (const std::string& entry : texts(key)) values.push_back(checked_number(entry, file_, full(key)));
  return values;
}

std::vector<double> Fields::matrix(const std::string& key) const {
  const YAML::Node node = at(key);
  if (node.IsSequence()) return numbers(key);
  const Fields entries(node, file_, full(key) + ".");
  std::vector<double> data = entries.numbers("data");
  const double rows = entries.number("rows"), cols = entries.number("cols");
  if (rows * cols != static_cast<double>(data.size())) {
    refuse(file_, full(key), fmt::format("{} numbers are not {} rows of {}", data.size(), rows, cols));
  }
  return data;
}

}  // namespace alidade::detail
