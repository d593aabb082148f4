#include "alidade/simulate/rangefinder.h"

#include <algorithm>
#include <cmath>
#include <functional>
#include <numbers>
#include <numeric>
#include <stdexcept>
#include <utility>

#include "alidade/board/board_bend.h"
#include "alidade/geometry/degree.h"
#include "alidade/geometry/so3.h"
#include "alidade/simulate/draws.h"

namespace alidade {
namespace {

/// 1280×960, 1200 px, without distortion; what a calibration of it would leave unknown: 1.5, 1.5, 2, 2 px.
Camera reference_camera() {
  Camera camera{1280, 960, Calibrated<Pinhole>{}, Eigen::MatrixXd::Zero(5, 5), 0.0, "alidade simulate"};
  camera.lens = with_params(camera.lens, Eigen::Matrix<double, 5, 1>(1200.0, 1200.0, 640.0, 480.0, 0.0));
  camera.cov.diagonal() << 2.25, 2.25, 4.0, 4.0, 0.0;
  return camera;
}

/// The beam of the paper's Table 2: angles 1.557 and 1.586, origin (40, −70, 40) mm.
Beam reference_beam() {
  Beam beam;
  const double x = std::cos(1.557), y = std::cos(1.586);
  beam.direction_in_cam = {x, y, std::sqrt(1.0 - x * x - y * y)};
  beam.origin_in_cam = {0.04, -0.07, 0.04};
  return beam;
}

void aim(Beam& beam, const Eigen::Vector3d& origin_in_cam, const Eigen::Vector3d& towards) {
  beam.origin_in_cam = origin_in_cam;
  beam.direction_in_cam = towards.normalized();
}

using Change = std::function<void(RangefinderSceneConfig&)>;

const std::vector<std::pair<std::string, Change>>& changes() {
  using Config = RangefinderSceneConfig;
  static const std::vector<std::pair<std::string, Change>> all{
      {"reference", [](Config&) {}},
      {"table1",
       [](Config& c) {
         c.min_range_m = 3.6, c.max_range_m = 3.75, c.min_tilt_rad = 2.0 * degree, c.max_tilt_rad = 25.0 * degree,
         c.num_shots = 15;
       }},
      {"parallel", [](Config& c) { c.min_tilt_rad = c.max_tilt_rad = 30.0 * degree, c.azimuth_rad = 0.5; }},
      {"frontal", [](Config& c) { c.min_tilt_rad = c.max_tilt_rad = 0.0; }},
      {"near_frontal", [](Config& c) { c.max_tilt_rad = 5.0 * degree; }},
      {"equal_range", [](Config& c) { c.min_range_m = 2.0, c.max_range_m = 2.05; }},
      {"short_span", [](Config& c) { c.min_range_m = 2.0, c.max_range_m = 2.4; }},
      {"through_centre",
       [](Config& c) { c.beam.origin_in_cam = 0.04 * c.beam.direction_in_cam / c.beam.direction_in_cam.z(); }},
      {"parallel_to_view",
       [](Config& c) {
         aim(c.beam, {0.08, 0.0, 0.0}, {0.0, 0.0, 1.0});
       }},
      {"toed_in",
       [](Config& c) {
         aim(c.beam, {0.3, 0.0, 0.0}, {-std::sin(17 * degree), 0.0, std::cos(17 * degree)});
         c.min_range_m = 0.6;
       }},
      {"inverse_range", [](Config& c) { c.uniform_in_inverse_range = true; }},
      {"four_shots", [](Config& c) { c.num_shots = 4; }},
  };
  return all;
}

/// A board tilted towards `azimuth`, rotated about its normal, with `point_in_board` at `point_in_cam`.
Rigid3 board_at(const Eigen::Vector3d& point_in_cam, const Eigen::Vector3d& point_in_board, double tilt_rad,
                double azimuth_rad, double roll_rad) {
  // Rotating about (−sin, cos) carries the board's normal z towards −(cos, sin): the azimuth's side is farther.
  const Eigen::Vector3d axis(std::sin(azimuth_rad), -std::cos(azimuth_rad), 0.0);
  const Eigen::Quaterniond rotation = exp_so3(tilt_rad * axis) * exp_so3({0.0, 0.0, roll_rad});
  return {rotation, point_in_cam - rotation * point_in_board};
}

bool is_inside(const Camera& camera, const Rigid3& cam_from_board, const std::vector<Eigen::Vector3d>& points) {
  constexpr double margin_px = 5.0;
  return std::all_of(points.begin(), points.end(), [&](const Eigen::Vector3d& point) {
    const auto px = project(camera, cam_from_board * point);
    return px && px->x() > margin_px && px->y() > margin_px && px->x() < camera.width_px - 1 - margin_px &&
           px->y() < camera.height_px - 1 - margin_px;
  });
}

double draw_range(const RangefinderSceneConfig& config, Draws& draws) {
  if (!config.uniform_in_inverse_range) return draws.uniform(config.min_range_m, config.max_range_m);
  return 1.0 / draws.uniform(1.0 / config.max_range_m, 1.0 / config.min_range_m);
}

/// Where a board may be hit at a reading; the spot anywhere on its inner half. None where it is not seen whole.
std::optional<Rigid3> draw_pose(const RangefinderSceneConfig& config, double range_m,
                                const std::vector<Eigen::Vector3d>& points, Draws& draws) {
  const double tilt_rad = draws.uniform(config.min_tilt_rad, config.max_tilt_rad);
  const double any_azimuth_rad = draws.uniform(-std::numbers::pi, std::numbers::pi);
  const double any_roll_rad = draws.uniform(-30.0 * degree, 30.0 * degree);
  const double x = draws.uniform(-0.25, 0.25), y = draws.uniform(-0.25, 0.25);
  const double width_m = (config.board.cols - 1) * config.board.square_m;
  const double height_m = (config.board.rows - 1) * config.board.square_m;
  const Eigen::Vector3d hit_in_board((0.5 + x) * width_m, (0.5 + y) * height_m, 0.0);
  const Rigid3 cam_from_board =
      board_at(point_at(config.beam, range_m), hit_in_board, tilt_rad, config.azimuth_rad.value_or(any_azimuth_rad),
               config.azimuth_rad ? 0.0 : any_roll_rad);
  if (!is_inside(config.camera, cam_from_board, points)) return std::nullopt;
  return cam_from_board;
}

/// A reading and a pose for it; another reading only where no pose is found, so that readings keep their distribution.
std::pair<double, Rigid3> draw_shot(const RangefinderSceneConfig& config, const std::vector<Eigen::Vector3d>& points,
                                    Draws& draws) {
  constexpr int ranges = 50, poses = 200;
  for (int i = 0; i < ranges; ++i) {
    const double range_m = draw_range(config, draws);
    for (int k = 0; k < poses; ++k) {
      if (const auto cam_from_board = draw_pose(config, range_m, points, draws)) return {range_m, *cam_from_board};
    }
  }
  throw std::runtime_error("the beam meets no board that the camera sees whole");
}

/// Which shots missed the board: so many, by chance.
std::vector<bool> draw_outliers(std::size_t num_shots, double share, Draws& draws) {
  std::vector<bool> is_outlier(num_shots, false);
  auto wanted = static_cast<std::size_t>(std::lround(share * static_cast<double>(num_shots)));
  wanted = std::min(wanted, num_shots);
  while (wanted > 0) {
    const auto i = static_cast<std::size_t>(draws.uniform() * static_cast<double>(num_shots));
    if (is_outlier[i]) continue;
    is_outlier[i] = true;
    --wanted;
  }
  return is_outlier;
}

}  // namespace

std::optional<RangefinderSceneConfig> rangefinder_scenario(std::string_view name) {
  for (const auto& [known, change] : changes()) {
    if (known != name) continue;
    RangefinderSceneConfig config;
    config.camera = reference_camera();
    config.beam = reference_beam();
    change(config);
    return config;
  }
  return std::nullopt;
}

std::vector<std::string> rangefinder_scenarios() {
  std::vector<std::string> names;
  for (const auto& [name, change] : changes()) names.push_back(name);
  return names;
}

RangefinderScene draw_rangefinder_scene(const RangefinderSceneConfig& config, std::uint64_t seed) {
  Draws draws(seed);
  RangefinderScene scene{config.camera, config.board, config.beam, {}, {}};
  const std::vector<Eigen::Vector3d> points = points_in_board(config.board);
  for (int i = 0; i < config.num_shots; ++i) {
    const auto [range_m, cam_from_board] = draw_shot(config, points, draws);
    scene.range_m.push_back(range_m);
    scene.cam_from_board.push_back(cam_from_board);
  }
  return scene;
}

namespace {

/// The board as it is, not as it was printed.
struct BentBoard {
  BoardBend bend;
  Eigen::Vector3d size_m;
  double sheet_m;  ///< Before it.

  [[nodiscard]] Eigen::Vector3d at(const Eigen::Vector3d& point_in_board) const {
    return point_in_board + bend.heights_at(point_in_board).dot(size_m) * Eigen::Vector3d::UnitZ();
  }
  /// The reading where the beam, which meets the plane at `range_m`, meets the board.
  [[nodiscard]] double range_m(const Rigid3& cam_from_board, const Beam& beam, double range_m) const {
    const Eigen::Vector3d hit = cam_from_board.inverse() * point_at(beam, range_m);
    const double cosine = (cam_from_board.rotation * Eigen::Vector3d::UnitZ()).dot(beam.direction_in_cam);
    return range_m + ((at(hit) - hit).z() - sheet_m) / (cosine * beam.scale);
  }
};

}  // namespace

SimulatedShots simulate_shots(const RangefinderScene& scene, const ShotNoise& noise, std::uint64_t seed) {
  Draws draws(seed);
  const std::vector<Eigen::Vector3d> points = points_in_board(scene.board);
  const BentBoard board{BoardBend(points), {noise.bow_m, 0.0, noise.twist_m}, noise.sheet_m};
  SimulatedShots simulated{{}, draw_outliers(scene.range_m.size(), noise.outlier_share, draws)};
  const Eigen::Matrix2d cov =
      std::max(1e-12, noise.sigma_corner_px * noise.sigma_corner_px) * Eigen::Matrix2d::Identity();
  for (std::size_t i = 0; i < scene.range_m.size(); ++i) {
    const Plane plane = plane_of(scene.cam_from_board[i]);
    const double cosine = std::abs(plane.normal_in_cam.dot(scene.beam.direction_in_cam));
    const double tangent = std::sqrt(std::max(0.0, 1.0 - cosine * cosine)) / cosine;
    const double true_range_m = board.range_m(scene.cam_from_board[i], scene.beam, scene.range_m[i]);
    Shot shot;
    shot.name = "shot " + std::to_string(i + 1);
    shot.range_m = true_range_m + scene.beam.noise.sigma_at(true_range_m, tangent) * draws.normal();
    shot.range_m += noise.incidence_m * tangent;
    const double miss_m = draws.uniform(0.3, 1.0);
    if (simulated.is_outlier[i]) shot.range_m += miss_m;
    const auto spot = project(scene.camera, point_at(scene.beam, true_range_m));
    const double sigma_px = std::hypot(noise.sigma_spot_px, noise.sigma_spot_near_px / true_range_m);
    const Eigen::Vector2d spot_error_px = sigma_px * draws.normal2();
    if (noise.with_spot && spot) shot.spot = Spot{*spot + spot_error_px, {}};
    if (noise.with_board) {
      shot.board.emplace();
      shot.board->photo = shot.name;
      for (std::size_t k = 0; k < points.size(); ++k) {
        const auto px = project(scene.camera, scene.cam_from_board[i] * board.at(points[k]));
        const Eigen::Vector2d error_px = noise.sigma_corner_px * draws.normal2();
        if (px) shot.board->corners.push_back({static_cast<int>(k), *px + error_px, cov});
      }
    }
    simulated.shots.push_back(std::move(shot));
  }
  return simulated;
}

std::vector<Shot> mistaken_shots(std::vector<Shot> shots, const ShotMistake& mistake) {
  const auto num = static_cast<int>(shots.size());
  std::vector<double> read_m;
  for (const Shot& shot : shots) read_m.push_back(shot.range_m);
  for (int i = 0; i < num; ++i) {
    const int from = ((i - mistake.shift_rows) % num + num) % num;
    Shot& shot = shots[static_cast<std::size_t>(i)];
    const double true_m = read_m[static_cast<std::size_t>(from)], passed = num > 1 ? i / (num - 1.0) : 0.0;
    const double bend_m = mistake.bend_m * (true_m - 2.0) * (true_m - 2.0);
    shot.range_m = (true_m + mistake.offset_m + passed * mistake.drift_m + bend_m) / mistake.unit_m;
    if (!shot.spot) continue;
    shot.spot->px.array() += passed * mistake.wander_px;
    if (mistake.exchange_uv) shot.spot->px.reverseInPlace();
  }
  return shots;
}

Camera mistaken_camera(Camera camera, const ShotMistake& mistake) {
  const bool has_distortion = mistake.k1 != 0.0 || mistake.p1 != 0.0;
  if (has_distortion) camera = with_distortion(camera);
  Eigen::VectorXd values = params(camera.lens);
  values.head<2>() *= 1.0 + mistake.focal;
  values.segment<2>(2).array() += mistake.centre_px;
  if (has_distortion) {
    const std::vector<std::string> names = param_names(camera.lens);
    values[std::ranges::find(names, "k1") - names.begin()] += mistake.k1;
    if (mistake.p1 != 0.0) values[std::ranges::find(names, "p1") - names.begin()] += mistake.p1;
  }
  camera.lens = with_params(camera.lens, values);
  return camera;
}

}  // namespace alidade
