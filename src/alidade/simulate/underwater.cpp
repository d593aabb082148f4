#include "alidade/simulate/underwater.h"

#include <array>
#include <cmath>
#include <numbers>

#include "alidade/geometry/degree.h"
#include "alidade/simulate/draws.h"

namespace alidade {
namespace {

/// Column and row of points 1 to 8 in the board's grid of 10×8.
constexpr std::array<std::array<int, 2>, 8> vertices{{{0, 0}, {9, 0}, {9, 7}, {0, 7}, {5, 4}, {2, 2}, {7, 2}, {7, 5}}};
constexpr double square_m = 0.028, centre_x_m = 4.5 * square_m, centre_y_m = 3.5 * square_m;

/// A sine of each of six components: position, then rotation vector.
struct Swing {
  Eigen::Vector<double, 6> amplitude, frequency_hz, phase;

  [[nodiscard]] Rigid3 world_from_cam(double t_s) const {
    Eigen::Vector<double, 6> at;
    for (int i = 0; i < 6; ++i)
      at[i] = amplitude[i] * std::sin(2.0 * std::numbers::pi * frequency_hz[i] * t_s + phase[i]);
    return {exp_so3(at.tail<3>()), Eigen::Vector3d(centre_x_m, centre_y_m, -0.62) + at.head<3>()};
  }
};

Swing swing_of(Draws& draws) {
  Swing swing;
  const double angle_rad = 8.0 * degree;
  swing.amplitude << 0.12, 0.09, 0.10, angle_rad, angle_rad, angle_rad;
  for (int i = 0; i < 6; ++i) {
    swing.frequency_hz[i] = draws.uniform(0.22, 0.38);
    swing.phase[i] = draws.uniform(0.0, 2.0 * std::numbers::pi);
  }
  return swing;
}

std::vector<UnderwaterPoint> points_of(const UnderwaterScene& scene, Draws& draws) {
  std::vector<UnderwaterPoint> points;
  for (int i = 0; i < scene.num_points; ++i) {
    UnderwaterPoint point;
    point.id = i + 1;
    if (i < static_cast<int>(vertices.size())) {
      const auto& vertex = vertices[static_cast<std::size_t>(i)];
      point.point_in_world = {square_m * vertex[0], square_m * vertex[1], 0.0};
    } else {  // around the board and up to 0.3 m behind it
      const double x = draws.uniform(-0.12, 0.37), y = draws.uniform(-0.08, 0.28), z = draws.uniform(0.0, 0.3);
      point.point_in_world = {x, y, z};
    }
    for (const long id : scene.known) point.is_known = point.is_known || id == point.id;
    const Eigen::Vector3d error = scene.sigma_known_m * draws.normal3();
    if (point.is_known) point.given_in_world = point.point_in_world + error;
    point.given_in_world.x() *= 1.0 + scene.target_stretch;
    points.push_back(point);
  }
  return points;
}

/// Of a row that is read `readout_s` (v/H − ½) after the central one: by iteration, as the row depends on the pose.
std::optional<Eigen::Vector2d> rolling_px(const UnderwaterScene& scene, const Swing& swing, double t_s,
                                          const Eigen::Vector3d& point_in_world) {
  auto px = project(scene.camera, swing.world_from_cam(t_s).inverse() * point_in_world);
  constexpr int enough = 4;  // of which each leaves a hundredth
  for (int i = 0; i < enough && scene.readout_s > 0.0 && px; ++i) {
    const double later_s = scene.readout_s * (px->y() / scene.camera.height_px - 0.5);
    px = project(scene.camera, swing.world_from_cam(t_s + later_s).inverse() * point_in_world);
  }
  return px;
}

bool is_between_pixels(const Camera& camera, const Eigen::Vector2d& px) {
  return px.x() >= 0.0 && px.y() >= 0.0 && px.x() <= camera.width_px - 1.0 && px.y() <= camera.height_px - 1.0;
}

}  // namespace

Camera underwater_camera() {
  Calibrated<Brown> lens;
  lens.params << 768.0, 766.0, 389.0, 284.0, 0.0, -0.44881, 0.0664, 0.01316, 0.00218, 0.0;
  // Given exactly: its covariance is zero.
  return {768, 576, lens, Eigen::MatrixXd::Zero(10, 10), 0.0, "alidade simulate underwater"};
}

std::optional<long> underwater_point_at(int corner) {
  for (std::size_t i = 0; i < vertices.size(); ++i)
    if (corner == 10 * vertices[i][1] + vertices[i][0]) return static_cast<long>(i) + 1;
  return std::nullopt;
}

UnderwaterSequence simulate_underwater(const UnderwaterScene& scene, std::uint64_t seed) {
  Draws draws(seed);
  const Swing swing = swing_of(draws);
  UnderwaterSequence sequence;
  sequence.world_from_cam = [swing](double t_s) { return swing.world_from_cam(t_s); };
  sequence.points = points_of(scene, draws);
  const Eigen::Vector3d turn = scene.sigma_rotation_rad * draws.normal3();
  const Rigid3 first = swing.world_from_cam(0.0);
  sequence.given_start = {(first.rotation * exp_so3(turn)).normalized(),
                          first.translation + scene.sigma_position_m * draws.normal3()};
  for (int k = 0; k < scene.num_frames; ++k) {
    const int num_missing = scene.missing_every > 1 ? k / (scene.missing_every - 1) : 0;
    const double taken_s = (k + num_missing) * scene.dt_s;
    UnderwaterFrame frame{k * scene.dt_s, swing.world_from_cam(taken_s), {}};
    const bool is_black = scene.blackout_s > 0.0 && frame.t_s >= scene.blackout_from_s - 1e-9 &&
                          frame.t_s < scene.blackout_from_s + scene.blackout_s - 1e-9;
    for (UnderwaterPoint& point : sequence.points) {
      const Eigen::Vector2d noise = scene.sigma_px * draws.normal2();
      const double depth_error = draws.normal(), is_wrong = draws.uniform();
      const double v = draws.uniform(-1.0, 1.0), u = draws.uniform(-1.0, 1.0);
      Eigen::Vector3d point_in_world = point.point_in_world;
      if (point.id <= static_cast<long>(vertices.size())) point_in_world.x() += scene.target_speed_m_s * taken_s;
      const Eigen::Vector3d point_in_cam = frame.world_from_cam.inverse() * point_in_world;
      const auto px = rolling_px(scene, swing, taken_s - scene.late_s, point_in_world);
      if (is_black || !px || !is_between_pixels(scene.camera, *px)) continue;
      // A prior of 30 % may draw a point behind the camera: no one believes that.
      if (point.given_depth_m == 0.0)
        point.given_depth_m = point_in_cam.z() * std::max(0.1, 1.0 + scene.sigma_depth * depth_error);
      const bool is_mismatch = k > 0 && is_wrong < scene.mismatches;
      const Eigen::Vector2d shown =
          is_mismatch ? Eigen::Vector2d(*px + scene.mismatch_px * Eigen::Vector2d(u, v)) : *px + noise;
      if (is_between_pixels(scene.camera, shown)) frame.observations.push_back({point.id, shown, is_mismatch});
    }
    sequence.frames.push_back(std::move(frame));
  }
  return sequence;
}

}  // namespace alidade
