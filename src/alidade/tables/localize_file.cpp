#include "alidade/tables/localize_file.h"

#include <fmt/format.h>
#include <yaml-cpp/yaml.h>

#include <algorithm>
#include <cmath>
#include <set>

#include "alidade/board/board.h"
#include "alidade/files/table_rows.h"
#include "alidade/files/yaml_fields.h"

namespace alidade {
namespace {

using detail::Fields;
using detail::number_list;
using detail::number_text;
using detail::refuse;

constexpr long max_id = 1'000'000'000;

double positive(const Fields& fields, const std::string& key, double otherwise) {
  if (!fields.has(key)) return otherwise;
  const double value = fields.number(key);
  if (!(value > 0.0)) refuse(fields.file(), fields.full(key), "is not above zero");
  return value;
}

long id_of(const Fields& fields) {
  const double value = fields.number("id");
  if (!(value >= 0.0) || value > max_id || value != std::floor(value))
    refuse(fields.file(), fields.full("id"), "is not a whole number from 0");
  return static_cast<long>(value);
}

/// The entries of a list of maps, each as its fields.
template <class Use>
void for_each_of(const YAML::Node& list, const std::string& file, const std::string& key, const Use& use) {
  if (!list.IsSequence()) refuse(file, key, "is not a list");
  for (std::size_t i = 0; i < list.size(); ++i) {
    const YAML::Node entry = list[i];
    use(Fields(entry, file, fmt::format("{}[{}].", key, i)));
  }
}

LocalizeTarget points_of(const YAML::Node& list, const std::string& file) {
  LocalizeTarget target;
  target.is_scale_given = true;
  std::vector<KnownPoint>& points = target.points;
  std::set<long> ids;
  for_each_of(list, file, "points", [&](const Fields& fields) {
    detail::refuse_unknown_keys(fields, {"id", "x_m", "y_m", "z_m", "sigma_m", "patch"}, "a point");
    KnownPoint point;
    point.id = id_of(fields);
    if (!ids.insert(point.id).second) refuse(file, fields.full("id"), fmt::format("{} appears twice", point.id));
    point.point_in_world = {fields.number("x_m"), fields.number("y_m"), fields.number("z_m")};
    point.sigma_m = positive(fields, "sigma_m", 0.001);
    target.is_scale_given = target.is_scale_given && fields.has("sigma_m");
    points.push_back(point);
  });
  return target;
}

LocalizeTarget board_points_of(const YAML::Node& node, const std::string& file) {
  const Fields fields(node, file, "board.");
  detail::refuse_unknown_keys(fields, {"corners", "square_m", "sigma_m", "sigma_square_m"}, "a board");
  Board board;
  char by = 0, end = 0;
  const std::string corners = fields.text("corners");
  if (std::sscanf(corners.c_str(), "%d%c%d%c", &board.cols, &by, &board.rows, &end) != 3 || by != 'x' ||
      board.cols < 2 || board.rows < 2 || board.cols > 1000 || board.rows > 1000)
    refuse(file, "board.corners", fmt::format("'{}' is not like 9x6", corners));
  board.square_m = fields.number("square_m");
  if (!(board.square_m > 0.0)) refuse(file, "board.square_m", "is not above zero");
  LocalizeTarget target;
  target.board = board;
  target.is_scale_given = fields.has("sigma_square_m");
  target.sigma_scale = positive(fields, "sigma_square_m", 0.0) / board.square_m;
  for (const Eigen::Vector3d& point : points_in_board(board))
    target.points.push_back({static_cast<long>(target.points.size()), point, positive(fields, "sigma_m", 0.001)});
  return target;
}

Eigen::Vector3d vector_or_zero(const Fields& fields, const std::string& key) {
  return fields.has(key) ? detail::read_vector(fields, key) : Eigen::Vector3d(Eigen::Vector3d::Zero());
}

Eigen::Quaterniond read_quaternion(const Fields& fields) {
  const std::vector<double> q = fields.numbers("quaternion_wxyz");
  if (q.size() != 4) refuse(fields.file(), "quaternion_wxyz", "must be 4 numbers");
  const Eigen::Quaterniond rotation(q[0], q[1], q[2], q[3]);
  if (!(std::abs(rotation.norm() - 1.0) < 1e-3))
    refuse(fields.file(), "quaternion_wxyz", fmt::format("has the length {:.6g}, not 1", rotation.norm()));
  return rotation.normalized();
}

const std::vector<std::string> start_keys{"position_m",
                                          "quaternion_wxyz",
                                          "velocity_m_s",
                                          "rate_rad_s",
                                          "sigma_position_m",
                                          "sigma_rotation_rad",
                                          "sigma_velocity_m_s",
                                          "sigma_rate_rad_s",
                                          "depth_m",
                                          "sigma_depth",
                                          "depths"};

std::vector<double> numbers_of(const Eigen::Vector3d& v) { return {v.x(), v.y(), v.z()}; }

}  // namespace

LocalizeTarget read_target(const std::filesystem::path& file) {
  const std::string name = file.string();
  const YAML::Node root = detail::load_yaml(read_file(file), name);
  const Fields fields(root, name);
  detail::refuse_unknown_keys(fields, {"points", "rectangle", "board", "seen_from"}, "a target");
  if (fields.has("rectangle")) refuse(name, "rectangle", "is found in images; observations need 'points' or a 'board'");
  if (fields.has("points") == fields.has("board")) refuse(name, "points", "or 'board': one of them is needed");
  LocalizeTarget target = fields.has("board") ? board_points_of(root["board"], name) : points_of(root["points"], name);
  if (target.points.empty()) refuse(name, "points", "has no points");
  if (fields.has("seen_from")) {
    const std::string side = fields.text("seen_from");
    if (side != "+z" && side != "-z") refuse(name, "seen_from", "is not +z or -z");
    if (target.board) refuse(name, "seen_from", "is of points; a board is seen from its printed side");
    target.seen_from_plus_z = side == "+z";
  }
  return target;
}

std::string target_text(std::span<const KnownPoint> points) {
  std::string text = "# known points, in the frame of the map\npoints:\n";
  for (const KnownPoint& point : points)
    text += fmt::format("  - {{id: {}, x_m: {}, y_m: {}, z_m: {}, sigma_m: {}}}\n", point.id,
                        number_text(point.point_in_world.x()), number_text(point.point_in_world.y()),
                        number_text(point.point_in_world.z()), number_text(point.sigma_m));
  return text;
}

LocalizeStart read_start(const std::filesystem::path& file) {
  const std::string name = file.string();
  const YAML::Node root = detail::load_yaml(read_file(file), name);
  const Fields fields(root, name);
  detail::refuse_unknown_keys(fields, start_keys, "a start");
  LocalizeStart read;
  CameraMotion& motion = read.motion;
  motion.world_from_cam = {read_quaternion(fields), detail::read_vector(fields, "position_m")};
  motion.velocity_in_world = vector_or_zero(fields, "velocity_m_s");
  motion.rate_in_cam = vector_or_zero(fields, "rate_rad_s");
  const std::array<double, 4> sigmas{
      positive(fields, "sigma_position_m", 0.01), positive(fields, "sigma_rotation_rad", 0.02),
      positive(fields, "sigma_velocity_m_s", 0.3), positive(fields, "sigma_rate_rad_s", 0.3)};
  for (std::size_t i = 0; i < sigmas.size(); ++i)
    read.cov.diagonal().segment<3>(static_cast<Eigen::Index>(3 * i)).setConstant(sigmas[i] * sigmas[i]);
  read.depth_m = positive(fields, "depth_m", 0.0);
  read.sigma_depth = positive(fields, "sigma_depth", 0.5);
  if (!fields.has("depths")) return read;
  std::set<long> ids;
  for_each_of(root["depths"], name, "depths", [&](const Fields& depth) {
    detail::refuse_unknown_keys(depth, {"id", "depth_m", "sigma_rel"}, "a depth");
    const GivenDepth given{id_of(depth), depth.number("depth_m"), positive(depth, "sigma_rel", 0.5)};
    if (!ids.insert(given.id).second) refuse(name, depth.full("id"), fmt::format("{} appears twice", given.id));
    if (!(given.depth_m > 0.0)) refuse(name, depth.full("depth_m"), "is not above zero");
    read.depths.push_back(given);
  });
  return read;
}

std::string start_text(const LocalizeStart& start) {
  const CameraMotion& motion = start.motion;
  const Eigen::Quaterniond& q = motion.world_from_cam.rotation;
  const auto sigma = [&](int i) { return number_text(std::sqrt(start.cov(i, i))); };
  std::string text = "# world_from_cam before the first frame\n";
  text += fmt::format("position_m: {}\n", number_list(numbers_of(motion.world_from_cam.translation)));
  text += fmt::format("quaternion_wxyz: {}\n", number_list({q.w(), q.x(), q.y(), q.z()}));
  text += fmt::format("velocity_m_s: {}\nrate_rad_s: {}\n", number_list(numbers_of(motion.velocity_in_world)),
                      number_list(numbers_of(motion.rate_in_cam)));
  text += fmt::format("sigma_position_m: {}\nsigma_rotation_rad: {}\n", sigma(0), sigma(3));
  text += fmt::format("sigma_velocity_m_s: {}\nsigma_rate_rad_s: {}\n", sigma(6), sigma(9));
  if (start.depth_m > 0.0)
    text += fmt::format("depth_m: {}\nsigma_depth: {}\n", number_text(start.depth_m), number_text(start.sigma_depth));
  if (!start.depths.empty()) text += "depths:  # along the optical axis, where first seen\n";
  for (const GivenDepth& depth : start.depths)
    text += fmt::format("  - {{id: {}, depth_m: {}, sigma_rel: {}}}\n", depth.id, number_text(depth.depth_m),
                        number_text(depth.sigma_rel));
  return text;
}

}  // namespace alidade
