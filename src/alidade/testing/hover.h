#pragma once

#include <Eigen/LU>
#include <cmath>
#include <numbers>
#include <optional>
#include <set>
#include <vector>

#include "alidade/localize.h"
#include "alidade/simulate/draws.h"

namespace alidade::testing {

enum class HoverLens { brown, fisheye, port };

/// A camera that hovers before six known points of a plane and sixty others around and behind it: `localize` in its own
/// simplest case, all given right. Pixels by formulas that share no code with the library's lenses.
struct Hover {
  HoverLens lens = HoverLens::brown;
  int num_frames = 300, num_others = 60;
  double dt_s = 1.0 / 30.0;
  double sigma_px = 0.5, sigma_known_m = 0.001;
  double lasting = 0.0;  ///< Correlation of a point's pixel errors from frame to frame: as a drifting track has them.
  double loose = 1.0;    ///< By which every third point's errors are larger, as of corners of two surfaces.
  double distance_m = 0.9;
  bool is_wall = false;  ///< The others are on an oblique wall behind the target.
  double sway = 1.0;     ///< Share of its translation: at 0 it rotates in place,
  double turn = 1.0;     ///< and of its rotation: at 0 of both it stands still.
  // What is not as given.
  double readout_s = 0.0;         ///< From the first row to the last, the time being that of the central one.
  double target_speed_m_s = 0.0;  ///< Along x, against the other points.
  Eigen::Vector3d target_turn_rad_s = Eigen::Vector3d::Zero();  ///< Of it about its origin.
  double target_stretch = 0.0;                                  ///< Of the known points along x, relative.
  double max_mismatched_px = 20.0;  ///< Of a share of the observations after the first frame, in each coordinate.
  double mismatches = 0.0;
};

struct HoverRun {
  Camera camera;
  std::vector<ObservationFrame> frames;
  std::vector<TimedPose> truth;
  std::vector<KnownPoint> target;
  std::vector<Eigen::Vector3d> points;  ///< Of ids from 1 on.
};

namespace hover {

inline Camera camera_of(HoverLens lens) {
  switch (lens) {
    case HoverLens::fisheye: {
      Calibrated<KannalaBrandt> fisheye;
      fisheye.params << 290.0, 291.0, 380.0, 288.0, 0.0, -0.012, 0.005, -0.0015, 0.0001;
      return {768, 576, fisheye, {}, 0.0, {}};
    }
    case HoverLens::port: {
      Calibrated<FlatPort> port;
      port.params << 560.0, 561.0, 386.0, 286.0, 0.0, -0.1, 0.02, 0.0005, -0.0004, 0.0, 0.03, 0.008, 1.49, 1.335, 0.01,
          -0.015;
      return {768, 576, port, {}, 0.0, {}};
    }
    default: {
      Calibrated<Brown> brown;
      brown.params << 610.0, 612.0, 386.0, 286.0, 0.0, -0.25, 0.08, 0.001, -0.0007, 0.0;
      return {768, 576, brown, {}, 0.0, {}};
    }
  }
}

/// Brown: p is fx fy cx cy skew k1 k2 p1 p2 k3. Textbook form; beyond r 0.95 its polynomial may fold.
inline std::optional<Eigen::Vector2d> brown_px(const double* p, double x, double y) {
  const double r2 = x * x + y * y, radial = 1.0 + r2 * (p[5] + r2 * (p[6] + r2 * p[9]));
  if (r2 > 0.9) return std::nullopt;
  const double xd = x * radial + 2.0 * p[7] * x * y + p[8] * (r2 + 2.0 * x * x);
  const double yd = y * radial + p[7] * (r2 + 2.0 * y * y) + 2.0 * p[8] * x * y;
  return Eigen::Vector2d(p[0] * (xd + p[4] * yd) + p[2], p[1] * yd + p[3]);
}

inline std::optional<Eigen::Vector2d> fisheye_px(const double* p, const Eigen::Vector3d& c) {
  const double rho = std::hypot(c.x(), c.y()), theta = std::atan2(rho, c.z()), t2 = theta * theta;
  if (theta > 1.4) return std::nullopt;
  const double scale = theta * (1.0 + t2 * (p[5] + t2 * (p[6] + t2 * (p[7] + t2 * p[8])))) / std::max(rho, 1e-12);
  return Eigen::Vector2d(p[0] * scale * c.x() + p[2], p[1] * scale * c.y() + p[3]);
}

/// Snell's law in three layers, s = sin of the angle in air, by bisection.
inline std::optional<Eigen::Vector2d> port_px(const double* p, const Eigen::Vector3d& c) {
  const double gap = p[10], glass = p[11], n_glass = p[12], n_water = p[13];
  const Eigen::Vector3d n(p[14], p[15], std::sqrt(1.0 - p[14] * p[14] - p[15] * p[15]));
  const double z = n.dot(c);
  const Eigen::Vector3d aside = c - z * n;
  const double rho = aside.norm();
  if (z < gap + glass + 0.05) return std::nullopt;
  double low = 0.0, high = 0.999;
  for (int i = 0; i < 80; ++i) {
    const double s = 0.5 * (low + high);
    const double reached = gap * s / std::sqrt(1.0 - s * s) + glass * s / std::sqrt(n_glass * n_glass - s * s) +
                           (z - gap - glass) * s / std::sqrt(n_water * n_water - s * s);
    (reached < rho ? low : high) = s;
  }
  const double s = 0.5 * (low + high);
  const Eigen::Vector3d in_air = s / std::max(rho, 1e-12) * aside + std::sqrt(1.0 - s * s) * n;
  return brown_px(p, in_air.x() / in_air.z(), in_air.y() / in_air.z());
}

inline std::optional<Eigen::Vector2d> seen(HoverLens lens, const Eigen::VectorXd& p, const Eigen::Vector3d& c) {
  if (c.z() < 0.1) return std::nullopt;
  const auto px = lens == HoverLens::fisheye ? fisheye_px(p.data(), c)
                  : lens == HoverLens::port  ? port_px(p.data(), c)
                                             : brown_px(p.data(), c.x() / c.z(), c.y() / c.z());
  if (!px || px->minCoeff() < 0.0 || px->x() > 767.0 || px->y() > 575.0) return std::nullopt;
  return px;
}

/// Sines of position and of the rotation vector.
struct Motion {
  Eigen::Vector<double, 6> amplitude, frequency_hz, phase;
  double distance_m = 0.0;

  [[nodiscard]] Rigid3 at(double t_s) const {
    Eigen::Vector<double, 6> at;
    for (int i = 0; i < 6; ++i)
      at[i] = amplitude[i] * std::sin(2.0 * std::numbers::pi * frequency_hz[i] * t_s + phase[i]);
    return Rigid3{exp_so3(at.tail<3>()), at.head<3>() - Eigen::Vector3d(0.0, 0.0, distance_m)};
  }
};

inline Motion motion_of(const Hover& scene, Draws& draws) {
  Motion motion{.distance_m = scene.distance_m};
  motion.amplitude << 0.17, 0.13, 0.14, 0.13, 0.13, 0.13;
  for (int i = 0; i < 6; ++i) {
    motion.frequency_hz[i] = draws.uniform(0.1, 0.3);
    motion.phase[i] = draws.uniform(0.0, 2.0 * std::numbers::pi);
  }
  motion.amplitude.head<3>() *= scene.sway;
  motion.amplitude.tail<3>() *= scene.turn;
  return motion;
}

/// The points of the target, which are also given, and others.
inline std::vector<Eigen::Vector3d> points_of(const Hover& scene, Draws& draws, HoverRun& run) {
  std::vector<Eigen::Vector3d> points{{-0.15, -0.1, 0.0}, {0.15, -0.1, 0.0}, {0.15, 0.1, 0.0},
                                      {-0.15, 0.1, 0.0},  {0.05, 0.0, 0.0},  {-0.05, 0.05, 0.0}};
  for (std::size_t i = 0; i < points.size(); ++i) {
    Eigen::Vector3d given = points[i] + scene.sigma_known_m * draws.normal3();
    given.x() *= 1.0 + scene.target_stretch;
    run.target.push_back({static_cast<long>(i) + 1, given, scene.sigma_known_m});
  }
  const double wide = scene.lens == HoverLens::fisheye ? 2.0 : 1.0;
  for (int i = 0; i < scene.num_others; ++i) {
    const double x = wide * draws.uniform(-0.8, 0.8), y = wide * draws.uniform(-0.6, 0.6), z = draws.uniform(-0.2, 0.9);
    points.emplace_back(x, y, scene.is_wall ? 0.1 + 0.15 * x - 0.1 * y : z);
  }
  return points;
}

/// Where a point is seen, its row exposed when it is.
inline std::optional<Eigen::Vector2d> seen_at(const Hover& scene, const Eigen::VectorXd& lens, const Motion& motion,
                                              const Eigen::Vector3d& point, double t_s) {
  auto px = seen(scene.lens, lens, motion.at(t_s).inverse() * point);
  for (int again = 0; again < 4 && px && scene.readout_s > 0.0; ++again)
    px = seen(scene.lens, lens, motion.at(t_s + scene.readout_s * (px->y() / 576.0 - 0.5)).inverse() * point);
  return px;
}

}  // namespace hover

inline HoverRun hovering(const Hover& scene, std::uint64_t seed) {
  Draws draws(seed);
  HoverRun run;
  run.camera = hover::camera_of(scene.lens);
  const Eigen::VectorXd lens = params(run.camera.lens);
  run.points = hover::points_of(scene, draws, run);
  const hover::Motion motion = hover::motion_of(scene, draws);
  std::vector<Eigen::Vector2d> errors_px(run.points.size());
  for (int k = 0; k < scene.num_frames; ++k) {
    const double t_s = k * scene.dt_s;
    ObservationFrame frame{k, t_s, {}};
    for (std::size_t i = 0; i < run.points.size(); ++i) {
      Eigen::Vector2d noise = scene.sigma_px * draws.normal2();
      if (k > 0) noise = scene.lasting * errors_px[i] + std::sqrt(1.0 - scene.lasting * scene.lasting) * noise;
      errors_px[i] = noise;
      if (scene.mismatches > 0.0 && draws.uniform() < scene.mismatches && k > 0)
        noise = scene.max_mismatched_px * Eigen::Vector2d(draws.uniform(-1.0, 1.0), draws.uniform(-1.0, 1.0));
      Eigen::Vector3d point = run.points[i];
      if (i < run.target.size())
        point =
            exp_so3(t_s * scene.target_turn_rad_s) * point + scene.target_speed_m_s * t_s * Eigen::Vector3d::UnitX();
      const auto px = hover::seen_at(scene, lens, motion, point, t_s);
      if (i % 3 == 0) noise *= scene.loose;
      if (px) frame.observations.push_back({static_cast<long>(i) + 1, *px + noise, 0.0});
    }
    run.frames.push_back(std::move(frame));
    run.truth.push_back({t_s, motion.at(t_s)});
  }
  return run;
}

/// eᵀ P⁻¹ e / 6 of a pose, e its right perturbation.
inline double pose_nees(const PathStep& step, const Rigid3& truth) {
  const Rigid3 is_from_true = step.world_from_cam.inverse() * truth;
  Eigen::Vector<double, 6> e;
  e << is_from_true.translation, log_so3(is_from_true.rotation);
  return e.dot(step.cov.inverse() * e) / 6.0;
}

}  // namespace alidade::testing
