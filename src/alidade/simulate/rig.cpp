#include "alidade/simulate/rig.h"

#include <algorithm>
#include <cmath>
#include <map>
#include <numbers>
#include <stdexcept>
#include <utility>

#include "alidade/geometry/degree.h"
#include "alidade/simulate/draws.h"

namespace alidade {
namespace {

std::vector<double> spread(double low, double high, int count) {
  std::vector<double> values;
  for (int i = 0; i < count; ++i) values.push_back(low + (high - low) * i / (count - 1));
  return values;
}

RigHead drawn_head(const RigHead& nominal, const RigSceneConfig& config, bool is_first, Draws& draws) {
  RigHead drawn = nominal;
  Head& head = drawn.head;
  head.cam_from_tilt = nominal.head.cam_from_tilt * exp_so3(config.mounting_sigma_rad * draws.normal3());
  head.pan_to_tilt_m += Eigen::Vector3d(0.0, 0.0, config.offset_sigma_m * draws.normal());
  head.tilt_to_cam_m += config.offset_sigma_m * draws.normal3();
  head.axes_skew_rad += config.skew_sigma_rad * draws.normal();
  if (is_first || !config.first_encoder_only) {
    head.encoder.pan_scale *= config.encoder_scale;
    head.encoder.tilt_scale *= config.encoder_scale;
  }
  if (config.once_rad != 0.0) {
    const double pan = draws.uniform(0.0, 2.0 * std::numbers::pi), tilt = draws.uniform(0.0, 2.0 * std::numbers::pi);
    head.encoder.pan_cos_rad = config.once_rad * std::cos(pan);
    head.encoder.pan_sin_rad = config.once_rad * std::sin(pan);
    head.encoder.tilt_cos_rad = config.once_rad * std::cos(tilt);
    head.encoder.tilt_sin_rad = config.once_rad * std::sin(tilt);
  }
  if (is_first) return drawn;
  head.world_from_base.rotation =
      nominal.head.world_from_base.rotation * exp_so3(config.base_sigma_rad * draws.normal3());
  head.world_from_base.translation += config.base_sigma_m * draws.normal3();
  return drawn;
}

/// The corners of a board as a head at these angles sees them; fewer where some are not in the image.
BoardView true_view(const RigHead& rig_head, const Eigen::Vector2d& angles, const Rigid3& world_from_board,
                    const std::vector<Eigen::Vector3d>& points_in_board) {
  BoardView seen;
  const TurnedHead turned(rig_head.head, angles);
  for (std::size_t i = 0; i < points_in_board.size(); ++i) {
    const auto px = project(rig_head.camera, turned.point_in_cam(world_from_board * points_in_board[i]));
    const bool inside = px && px->x() >= 0.0 && px->y() >= 0.0 && px->x() <= rig_head.camera.width_px - 1.0 &&
                        px->y() <= rig_head.camera.height_px - 1.0;
    if (inside) seen.corners.push_back({static_cast<int>(i), *px, Eigen::Matrix2d::Identity()});
  }
  return seen;
}

/// Whole views of a board by one head, at most so many, spread over the grid of angles.
std::vector<HeadView> views_of(const RigHead& rig_head, const Rigid3& world_from_board,
                               const std::vector<Eigen::Vector3d>& points_in_board, const RigSceneConfig& config) {
  std::vector<HeadView> all, kept;
  for (const double pan : config.pans_rad) {
    for (const double tilt : config.tilts_rad) {
      HeadView view{
          true_view(rig_head, {pan, tilt}, world_from_board, points_in_board), 0, rig_head.head.id, {pan, tilt}};
      if (view.seen.corners.size() == points_in_board.size()) all.push_back(std::move(view));
    }
  }
  const auto most = static_cast<std::size_t>(config.max_views_of_a_board);
  if (all.size() <= most) return all;
  for (std::size_t i = 0; i < most; ++i) kept.push_back(all[i * all.size() / most]);
  return kept;
}

Rigid3 drawn_board(const RigSceneConfig& config, const Rig& rig, const Eigen::Vector3d& centre_in_board, Draws& draws) {
  // Somewhere in front of the heads' midpoint, facing them, tilted by up to 35°.
  Eigen::Vector3d centre = Eigen::Vector3d::Zero();
  for (const RigHead& rig_head : rig.heads)
    centre += rig_head.head.world_from_base.translation / static_cast<double>(rig.heads.size());
  const double range_m = draws.uniform(config.min_range_m, config.max_range_m);
  const double pan = draws.uniform(-30.0, 30.0) * degree, tilt = draws.uniform(-10.0, 20.0) * degree;
  const Eigen::Quaterniond towards = exp_so3({0.0, -pan, 0.0}) * exp_so3({tilt, 0.0, 0.0});
  const Eigen::Vector3d place = centre + range_m * (towards * Eigen::Vector3d::UnitZ());
  const double side = draws.uniform(0.0, 2.0 * std::numbers::pi), lean = draws.uniform(5.0, 35.0) * degree;
  const Eigen::Quaterniond turn = exp_so3(lean * Eigen::Vector3d(std::cos(side), std::sin(side), 0.0)) *
                                  exp_so3({0.0, 0.0, draws.uniform(-0.3, 0.3)});
  const Eigen::Quaterniond rotation = (towards * turn).normalized();
  return {rotation, place - rotation * centre_in_board};
}

RigSceneConfig completed(RigSceneConfig config) {
  if (config.pans_rad.empty()) config.pans_rad = spread(-40.0 * degree, 40.0 * degree, 5);
  if (config.tilts_rad.empty()) config.tilts_rad = spread(-15.0 * degree, 30.0 * degree, 4);
  if (config.nominal.empty())
    for (const RigHead& rig_head : xiahou_rig()) config.nominal.push_back(rig_head);
  return config;
}

/// Rotates the world so that it is the first head's camera at readings of zero.
void use_first_camera(Rig& rig) {
  const Rigid3 world_from_old = cam_from_world(rig.heads[0].head, Eigen::Vector2d::Zero());
  for (RigHead& rig_head : rig.heads) {
    const Rigid3 old_from_base = rig_head.head.world_from_base;
    rig_head.head.world_from_base = world_from_old * old_from_base;
  }
}

/// Where the corners of a board are that was printed and mounted so.
std::vector<Eigen::Vector3d> real_points(const RigSceneConfig& config) {
  std::vector<Eigen::Vector3d> points = points_in_board(config.board);
  const Eigen::Vector3d centre = 0.5 * (points.front() + points.back());
  for (Eigen::Vector3d& point : points) {
    const double along = (point.x() - centre.x()) / centre.x();  // −1 to 1
    point.x() = centre.x() + (1.0 + config.print_stretch) * (point.x() - centre.x());
    point.z() += config.board_bend_m * along * along;
  }
  return points;
}

}  // namespace

RigScene draw_rig_scene(const RigSceneConfig& given, std::uint64_t seed) {
  const RigSceneConfig config = completed(given);
  Draws draws(seed);
  RigScene scene;
  scene.board = config.board;
  for (const RigHead& nominal : config.nominal)
    scene.rig.heads.push_back(drawn_head(nominal, config, scene.rig.heads.empty(), draws));
  use_first_camera(scene.rig);
  const std::vector<Eigen::Vector3d> points = real_points(config);
  const Eigen::Vector3d centre = 0.5 * (points.front() + points.back());
  constexpr int max_tries = 100000;
  for (int tries = 0; static_cast<int>(scene.world_from_board.size()) < config.num_boards; ++tries) {
    if (tries > max_tries) throw std::runtime_error("no board fits in view of these heads");
    const Rigid3 world_from_board = drawn_board(config, scene.rig, centre, draws);
    const auto index = static_cast<int>(scene.world_from_board.size());
    std::vector<HeadView> views;
    bool is_seen = true;
    for (std::size_t h = 0; h < scene.rig.heads.size(); ++h) {
      if (!config.shared && static_cast<std::size_t>(index) % scene.rig.heads.size() != h) continue;
      Rigid3 now = world_from_board;
      if (h > 0 && config.sigma_moved_m > 0.0) now.translation += config.sigma_moved_m * draws.normal3();
      const std::vector<HeadView> own = views_of(scene.rig.heads[h], now, points, config);
      is_seen = is_seen && own.size() >= 2;
      views.insert(views.end(), own.begin(), own.end());
    }
    if (!is_seen) continue;
    for (HeadView& view : views) {
      view.board = index;
      view.seen.photo = "view " + std::to_string(scene.views.size());
      scene.views.push_back(std::move(view));
    }
    scene.world_from_board.push_back(world_from_board);
  }
  return scene;
}

namespace {

/// Errors of a head's readings that are the same each time.
class ReadingErrors {
 public:
  ReadingErrors(const RigNoise& noise, Draws& draws) : noise_(noise) {
    if (noise.twice_rad != 0.0) phase_ = {draws.uniform(0.0, 2.0 * std::numbers::pi), draws.uniform(0.0, 6.0)};
  }

  /// Of the next view.
  Eigen::Vector2d of(const HeadView& view) {
    Eigen::Vector2d error = Eigen::Vector2d::Zero();
    const auto [last, is_first] = last_.try_emplace(view.head, view.pan_tilt_rad, Eigen::Vector2d(0.5, 0.5));
    auto& [reading_rad, travel] = last->second;
    for (int axis = 0; axis < 2; ++axis) {
      const double reading = view.pan_tilt_rad[axis], by_rad = reading - reading_rad[axis];
      if (by_rad != 0.0) travel[axis] = by_rad > 0.0 ? 0.5 : -0.5;
      error[axis] = noise_.twice_rad * std::cos(2.0 * reading + phase_[axis]) + noise_.backlash_rad * travel[axis];
    }
    reading_rad = view.pan_tilt_rad;
    return error;
  }

 private:
  const RigNoise& noise_;
  Eigen::Vector2d phase_ = Eigen::Vector2d::Zero();
  std::map<int, std::pair<Eigen::Vector2d, Eigen::Vector2d>> last_;  ///< By head: reading, travel.
};

bool is_in_image(const Eigen::Vector2d& px, const Rig& rig, int head) {
  return std::any_of(rig.heads.begin(), rig.heads.end(), [&](const RigHead& one) {
    return one.head.id == head && px.minCoeff() >= 0.0 && px.x() < one.camera.width_px - 1.0 &&
           px.y() < one.camera.height_px - 1.0;
  });
}

/// Corners found elsewhere in the image. Draws of their own: without them the views are the same.
void move_corners(const RigScene& scene, const RigNoise& noise, std::uint64_t seed, std::vector<HeadView>& views) {
  if (!(noise.wrong_corners > 0.0)) return;
  Draws draws(seed + 0x51ed270b7a1fu);
  for (HeadView& view : views) {
    for (Corner& corner : view.seen.corners) {
      if (draws.uniform() >= noise.wrong_corners) continue;
      const double u = draws.uniform(-1.0, 1.0), v = draws.uniform(-1.0, 1.0);
      const Eigen::Vector2d px = corner.px + noise.wrong_corner_px * Eigen::Vector2d(u, v);
      if (is_in_image(px, scene.rig, view.head)) corner.px = px;
    }
  }
}

}  // namespace

SimulatedViews simulate_head_views(const RigScene& scene, const RigNoise& noise, std::uint64_t seed) {
  Draws draws(seed + 0x9e3779b97f4a7c15u);
  SimulatedViews simulated{scene.views, std::vector<bool>(scene.views.size(), false)};
  ReadingErrors errors(noise, draws);
  for (HeadView& view : simulated.views) {
    view.pan_tilt_rad += errors.of(view) + noise.sigma_encoder_rad * draws.normal2();
    for (Corner& corner : view.seen.corners) corner.px += noise.sigma_px * draws.normal2();
  }
  move_corners(scene, noise, seed, simulated.views);
  const auto num = scene.views.size();
  const auto num_wrong = static_cast<std::size_t>(std::lround(noise.wrong_views * static_cast<double>(num)));
  for (std::size_t made = 0; made < num_wrong;) {
    const auto v = static_cast<std::size_t>(draws.uniform() * static_cast<double>(num));
    const auto other = static_cast<std::size_t>(draws.uniform() * static_cast<double>(num));
    const double apart = (scene.views[v].pan_tilt_rad - scene.views[other].pan_tilt_rad).norm();
    if (simulated.is_wrong[v] || apart < 5.0 * degree) continue;
    simulated.views[v].pan_tilt_rad = scene.views[other].pan_tilt_rad;
    simulated.is_wrong[v] = true;
    ++made;
  }
  return simulated;
}

std::vector<HeadView> mistaken_views(std::vector<HeadView> views, const RigScene& scene, const RigMistake& mistake) {
  std::vector<Eigen::Vector2d> angles;
  for (const HeadView& view : views) angles.push_back(view.pan_tilt_rad);
  for (std::size_t v = 0; v < views.size(); ++v) {
    HeadView& view = views[v];
    if (mistake.shift_rows) view.pan_tilt_rad = angles[v == 0 ? angles.size() - 1 : v - 1];
    if (mistake.swap_angles) view.pan_tilt_rad.reverseInPlace();
    if (mistake.flip_pan) view.pan_tilt_rad.x() *= -1.0;
    const auto is_of = [&](const RigHead& one) { return one.head.id == view.head; };
    const auto head = std::find_if(scene.rig.heads.begin(), scene.rig.heads.end(), is_of);
    if (mistake.mirror && head != scene.rig.heads.end())
      for (Corner& corner : view.seen.corners) corner.px.x() = head->camera.width_px - 1.0 - corner.px.x();
    const bool is_second = scene.rig.heads.size() > 1 && view.head == scene.rig.heads[1].head.id;
    if (is_second) view.pan_tilt_rad.x() *= mistake.pan_read;
    if (mistake.turn_corners && is_second)
      for (Corner& corner : view.seen.corners) corner.index = scene.board.cols * scene.board.rows - 1 - corner.index;
    if (mistake.swap_heads && scene.rig.heads.size() == 2)
      view.head = scene.rig.heads[view.head == scene.rig.heads[0].head.id ? 1 : 0].head.id;
  }
  return views;
}

}  // namespace alidade
