#include "alidade/capture/pose_words.h"

#include <Eigen/Geometry>
#include <cmath>
#include <vector>

namespace alidade {
namespace {

constexpr double tilted_rad = 0.2;

std::string joined(const std::vector<std::string>& parts, const char* between) {
  std::string text;
  for (const std::string& part : parts) text += (text.empty() ? "" : between) + part;
  return text;
}

BoardInImage mirrored(BoardInImage held) {
  held.centre.x() = 1.0 - held.centre.x();
  held.left_away = -held.left_away;
  return held;
}

}  // namespace

std::string position_words(const Eigen::Vector2d& centre) {
  const auto third = [](double at) { return at < 0.42 ? -1 : at > 0.58 ? 1 : 0; };
  const int across = third(centre.x()), down = third(centre.y());
  if (across == 0 && down == 0) return "in the centre";
  const std::string side = across < 0 ? "left" : "right";
  if (down == 0) return "on the " + side;
  const std::string edge = down < 0 ? "upper" : "lower";
  return across == 0 ? "at the " + edge + " edge" : "in the " + edge + " " + side + " corner";
}

BoardInImage board_in_image(const Camera& camera, const std::vector<Eigen::Vector3d>& board_points,
                            const Rigid3& cam_from_board) {
  BoardInImage held;
  Eigen::AlignedBox3d box;
  for (const auto& point : board_points) box.extend(point);
  const Eigen::Vector3d centre_in_cam = cam_from_board * box.center();
  const auto px = project(camera, centre_in_cam);
  held.centre = px ? px->cwiseQuotient(Eigen::Vector2d(camera.width_px, camera.height_px)) : Eigen::Vector2d(0.5, 0.5);
  const Eigen::VectorXd lens = params(camera.lens);
  held.size = lens[0] * box.sizes().x() / (std::max(1e-6, centre_in_cam.norm()) * camera.width_px);
  Eigen::Vector3d normal = cam_from_board.rotation * Eigen::Vector3d::UnitZ();
  if (normal.z() < 0.0) normal = -normal;
  held.top_away = std::atan2(normal.y(), normal.z());  // depth grows upwards where the normal points down
  held.left_away = std::atan2(normal.x(), normal.z());
  return held;
}

std::string words_of(const BoardInImage& given, bool is_mirrored) {
  const BoardInImage wanted = is_mirrored ? mirrored(given) : given;
  std::vector<std::string> parts{wanted.size > 0.5   ? "near"
                                 : wanted.size > 0.3 ? "at a medium distance"
                                                     : "far",
                                 position_words(wanted.centre)};
  if (wanted.top_away > tilted_rad) parts.push_back("the top tilted away");
  if (wanted.top_away < -tilted_rad) parts.push_back("the bottom tilted away");
  if (wanted.left_away > tilted_rad) parts.push_back("the left side turned away");
  if (wanted.left_away < -tilted_rad) parts.push_back("the right side turned away");
  if (parts.size() == 2) parts.push_back("facing the camera");
  return joined(parts, ", ");
}

std::string words_to(const BoardInImage& wanted_given, const BoardInImage& now_given, bool is_mirrored) {
  const BoardInImage wanted = is_mirrored ? mirrored(wanted_given) : wanted_given;
  const BoardInImage now = is_mirrored ? mirrored(now_given) : now_given;
  std::vector<std::string> parts;
  const double ratio = wanted.size / std::max(1e-6, now.size);
  if (ratio > 1.15) parts.push_back("nearer");
  if (ratio < 1.0 / 1.15) parts.push_back("further away");
  const Eigen::Vector2d way = wanted.centre - now.centre;
  const std::string down = way.y() > 0.08 ? "down" : way.y() < -0.08 ? "up" : "";
  const std::string across = way.x() > 0.08 ? "to the right" : way.x() < -0.08 ? "to the left" : "";
  if (!down.empty() || !across.empty())
    parts.push_back(down + (down.empty() || across.empty() ? "" : " and ") + across);
  const double top = wanted.top_away - now.top_away, left = wanted.left_away - now.left_away;
  if (top > tilted_rad) parts.push_back("tilt the top away");
  if (top < -tilted_rad) parts.push_back("tilt the bottom away");
  if (left > tilted_rad) parts.push_back("turn the left side away");
  if (left < -tilted_rad) parts.push_back("turn the right side away");
  return parts.empty() ? "as outlined" : joined(parts, "; ");
}

}  // namespace alidade
