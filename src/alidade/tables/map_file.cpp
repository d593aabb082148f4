#include "alidade/tables/map_file.h"

#include <fmt/format.h>
#include <yaml-cpp/yaml.h>

#include <cmath>
#include <set>

#include "alidade/files/yaml_fields.h"

namespace alidade {
namespace {

using detail::Fields;
using detail::number_list;
using detail::refuse;

constexpr int look_side_px = 25, thumbnail_width_px = 40, thumbnail_height_px = 30;

std::vector<double> entries_of(const Eigen::Ref<const Eigen::MatrixXd>& values) {
  std::vector<double> numbers;
  for (Eigen::Index j = 0; j < values.cols(); ++j)
    for (Eigen::Index i = 0; i < values.rows(); ++i) numbers.push_back(values(i, j));
  return numbers;
}

std::string map_pose_text(const Rigid3& world_from_cam) {
  const Eigen::Quaterniond& q = world_from_cam.rotation;
  return fmt::format("position: {}, quaternion_wxyz: {}", number_list(entries_of(world_from_cam.translation)),
                     number_list({q.w(), q.x(), q.y(), q.z()}));
}

std::string hex_of(const std::vector<std::uint8_t>& bytes) {
  std::string text;
  for (const std::uint8_t byte : bytes) text += fmt::format("{:02x}", byte);
  return text;
}

int digit_of(char c) { return c >= '0' && c <= '9' ? c - '0' : c >= 'a' && c <= 'f' ? c - 'a' + 10 : -1; }

GreyPatch map_grey_of(const Fields& fields, int width_px, int height_px) {
  const std::string text = fields.text("grey");
  const std::size_t num = static_cast<std::size_t>(width_px) * static_cast<std::size_t>(height_px);
  if (text.size() != 2 * num)
    refuse(fields.file(), fields.full("grey"), fmt::format("has {} digits, not {}", text.size(), 2 * num));
  GreyPatch patch{width_px, height_px, {}};
  for (std::size_t i = 0; i < num; ++i) {
    const int high = digit_of(text[2 * i]), low = digit_of(text[2 * i + 1]);
    if (high < 0 || low < 0) refuse(fields.file(), fields.full("grey"), "is not made of hexadecimal digits");
    patch.grey.push_back(static_cast<std::uint8_t>(16 * high + low));
  }
  return patch;
}

/// So many numbers, as a matrix column by column.
Eigen::MatrixXd map_matrix_of(const Fields& fields, const std::string& key, Eigen::Index rows, Eigen::Index cols) {
  const std::vector<double> numbers = fields.numbers(key);
  if (static_cast<Eigen::Index>(numbers.size()) != rows * cols)
    refuse(fields.file(), fields.full(key), fmt::format("must be {} numbers", rows * cols));
  return Eigen::Map<const Eigen::MatrixXd>(numbers.data(), rows, cols);
}

Rigid3 map_pose_of(const Fields& fields) {
  const Eigen::Vector4d q = map_matrix_of(fields, "quaternion_wxyz", 4, 1);
  if (!(std::abs(q.norm() - 1.0) < 1e-3)) refuse(fields.file(), fields.full("quaternion_wxyz"), "is not of length 1");
  return {Eigen::Quaterniond(q[0], q[1], q[2], q[3]).normalized(), map_matrix_of(fields, "position", 3, 1)};
}

Eigen::Matrix3d map_covariance_of(const Fields& fields) {
  const Eigen::VectorXd upper = map_matrix_of(fields, "covariance", 6, 1);
  Eigen::Matrix3d cov;
  cov << upper[0], upper[1], upper[2], upper[1], upper[3], upper[4], upper[2], upper[4], upper[5];
  const Eigen::Vector3d sigma = cov.diagonal().cwiseMax(0.0).cwiseSqrt();
  bool is_one = sigma.minCoeff() > 0.0;
  for (int i = 0; i < 3; ++i)
    for (int j = 0; j < 3; ++j) is_one = is_one && std::abs(cov(i, j)) <= sigma[i] * sigma[j] * (1.0 + 1e-9);
  if (!is_one) refuse(fields.file(), fields.full("covariance"), "is no covariance");
  return cov;
}

std::vector<double> upper_of(const Eigen::Matrix<double, 7, 7>& cov) {
  std::vector<double> numbers;
  for (int i = 0; i < 7; ++i)
    for (int j = i; j < 7; ++j) numbers.push_back(cov(i, j));
  return numbers;
}

SavedFrame read_frame(const YAML::Node& node, const Fields& map) {
  const Fields fields(node, map.file(), "frame.");
  detail::refuse_unknown_keys(fields, {"centre", "covariance"}, "a map's frame");
  SavedFrame frame{map_matrix_of(fields, "centre", 3, 1), {}};
  const Eigen::VectorXd upper = map_matrix_of(fields, "covariance", 28, 1);
  for (int i = 0, at = 0; i < 7; ++i)
    for (int j = i; j < 7; ++j) frame.cov(i, j) = frame.cov(j, i) = upper[at++];
  constexpr double rounding = 1e-6;  // of correlations
  const Eigen::Vector<double, 7> sigma = frame.cov.diagonal().cwiseMax(0.0).cwiseSqrt();
  const Eigen::Matrix<double, 7, 7> most = (1.0 + rounding) * sigma * sigma.transpose();
  if (!frame.centre.allFinite() || !frame.cov.allFinite() || !(frame.cov.cwiseAbs().array() <= most.array()).all())
    refuse(fields.file(), fields.full("covariance"), "is no covariance");
  return frame;
}

SavedLook read_look(const YAML::Node& node, const Fields& point) {
  const Fields fields(node, point.file(), point.full("look") + ".");
  detail::refuse_unknown_keys(fields, {"position", "quaternion_wxyz", "offset_px", "surface", "derivative", "grey"},
                              "a look");
  SavedLook look;
  look.patch = map_grey_of(fields, look_side_px, look_side_px);
  look.world_from_first_cam = map_pose_of(fields);
  look.offset_px = map_matrix_of(fields, "offset_px", 2, 1);
  look.surface_in_world = map_matrix_of(fields, "surface", 3, 2);
  look.J_first_px_surface = map_matrix_of(fields, "derivative", 2, 2);
  if (!(std::abs(look.J_first_px_surface.determinant()) > 0.0))
    refuse(fields.file(), fields.full("derivative"), "has no inverse");
  return look;
}

}  // namespace

std::string map_text(const SavedMap& map) {
  std::string text = "# a map for `alidade localize --map`\n";
  text += fmt::format("in_metres: {}\n", map.is_in_metres);
  if (map.frame)
    text += fmt::format("frame: {{centre: {},\n  covariance: {}}}\n", number_list(entries_of(map.frame->centre)),
                        number_list(upper_of(map.frame->cov)));
  text += "points:\n";
  for (const SavedPoint& point : map.points) {
    const Eigen::Matrix3d& c = point.cov;
    text += fmt::format("  - {{id: {}, position: {}, covariance: {}", point.id,
                        number_list(entries_of(point.point_in_world)),
                        number_list({c(0, 0), c(0, 1), c(0, 2), c(1, 1), c(1, 2), c(2, 2)}));
    if (point.look)
      text +=
          fmt::format(",\n     look: {{{}, offset_px: {},\n      surface: {}, derivative: {},\n      grey: '{}'}}",
                      map_pose_text(point.look->world_from_first_cam), number_list(entries_of(point.look->offset_px)),
                      number_list(entries_of(point.look->surface_in_world)),
                      number_list(entries_of(point.look->J_first_px_surface)), hex_of(point.look->patch.grey));
    text += "}\n";
  }
  if (!map.keyframes.empty()) text += "keyframes:\n";
  for (const SavedKeyframe& keyframe : map.keyframes)
    text += fmt::format("  - {{{},\n     grey: '{}'}}\n", map_pose_text(keyframe.world_from_cam),
                        hex_of(keyframe.thumbnail.grey));
  return text;
}

SavedMap read_map(const std::filesystem::path& file) {
  const std::string name = file.string();
  const YAML::Node root = detail::load_yaml(read_file(file), name);
  const Fields fields(root, name);
  detail::refuse_unknown_keys(fields, {"in_metres", "frame", "points", "keyframes"}, "a map");
  SavedMap map;
  const std::string in_metres = fields.text("in_metres");
  if (in_metres != "true" && in_metres != "false") refuse(name, "in_metres", "is neither true nor false");
  map.is_in_metres = in_metres == "true";
  if (fields.has("frame")) map.frame = read_frame(root["frame"], fields);
  const YAML::Node points = root["points"];
  if (!points.IsSequence() || points.size() == 0) refuse(name, "points", "has no points");
  std::set<long> ids;
  for (std::size_t i = 0; i < points.size(); ++i) {
    const YAML::Node node = points[i];
    const Fields each(node, name, fmt::format("points[{}].", i));
    detail::refuse_unknown_keys(each, {"id", "position", "covariance", "look"}, "a point");
    const double id = each.number("id");
    constexpr double max_id = 1e9;
    if (!(id >= 0.0) || id > max_id || id != std::floor(id))
      refuse(name, each.full("id"), "is not a whole number from 0");
    SavedPoint point{static_cast<long>(id), map_matrix_of(each, "position", 3, 1), map_covariance_of(each), {}};
    if (!ids.insert(point.id).second) refuse(name, each.full("id"), fmt::format("{} appears twice", point.id));
    if (each.has("look")) point.look = read_look(node["look"], each);
    map.points.push_back(std::move(point));
  }
  if (!fields.has("keyframes")) return map;
  const YAML::Node keyframes = root["keyframes"];
  if (!keyframes.IsSequence()) refuse(name, "keyframes", "is not a list");
  for (std::size_t i = 0; i < keyframes.size(); ++i) {
    const YAML::Node node = keyframes[i];
    const Fields each(node, name, fmt::format("keyframes[{}].", i));
    detail::refuse_unknown_keys(each, {"position", "quaternion_wxyz", "grey"}, "a keyframe");
    map.keyframes.push_back({map_pose_of(each), map_grey_of(each, thumbnail_width_px, thumbnail_height_px)});
  }
  return map;
}

}  // namespace alidade
