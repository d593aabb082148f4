#include "alidade/simulate/boards/board_photos.h"

#include <algorithm>
#include <cmath>
#include <limits>
#include <numbers>
#include <optional>

#include "alidade/simulate/boards/board_placing.h"
#include "alidade/simulate/boards/printed_pattern.h"
#include "alidade/simulate/draws.h"

namespace alidade {

std::vector<Eigen::Vector3d> draw_bent_points(const Board& board, const BoardSceneConfig& config, Draws& draws) {
  std::vector<Eigen::Vector3d> points = points_in_board(board);
  const Eigen::Vector3d centre = 0.5 * (points.front() + points.back());
  const Eigen::Vector3d half = (points.back() - centre).cwiseMax(1e-12);
  for (Eigen::Vector3d& point : points) {
    const Eigen::Vector3d relative = (point - centre).cwiseQuotient(half);
    const double bow = config.bow_m * (1.0 - 0.5 * relative.head<2>().squaredNorm());
    point += Eigen::Vector3d(0.0, 0.0, bow) + config.shape_sigma_m * draws.normal3();
  }
  return points;
}

std::vector<Eigen::Vector3d> visible_outline(const BoardScene& scene) {
  const PrintedPattern pattern(scene.board);
  const Eigen::Vector2d low = pattern.print_min(), high = pattern.print_max();
  std::vector<Eigen::Vector3d> outline = scene.points_in_board;
  constexpr int steps = 8;
  for (int i = 0; i < steps; ++i) {
    const double x = low.x() + (high.x() - low.x()) * i / steps, y = low.y() + (high.y() - low.y()) * i / steps;
    outline.emplace_back(x, low.y(), 0.0);
    outline.emplace_back(high.x(), y, 0.0);
    outline.emplace_back(high.x() + low.x() - x, high.y(), 0.0);
    outline.emplace_back(low.x(), high.y() + low.y() - y, 0.0);
  }
  return outline;
}

bool sees_all(const Camera& camera, const Rigid3& cam_from_board, const std::vector<Eigen::Vector3d>& points_in_board) {
  constexpr double margin_px = 6.0;  // room for the fit's pixels and the blur
  return std::all_of(points_in_board.begin(), points_in_board.end(), [&](const Eigen::Vector3d& point) {
    const auto px = project(camera, cam_from_board * point);
    return px && px->x() >= margin_px && px->y() >= margin_px && px->x() <= camera.width_px - 1 - margin_px &&
           px->y() <= camera.height_px - 1 - margin_px;
  });
}

namespace {

/// Draws poses of a scene's board in which all of it is seen.
class PoseDraws {
 public:
  PoseDraws(const BoardScene& scene, const BoardSceneConfig& config, Draws& draws)
      : scene_(scene), config_(config), draws_(draws), outline_(visible_outline(scene)) {
    const PrintedPattern pattern(scene.board);
    const Eigen::Vector2d size = pattern.print_max() - pattern.print_min();
    centre_.head<2>() = 0.5 * (pattern.print_max() + pattern.print_min());
    const Camera& camera = scene.camera;
    const Eigen::VectorXd lens = params(camera.lens);
    distance_at_fill_1_ = std::max(lens[0] * size.x() / camera.width_px, lens[1] * size.y() / camera.height_px);
  }

  /// Draws until one shows everything; the board moves away a little after every failure. `least_tilt` is a share of
  /// the largest.
  Rigid3 next(double least_tilt = 0.0) {
    double fill = draws_.uniform(config_.min_fill, config_.max_fill);
    Rigid3 cam_from_board;
    constexpr int max_tries = 2000;
    for (int i = 0; i < max_tries; ++i, fill *= 0.995) {
      const std::optional<Rigid3> drawn = draw_at(fill, least_tilt);
      if (!drawn) continue;
      cam_from_board = *drawn;
      if (sees_all(scene_.camera, cam_from_board, outline_)) break;
    }
    return cam_from_board;
  }

  /// Of several tilted ones that show everything, the one whose points come nearest to this corner of the image.
  Rigid3 next_into(const Eigen::Vector2d& corner_px) {
    constexpr int num_drawn = 150;
    constexpr double least_tilt = 0.5;  // of the largest: boards that face the camera do not determine f
    Rigid3 nearest;
    double least_px = std::numeric_limits<double>::infinity();
    for (int i = 0; i < num_drawn; ++i) {
      const Rigid3 drawn = next(least_tilt);
      if (!sees_all(scene_.camera, drawn, outline_)) return drawn;  // no pose fits: no use in drawing on
      const double px = distance_px(drawn, corner_px);
      if (!(px < least_px) && i > 0) continue;
      least_px = px;
      nearest = drawn;
    }
    return nearest;
  }

 private:
  std::optional<Rigid3> draw_at(double fill, double least_tilt = 0.0) {
    const Camera& camera = scene_.camera;
    const double tilt = config_.max_tilt_rad * std::sqrt(draws_.uniform(least_tilt * least_tilt, 1.0));
    const double azimuth = draws_.uniform(0.0, 2.0 * std::numbers::pi), roll = draws_.uniform(-0.35, 0.35);
    const Eigen::Vector3d axis(std::cos(azimuth), std::sin(azimuth), 0.0);
    Rigid3 cam_from_board;
    cam_from_board.rotation = exp_so3(tilt * axis) * exp_so3({0.0, 0.0, roll});
    const double v = draws_.uniform(0.1, 0.9) * camera.height_px, u = draws_.uniform(0.1, 0.9) * camera.width_px;
    const auto ray = unproject(camera, {u, v});
    if (!ray) return std::nullopt;
    cam_from_board.translation = distance_at_fill_1_ / fill / ray->z() * *ray - cam_from_board.rotation * centre_;
    return cam_from_board;
  }

  /// Of the nearest of the board's points.
  [[nodiscard]] double distance_px(const Rigid3& cam_from_board, const Eigen::Vector2d& corner_px) const {
    double least = std::numeric_limits<double>::infinity();
    for (const Eigen::Vector3d& point : scene_.points_in_board) {
      const auto px = project(scene_.camera, cam_from_board * point);
      if (px) least = std::min(least, (*px - corner_px).norm());
    }
    return least;
  }

  const BoardScene& scene_;
  const BoardSceneConfig& config_;
  Draws& draws_;
  std::vector<Eigen::Vector3d> outline_;
  Eigen::Vector3d centre_ = Eigen::Vector3d::Zero();
  double distance_at_fill_1_ = 0.0;
};

}  // namespace

BoardScene draw_board_scene(const Camera& camera, const Board& board, const BoardSceneConfig& config,
                            std::uint64_t seed) {
  Draws draws(seed);
  BoardScene scene{camera, board, draw_bent_points(board, config, draws), {}};
  PoseDraws poses(scene, config, draws);
  for (int i = 0; i < config.num_photos; ++i) {
    const int corner = i / 2 % 4;  // left and right in turn
    const Eigen::Vector2d px(corner % 2 == 0 ? 0.0 : camera.width_px - 1.0,
                             corner % 3 == 0 ? 0.0 : camera.height_px - 1.0);
    const bool is_aimed = config.into_corners && i % 2 == 1;
    scene.cam_from_board.push_back(is_aimed ? poses.next_into(px) : poses.next());
  }
  return scene;
}

Camera camera_of(const BoardScene& scene, std::size_t i) {
  if (scene.autofocus == 0.0) return scene.camera;
  Eigen::Vector3d middle = Eigen::Vector3d::Zero();
  for (const Eigen::Vector3d& point : scene.points_in_board)
    middle += point / static_cast<double>(scene.points_in_board.size());
  Camera camera = scene.camera;
  Eigen::VectorXd lens = params(camera.lens);
  lens.head<2>() *= 1.0 + scene.autofocus * 0.5 / (scene.cam_from_board[i] * middle).z();
  camera.lens = with_params(camera.lens, lens);
  return camera;
}

std::vector<Eigen::Vector2d> true_corners(const BoardScene& scene, std::size_t i) {
  const Camera camera = camera_of(scene, i);
  std::vector<Eigen::Vector2d> corners;
  corners.reserve(scene.points_in_board.size());
  for (const Eigen::Vector3d& point : scene.points_in_board) {
    const auto px = project(camera, scene.cam_from_board[i] * point);
    corners.push_back(px ? *px : Eigen::Vector2d::Constant(std::numeric_limits<double>::quiet_NaN()));
  }
  return corners;
}

namespace {

bool is_outside(const Camera& camera, const Eigen::Vector2d& px) {
  return !(px.minCoeff() >= 0.0 && px.x() <= camera.width_px - 1.0 && px.y() <= camera.height_px - 1.0);
}

}  // namespace

std::vector<BoardView> simulate_views(const BoardScene& scene, double sigma_px, std::uint64_t seed) {
  Draws draws(seed);
  std::vector<BoardView> views;
  for (std::size_t i = 0; i < scene.cam_from_board.size(); ++i) {
    const std::vector<Eigen::Vector2d> truth = true_corners(scene, i);
    BoardView view{photo_name(i), {}};
    for (std::size_t k = 0; k < truth.size(); ++k) {
      const Eigen::Vector2d noise = sigma_px * draws.normal2();
      if (!truth[k].allFinite() || (scene.autofocus != 0.0 && is_outside(scene.camera, truth[k]))) continue;
      view.corners.push_back(
          {static_cast<int>(k), truth[k] + noise, sigma_px * sigma_px * Eigen::Matrix2d::Identity()});
    }
    views.push_back(std::move(view));
  }
  return views;
}

void add_shared_errors(const BoardScene& scene, double sigma_px, std::uint64_t seed, std::vector<BoardView>& views) {
  Draws draws(seed);
  const std::vector<Eigen::Vector3d> printed = points_in_board(scene.board);
  const Eigen::Vector3d centre = 0.5 * (printed.front() + printed.back());
  const Eigen::Vector3d half = (0.5 * (printed.back() - printed.front())).cwiseAbs().cwiseMax(1e-12);
  for (BoardView& view : views) {
    Eigen::Matrix<double, 2, 6> field;
    for (int term = 0; term < 6; ++term) field.col(term) = sigma_px * draws.normal2();
    for (Corner& corner : view.corners) {
      const Eigen::Vector3d q = (printed[static_cast<std::size_t>(corner.index)] - centre).cwiseQuotient(half);
      Eigen::Vector<double, 6> terms;
      terms << 1.0, q.x(), q.y(), q.x() * q.x(), q.x() * q.y(), q.y() * q.y();
      corner.px += field * terms;
    }
  }
}

std::string photo_name(std::size_t i) {
  const std::string number = std::to_string(i + 1);
  return "board_" + std::string(number.size() < 3 ? 3 - number.size() : 0, '0') + number + ".png";
}

}  // namespace alidade
