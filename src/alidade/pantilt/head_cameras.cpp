#include "alidade/pantilt/head_cameras.h"

#include <fmt/format.h>

#include <algorithm>
#include <map>
#include <set>
#include <utility>

#include "alidade/estimation/config_error.h"

namespace alidade {
namespace {

bool are_same(const BoardView& a, const BoardView& b) {
  return std::ranges::equal(a.corners, b.corners, [](const Corner& one, const Corner& other) {
    return one.index == other.index && one.px == other.px;
  });
}

/// One head's rows given as two heads': no two cameras see corners alike to the last digit.
std::string same_rows_fault(std::span<const HeadView> views) {
  constexpr int least = 3;
  std::map<std::pair<double, double>, std::vector<const HeadView*>> by_corner;
  std::map<std::pair<int, int>, int> num_same;
  for (const HeadView& view : views) {
    if (view.seen.corners.empty()) continue;
    const Eigen::Vector2d& first = view.seen.corners.front().px;
    auto& others = by_corner[{first.x(), first.y()}];
    for (const HeadView* other : others) {
      if (other->head == view.head || !are_same(other->seen, view.seen)) continue;
      if (++num_same[std::minmax(other->head, view.head)] < least) continue;
      return fmt::format(
          "{}: has the corners of {} digit for digit, as others of heads {} and {}: are they one head's?",
          view.seen.photo, other->seen.photo, other->head, view.head);
    }
    others.push_back(&view);
  }
  return "";
}

}  // namespace

std::vector<int> heads_of(std::span<const HeadView> views) {
  std::set<int> ids;
  for (const HeadView& view : views) ids.insert(view.head);
  return {ids.begin(), ids.end()};
}

std::string camera_count_fault(const std::vector<int>& ids, std::size_t num_cameras) {
  if (num_cameras == 1 || num_cameras == ids.size()) return "";
  return fmt::format("has {} heads ({}), but there are {} cameras; give one, or one for each head", ids.size(),
                     fmt::join(ids, ", "), num_cameras);
}

std::map<int, Camera> cameras_by_head(const std::vector<int>& ids, const std::vector<Camera>& cameras) {
  const std::string fault = camera_count_fault(ids, cameras.size());
  if (!fault.empty()) throw ConfigError("the table " + fault);
  std::map<int, Camera> by_head;
  for (std::size_t i = 0; i < ids.size(); ++i) by_head[ids[i]] = cameras[cameras.size() == 1 ? 0 : i];
  return by_head;
}

std::vector<RigHead> heads_with(const std::map<int, Camera>& cameras) {
  std::vector<RigHead> heads;
  for (const auto& [id, camera] : cameras) {
    RigHead& head = heads.emplace_back();
    head.head.id = id;
    head.camera = camera;
  }
  return heads;
}

std::string image_fault(std::span<const HeadView> views, const std::map<int, Camera>& cameras) {
  for (const HeadView& view : views) {
    const auto found = cameras.find(view.head);
    if (found == cameras.end()) continue;
    const Camera& camera = found->second;
    for (const Corner& corner : view.seen.corners) {
      const Eigen::Vector2d& px = corner.px;
      if (px.minCoeff() >= -1.0 && px.x() <= camera.width_px && px.y() <= camera.height_px) continue;
      return fmt::format(
          "{}: a corner at ({:.1f}, {:.1f}) is outside the image of head {}'s camera, {} x {} px: "
          "is it another camera's file?",
          view.seen.photo, px.x(), px.y(), view.head, camera.width_px, camera.height_px);
    }
  }
  return same_rows_fault(views);
}

}  // namespace alidade
