#include <fmt/format.h>

#include <cstdlib>
#include <map>
#include <sstream>

#include "alidade/formats/camera_formats.h"

namespace alidade::detail {
namespace {

/// What a model's parameters are, in order: f for both focal lengths, then names of ours.
struct ColmapModel {
  std::vector<std::string> names;
  bool is_fisheye = false;
};

const std::map<std::string, ColmapModel>& models() {
  static const std::map<std::string, ColmapModel> known{
      {"SIMPLE_PINHOLE", {{"f", "cx", "cy"}}},
      {"PINHOLE", {{"fx", "fy", "cx", "cy"}}},
      {"SIMPLE_RADIAL", {{"f", "cx", "cy", "k1"}}},
      {"RADIAL", {{"f", "cx", "cy", "k1", "k2"}}},
      {"OPENCV", {{"fx", "fy", "cx", "cy", "k1", "k2", "p1", "p2"}}},
      {"FULL_OPENCV", {{"fx", "fy", "cx", "cy", "k1", "k2", "p1", "p2", "k3", "k4", "k5", "k6"}}},
      {"OPENCV_FISHEYE", {{"fx", "fy", "cx", "cy", "k1", "k2", "k3", "k4"}, true}},
      {"SIMPLE_RADIAL_FISHEYE", {{"f", "cx", "cy", "k1"}, true}},
      {"RADIAL_FISHEYE", {{"f", "cx", "cy", "k1", "k2"}, true}}};
  return known;
}

/// COLMAP's pixel (0, 0) is the CORNER of the first pixel: its principal point is ours plus a half. The sum is made
/// with more digits than a double, so that it can be taken back exactly.
double centre_from_colmap(const std::string& text) {
  return static_cast<double>(std::strtold(text.c_str(), nullptr) - 0.5L);
}

std::string centre_for_colmap(double centre_px) {
  const std::string shortest = number_text(centre_px + 0.5);
  if (centre_from_colmap(shortest) == centre_px) return shortest;
  char digits[64];
  std::snprintf(digits, sizeof digits, "%.21Lg", static_cast<long double>(centre_px) + 0.5L);
  return digits;
}

/// One camera's line: id, model, width, height, parameters.
struct Line {
  std::size_t number = 0;
  std::vector<std::string> words;
};

std::vector<Line> lines_of(std::string_view text) {
  std::vector<Line> lines;
  std::istringstream stream{std::string(text)};
  std::string line;
  for (std::size_t number = 1; std::getline(stream, line); ++number) {
    for (char& c : line) c = c == ',' ? ' ' : c;
    std::istringstream words(line);
    Line out{number, {}};
    for (std::string word; words >> word;) out.words.push_back(word);
    if (!out.words.empty() && out.words.front().front() != '#') lines.push_back(out);
  }
  return lines;
}

Camera camera_of(const ColmapModel& model, const Line& line, const std::string& where) {
  std::vector<double> focal_centre(4, 0.0), k(model.is_fisheye ? 4 : 8, 0.0);
  static const std::map<std::string, std::size_t> of_brown{{"k1", 0}, {"k2", 1}, {"p1", 2}, {"p2", 3},
                                                           {"k3", 4}, {"k4", 5}, {"k5", 6}, {"k6", 7}};
  static const std::map<std::string, std::size_t> of_fisheye{{"k1", 0}, {"k2", 1}, {"k3", 2}, {"k4", 3}};
  for (std::size_t i = 0; i < model.names.size(); ++i) {
    const std::string &name = model.names[i], &word = line.words[4 + i];
    const double value = checked_number(word, where, name);
    if (name == "f") {
      focal_centre[0] = focal_centre[1] = value;
    } else if (name == "fx" || name == "fy") {
      focal_centre[name == "fx" ? 0 : 1] = value;
    } else if (name == "cx" || name == "cy") {
      focal_centre[name == "cx" ? 2 : 3] = centre_from_colmap(word);
    } else {
      k[(model.is_fisheye ? of_fisheye : of_brown).at(name)] = value;
    }
  }
  return model.is_fisheye ? fisheye_camera(focal_centre, k, where, "PARAMS")
                          : opencv_camera(focal_centre, k, where, "PARAMS");
}

}  // namespace

CameraContent read_colmap(const CameraText& file) {
  const std::vector<Line> lines = lines_of(file.text);
  std::vector<std::string> ids;
  for (const Line& line : lines) ids.push_back(line.words.front());
  const std::size_t chosen = chosen_camera(ids, file);
  const Line& line = lines[chosen];
  const std::string where = fmt::format("{}:{}", file.name, line.number);
  if (line.words.size() < 4) refuse(where, "", "is not CAMERA_ID MODEL WIDTH HEIGHT PARAMS…");
  const auto model = models().find(line.words[1]);
  if (model == models().end()) {
    std::vector<std::string> known;
    for (const auto& [name, unused] : models()) known.push_back(name);
    refuse(where, "MODEL",
           fmt::format("'{}' is no model of ours; known: {}", line.words[1].substr(0, 40), fmt::join(known, " ")));
  }
  if (line.words.size() != 4 + model->second.names.size()) {
    refuse(where, "PARAMS",
           fmt::format("{} numbers; {} has {}", line.words.size() - 4, model->first, model->second.names.size()));
  }
  Camera camera = camera_of(model->second, line, where);
  camera.width_px = checked_size(checked_number(line.words[2], where, "WIDTH"), where, "WIDTH");
  camera.height_px = checked_size(checked_number(line.words[3], where, "HEIGHT"), where, "HEIGHT");
  return {camera, place_among(ids, chosen)};
}

std::string write_colmap(const Camera& camera) {
  const std::vector<double> f = focal_and_centre(camera);
  std::vector<double> k = distortion(camera);
  std::string model = k.empty() ? "PINHOLE" : "OPENCV_FISHEYE";
  if (std::holds_alternative<Calibrated<Brown>>(camera.lens)) {
    const bool has_k3 = k[4] != 0.0;
    model = has_k3 ? "FULL_OPENCV" : "OPENCV";
    k.resize(has_k3 ? 8 : 4, 0.0);
  }
  std::string text = fmt::format("# CAMERA_ID, MODEL, WIDTH, HEIGHT, PARAMS[]\n1 {} {} {} {} {} {} {}", model,
                                 camera.width_px, camera.height_px, number_text(f[0]), number_text(f[1]),
                                 centre_for_colmap(f[2]), centre_for_colmap(f[3]));
  for (const double value : k) text.append(" ").append(number_text(value));
  return text + "\n";
}

}  // namespace alidade::detail
