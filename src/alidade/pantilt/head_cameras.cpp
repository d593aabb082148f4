#include "alidade/pantilt/head_cameras.h"

#include <fmt/format.h>

#include <set>

#include "alidade/estimation/config_error.h"

namespace alidade {

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
  return "";
}

}  // namespace alidade
