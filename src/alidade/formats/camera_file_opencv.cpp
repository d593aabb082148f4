#include <fmt/format.h>
#include <yaml-cpp/yaml.h>

#include <algorithm>
#include <cmath>
#include <opencv2/core.hpp>

#include "alidade/formats/camera_formats.h"

namespace alidade::detail {
namespace {

/// fx, fy, cx, cy of a 3×3 camera matrix. OpenCV's functions do not read the entry of the skew: a value there is
/// refused.
std::vector<double> from_camera_matrix(const std::vector<double>& K, const std::string& file, const std::string& key) {
  if (K.size() != 9) refuse(file, key, fmt::format("{} numbers are not a 3×3 matrix", K.size()));
  if (K[1] != 0.0) {
    refuse(file, key, fmt::format("a skew of {} px, which OpenCV and ROS ignore; set it to 0", K[1]));
  }
  if (K[3] != 0.0 || K[6] != 0.0 || K[7] != 0.0 || K[8] != 1.0)
    refuse(file, key, "is not a camera matrix [fx 0 cx; 0 fy cy; 0 0 1]");
  return {K[0], K[4], K[2], K[5]};
}

std::string camera_matrix_list(const Camera& camera) {
  const std::vector<double> f = focal_and_centre(camera);
  return number_list({f[0], 0.0, f[2], 0.0, f[1], f[3], 0.0, 0.0, 1.0});
}

/// Five coefficients for a pinhole or a brown lens, four for a fisheye.
std::vector<double> coefficients(const Camera& camera) {
  return std::holds_alternative<Calibrated<Pinhole>>(camera.lens) ? std::vector<double>(5, 0.0) : distortion(camera);
}

bool is_fisheye(const Camera& camera) { return std::holds_alternative<Calibrated<KannalaBrandt>>(camera.lens); }

std::string first_of(const Fields& fields, std::initializer_list<const char*> keys) {
  for (const char* key : keys) {
    if (fields.has(key)) return key;
  }
  return *keys.begin();
}

/// The numbers of a list, or of {rows, cols, data}, not used in computations: NaN for a non-number.
std::vector<double> loose_numbers(const YAML::Node& node) {
  std::vector<double> values;
  const YAML::Node data = node.IsMap() ? node["data"] : node;
  if (!data.IsDefined() || !data.IsSequence()) return values;
  for (const auto& entry : data) values.push_back(entry.as<double>(std::nan("")));
  return values;
}

/// What ROS says of a camera's position in a stereo pair. Message and file differ in the names, as for the rest.
std::vector<std::string> place_in_pair(const YAML::Node& root, const Fields& fields) {
  std::vector<std::string> unread;
  const std::vector<double> straight{1.0, 0.0, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0, 1.0};
  const std::string rotation = first_of(fields, {"rectification_matrix", "R", "r"});
  if (fields.has(rotation) && loose_numbers(root[rotation]) != straight)
    unread.emplace_back("the rectification matrix R");
  const std::string projection = first_of(fields, {"projection_matrix", "P", "p"});
  const std::vector<double> P = fields.has(projection) ? loose_numbers(root[projection]) : std::vector<double>();
  if (P.size() == 12 && (P[3] != 0.0 || P[7] != 0.0)) unread.emplace_back("the baseline in the projection matrix P");
  return unread;
}

/// The number of a scalar that a ROS message may have; `otherwise` where it has none.
double loose_number(const YAML::Node& map, const char* key, double otherwise) {
  const YAML::Node value = map.IsMap() ? map[key] : YAML::Node();
  return value.IsDefined() && value.IsScalar() ? value.as<double>(otherwise) : otherwise;
}

/// A CameraInfo message has the lens of the whole image at full resolution, whatever images come with it. Binning of 0
/// means 1, a region without a size the whole image.
std::vector<std::string> other_images(const YAML::Node& root, const Camera& camera) {
  std::vector<std::string> unread;
  const double binning_x = loose_number(root, "binning_x", 0.0), binning_y = loose_number(root, "binning_y", 0.0);
  if (binning_x > 1.0 || binning_y > 1.0) unread.emplace_back("the binning (the lens is that of full resolution)");
  const YAML::Node roi = root["roi"];
  if (!roi.IsDefined() || !roi.IsMap()) return unread;
  const double width = loose_number(roi, "width", 0.0), height = loose_number(roi, "height", 0.0);
  const bool is_moved = loose_number(roi, "x_offset", 0.0) != 0.0 || loose_number(roi, "y_offset", 0.0) != 0.0;
  const bool is_smaller = (width != 0.0 && width != camera.width_px) || (height != 0.0 && height != camera.height_px);
  if (is_moved || is_smaller) unread.emplace_back("the region of interest roi (the lens is that of the whole image)");
  return unread;
}

void require_no_choice(const CameraText& file) {
  if (!file.choice.empty()) refuse(file.name, "", "holds one camera without a name; leave ':" + file.choice + "' out");
}

/// Four coefficients are k1 k2 p1 p2 of cv::calibrateCamera or k1…k4 of cv::fisheye; only OpenCV's own sample says
/// which (`fisheye_model`). Where nothing does, and no choice, they are read as the former, and `doubt` says so.
bool is_fisheye_file(const Fields& fields, const std::vector<double>& k, const std::string& key, const CameraText& file,
                     std::string& doubt) {
  const bool says = fields.has("fisheye_model");
  const bool is_open = !says && k.size() == 4 && std::ranges::any_of(k, [](double value) { return value != 0.0; });
  if (!is_open) {
    require_no_choice(file);
    return says && fields.number("fisheye_model") != 0.0;
  }
  if (file.choice.empty()) {
    doubt = fmt::format("the 4 numbers of {} may be k1 k2 p1 p2 (read so: brown) or k1 k2 k3 k4 of cv::fisheye", key);
    return false;
  }
  if (file.choice != "brown" && file.choice != "fisheye")
    refuse(file.name, "", fmt::format("no lens is called '{0}'; {1}:brown or {1}:fisheye", file.choice, file.name));
  return file.choice == "fisheye";
}

/// Of the pair that OpenCV's stereo sample writes, M1 D1 and M2 D2, the one that is wanted: "M1", or "M1:fisheye".
CameraContent read_opencv_pair(const YAML::Node& root, const CameraText& file) {
  std::vector<std::string> names;
  for (const char* name : {"M1", "M2"})
    if (root[name].IsDefined()) names.emplace_back(name);
  const std::size_t colon = std::min(file.choice.find(':'), file.choice.size());
  const std::size_t chosen = chosen_camera(names, {file.text, file.name, file.choice.substr(0, colon)});
  const std::string lens = file.choice.substr(std::min(colon + 1, file.choice.size()));
  const std::string coefficients_key = "D" + names[chosen].substr(1);
  const Fields fields(root, file.name);
  if (!fields.has(coefficients_key)) refuse(file.name, coefficients_key, "is missing");
  for (const char* key : {"image_width", "image_height"})
    if (!fields.has(key))
      refuse(file.name, key, "is missing, as OpenCV's stereo sample leaves it: add that of the photos");
  YAML::Node one(YAML::NodeType::Map);
  one["camera_matrix"] = root[names[chosen]];
  one["distortion_coefficients"] = root[coefficients_key];
  for (const char* key : {"image_width", "image_height"}) one[key] = root[key];
  CameraContent read = read_opencv(one, {file.text, file.name, lens});
  read.unread = place_among(names, chosen);
  return read;
}

}  // namespace

CameraContent read_opencv(const YAML::Node& root, const CameraText& file) {
  if (root["M1"].IsDefined() && root["D1"].IsDefined()) return read_opencv_pair(root, file);
  const Fields fields(root, file.name);
  const std::string matrix_key = first_of(fields, {"camera_matrix", "cameraMatrix", "K"});
  const std::string distortion_key = first_of(fields, {"distortion_coefficients", "distCoeffs", "dist_coeffs", "D"});
  const std::vector<double> focal_centre = from_camera_matrix(fields.matrix(matrix_key), file.name, matrix_key);
  const std::vector<double> k = fields.matrix(distortion_key);
  CameraContent read;
  const bool fisheye = is_fisheye_file(fields, k, distortion_key, file, read.doubt);
  Camera& camera = read.camera;
  camera = fisheye ? fisheye_camera(focal_centre, k, file.name, distortion_key)
                   : opencv_camera(focal_centre, k, file.name, distortion_key);
  camera.width_px = fields.size("image_width");
  camera.height_px = fields.size("image_height");
  if (fields.has("avg_reprojection_error")) camera.rms_px = std::max(0.0, fields.number("avg_reprojection_error"));
  return read;
}

/// XML is turned into the same tree by OpenCV's own reader.
CameraContent read_opencv_xml(const CameraText& file) {
  YAML::Node root(YAML::NodeType::Map);
  if (file.text.size() > (1u << 20)) refuse(file.name, "", "is larger than 1 MiB: no camera file");
  try {
    const cv::FileStorage storage(std::string(file.text), cv::FileStorage::READ | cv::FileStorage::MEMORY);
    for (const char* key : {"image_width", "image_height", "avg_reprojection_error", "fisheye_model"}) {
      if (storage[key].isInt() || storage[key].isReal()) root[key] = number_text(storage[key].real());
    }
    for (const char* key : {"camera_matrix", "cameraMatrix", "K", "distortion_coefficients", "distCoeffs",
                            "dist_coeffs", "D", "M1", "D1", "M2", "D2"}) {
      if (!storage[key].isMap()) continue;
      cv::Mat values;
      storage[key].mat().convertTo(values, CV_64F);
      if (values.channels() != 1 || values.total() > 100) refuse(file.name, key, "is not a small matrix of numbers");
      for (const double value : cv::Mat_<double>(values)) root[key].push_back(number_text(value));
    }
  } catch (const cv::Exception&) {
    refuse(file.name, "", "is XML, but not a file of OpenCV");
  }
  return read_opencv(root, file);
}

std::string write_opencv(const Camera& camera) {
  const std::vector<double> k = coefficients(camera);
  std::string text = fmt::format(
      "%YAML:1.0\n---\nimage_width: {}\nimage_height: {}\n"
      "camera_matrix: !!opencv-matrix\n   rows: 3\n   cols: 3\n   dt: d\n   data: {}\n"
      "distortion_coefficients: !!opencv-matrix\n   rows: 1\n   cols: {}\n   dt: d\n   data: {}\n",
      camera.width_px, camera.height_px, camera_matrix_list(camera), k.size(), number_list(k));
  if (is_fisheye(camera)) text += "fisheye_model: 1\n";
  if (camera.rms_px > 0.0) text += fmt::format("avg_reprojection_error: {}\n", number_text(camera.rms_px));
  return text;
}

CameraContent read_ros(const YAML::Node& root, const CameraText& file) {
  require_no_choice(file);
  const Fields fields(root, file.name);
  // A calibration file has the long names; a printed message has K and D (ROS 1) or k and d (ROS 2).
  const std::string matrix_key = first_of(fields, {"camera_matrix", "K", "k"});
  const std::string distortion_key = first_of(fields, {"distortion_coefficients", "D", "d"});
  const std::string model = fields.text("distortion_model");
  const std::vector<double> focal_centre = from_camera_matrix(fields.matrix(matrix_key), file.name, matrix_key);
  const std::vector<double> k = fields.matrix(distortion_key);
  Camera camera;
  if (model == "plumb_bob" || model == "rational_polynomial") {
    camera = opencv_camera(focal_centre, k, file.name, distortion_key);
  } else if (model == "equidistant" || model == "fisheye") {
    camera = fisheye_camera(focal_centre, k, file.name, distortion_key);
  } else {
    refuse(file.name, "distortion_model",
           "'" + model + "' is not known; known: plumb_bob, rational_polynomial (k4…k6 zero), equidistant");
  }
  camera.width_px = fields.size(first_of(fields, {"image_width", "width"}));
  camera.height_px = fields.size(first_of(fields, {"image_height", "height"}));
  std::vector<std::string> unread = place_in_pair(root, fields);
  for (std::string& what : other_images(root, camera)) unread.push_back(std::move(what));
  return {camera, std::move(unread)};
}

std::string write_ros(const Camera& camera) {
  const std::vector<double> k = coefficients(camera), f = focal_and_centre(camera);
  return fmt::format(
      "image_width: {}\nimage_height: {}\ncamera_name: camera\n"
      "camera_matrix:\n  rows: 3\n  cols: 3\n  data: {}\n"
      "distortion_model: {}\ndistortion_coefficients:\n  rows: 1\n  cols: {}\n  data: {}\n"
      "rectification_matrix:\n  rows: 3\n  cols: 3\n  data: {}\n"
      "projection_matrix:\n  rows: 3\n  cols: 4\n  data: {}\n",
      camera.width_px, camera.height_px, camera_matrix_list(camera), is_fisheye(camera) ? "equidistant" : "plumb_bob",
      k.size(), number_list(k), number_list({1, 0, 0, 0, 1, 0, 0, 0, 1}),
      number_list({f[0], 0, f[2], 0, 0, f[1], f[3], 0, 0, 0, 1, 0}));
}

}  // namespace alidade::detail
