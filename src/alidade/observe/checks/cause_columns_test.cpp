#include "alidade/observe/checks/cause_columns.h"

#include <gtest/gtest.h>

#include <functional>

#include "alidade/geometry/so3.h"
#include "alidade/simulate/rotation.h"

namespace alidade {
namespace {

constexpr double gap_s = 0.25;

std::vector<RotationFrame> frames_read(const RotationLog& log) {
  std::vector<RotationFrame> frames;
  MotionReader reader(log.source, gap_s);
  for (const RotationRow& row : log.rows) frames.push_back(reader.next(row));
  return frames;
}

/// A camera with a lens, askew, that rotates with a head; three points in every tenth frame.
struct Turning {
  RotationLog log;
  Adjustment reference;

  Turning() {
    RotationScene scene;
    scene.start_px = {{390.0, 290.0}};
    scene.motion = [](double t_s) { return Eigen::Vector3d(paper_pan_tilt(t_s, 0.0)); };
    RotationLogConfig config;
    config.source = RotationSource::head;
    config.duration_s = 3.0;
    log = simulate_rotation(scene, config, 1);
    RotatingCamera& camera = reference.solution.camera;
    camera.k = {1.8, 1.7, 0.02, -0.03};
    camera.k1 = -0.1, camera.k2 = 0.03, camera.k3 = 0.01, camera.p1 = 0.002, camera.p2 = -0.003;
    camera.cam_from_mount = exp_so3(Eigen::Vector3d(0.03, -0.05, 0.1));
    reference.bundle.frames = frames_read(log);
    for (const Eigen::Vector2d& ab : {Eigen::Vector2d(0.2, 0.1), Eigen::Vector2d(-0.2, 0.15), Eigen::Vector2d(0, -0.2)})
      reference.solution.points.push_back({.ab = ab});
    reference.bundle.points = reference.solution.points;
    for (int frame = 0; frame < static_cast<int>(log.rows.size()); frame += 10) {
      for (int point = 0; point < 3; ++point) reference.bundle.observations.push_back({frame, point, px(frame, point)});
    }
  }

  [[nodiscard]] Eigen::Vector2d px(int frame, int point) const {
    return px_by(reference.solution.camera, reference.bundle.frames, frame, point, 0.0);
  }

  [[nodiscard]] Eigen::Vector2d px_by(const RotatingCamera& camera, const std::vector<RotationFrame>& frames, int frame,
                                      int point, double inverse_depth) const {
    BearingPoint bearing = reference.solution.points[static_cast<std::size_t>(point)];
    bearing.inverse_depth = inverse_depth;
    return RotationView(camera, frames[static_cast<std::size_t>(frame)]).project(bearing).value();
  }
};

int column_of(const CauseColumns& columns, const std::string& cause, const std::string& member) {
  for (const CauseColumns::Group& group : columns.groups()) {
    for (const int column : group.columns) {
      if (group.name == cause && columns.column(column).member == member) return column;
    }
  }
  ADD_FAILURE() << "no " << cause << " " << member;
  return 0;
}

using PixelOf = std::function<Eigen::Vector2d(const BundleObservation&, double amount)>;

void expect_derivative(const Turning& turning, const std::string& cause, const std::string& member, const PixelOf& of,
                       double tolerance) {
  CauseColumns columns(turning.log, turning.reference, {{}, gap_s, 1.5, {}});
  const int column = column_of(columns, cause, member);
  RotationPrediction p;
  Eigen::MatrixXd by_causes(2, columns.size());
  constexpr double h = 1e-5;
  double largest = 0.0;
  for (const BundleObservation& seen : turning.reference.bundle.observations) {
    columns.begin_frame(seen.frame);
    ASSERT_TRUE(columns.at(seen, p, by_causes));
    const Eigen::Vector2d derivative = (of(seen, h) - of(seen, -h)) / (2.0 * h);
    EXPECT_NEAR((by_causes.col(column) - derivative).norm(), 0.0, tolerance)
        << cause << " " << member << ", frame " << seen.frame << ", point " << seen.point;
    largest = std::max(largest, derivative.norm());
  }
  EXPECT_GT(largest, 20.0 * tolerance) << cause << " " << member;
}

/// With h = 1e-5 differences are right to 1e-9.
TEST(CauseColumns, OfTheCameraAreTheDerivatives) {
  const Turning turning;
  const auto of_camera = [&](const std::function<void(RotatingCamera&, const BundleObservation&, double)>& change,
                             double inverse_depth = 0.0) {
    return [&turning, change, inverse_depth](const BundleObservation& seen, double amount) {
      RotatingCamera camera = turning.reference.solution.camera;
      change(camera, seen, amount);
      return turning.px_by(camera, turning.reference.bundle.frames, seen.frame, seen.point, inverse_depth);
    };
  };
  constexpr double exact = 1e-7;
  const auto lens = [&](const char* name, double RotatingCamera::*value, const char* group) {
    expect_derivative(turning, group, name,
                      of_camera([value](RotatingCamera& c, const BundleObservation&, double a) { c.*value += a; }),
                      exact);
  };
  lens("k1", &RotatingCamera::k1, "k1");
  lens("k2", &RotatingCamera::k2, "k2");
  lens("k3", &RotatingCamera::k3, "k3");
  lens("p1", &RotatingCamera::p1, "p1,p2");
  lens("p2", &RotatingCamera::p2, "p1,p2");
  static constexpr const char* axes[] = {"x", "y", "z"};
  for (int i = 0; i < 3; ++i) {
    expect_derivative(turning, "mount", std::string("about ") + axes[i],
                      of_camera([i](RotatingCamera& c, const BundleObservation&, double a) {
                        c.cam_from_mount = c.cam_from_mount * exp_so3(Eigen::Vector3d(a * Eigen::Vector3d::Unit(i)));
                      }),
                      exact);
    // At depth one a lever is itself over the distance.
    expect_derivative(turning, "lever", std::string(axes[i]) + " over distance",
                      of_camera([i](RotatingCamera& c, const BundleObservation&, double a) { c.lever_m[i] = a; }, 1.0),
                      exact);
  }
  expect_derivative(turning, "delay", "delay",
                    of_camera([](RotatingCamera& c, const BundleObservation&, double a) { c.delay_s = a; }), exact);
  expect_derivative(
      turning, "rolling shutter", "from top to bottom",
      of_camera([](RotatingCamera& c, const BundleObservation& seen, double a) { c.delay_s = a * seen.px.y() / 1.5; }),
      exact);
  const double end_s = turning.log.rows.back().t_s;
  expect_derivative(turning, "focal length that drifts", "f'/f",
                    of_camera([&](RotatingCamera& c, const BundleObservation& seen, double a) {
                      const double t_s = turning.log.rows[static_cast<std::size_t>(seen.frame)].t_s;
                      c.k.head<2>() *= 1.0 + a * (t_s - 0.5 * end_s);
                    }),
                    exact);
}

/// Patterns are one-sided differences with a step of 1e-5: right to that times a curvature of about one.
TEST(CauseColumns, OfTheRotationAreTheDerivatives) {
  const Turning turning;
  const auto of_angles = [&](Eigen::Index axis, const std::function<double(double angle, double t_s)>& error) {
    return [&turning, axis, error](const BundleObservation& seen, double amount) {
      RotationLog log = turning.log;
      for (RotationRow& row : log.rows) {
        double& angle = row.pan_tilt_roll_rad[axis];
        angle += amount * error(angle, row.t_s);
      }
      return turning.px_by(turning.reference.solution.camera, frames_read(log), seen.frame, seen.point, 0.0);
    };
  };
  constexpr double nearly = 1e-4;
  static constexpr const char* members[] = {"of pan", "of tilt"};
  for (int axis = 0; axis < 2; ++axis) {
    const std::string member = members[axis];
    expect_derivative(turning, "encoder scale", member, of_angles(axis, [](double a, double) { return a; }), nearly);
    expect_derivative(turning, "zero that drifts", member, of_angles(axis, [](double, double t) { return t; }), nearly);
    expect_derivative(turning, "error of the angles within a turn", "sin 2× " + member,
                      of_angles(axis, [](double a, double) { return std::sin(2.0 * a); }), nearly);
  }
  // The paper's sway at another time; the ends of the log keep theirs.
  const double mid_s = 0.5 * turning.log.rows.back().t_s;
  const auto by_clock = [&](const BundleObservation& seen, double amount) {
    RotationLog log = turning.log;
    for (std::size_t k = 1; k + 1 < log.rows.size(); ++k) {
      RotationRow& row = log.rows[k];
      row.pan_tilt_roll_rad.head<2>() = paper_pan_tilt(row.t_s + amount * (row.t_s - mid_s), 0.0).head<2>();
    }
    return turning.px_by(turning.reference.solution.camera, frames_read(log), seen.frame, seen.point, 0.0);
  };
  expect_derivative(turning, "clock rate", "clock rate", by_clock, 3e-4);
}

}  // namespace
}  // namespace alidade
