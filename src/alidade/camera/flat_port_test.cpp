#include "alidade/camera/flat_port.h"

#include <gtest/gtest.h>

#include <Eigen/Geometry>

#include <cmath>
#include <cstdlib>
#include <filesystem>
#include <fstream>
#include <limits>
#include <nlohmann/json.hpp>
#include <numbers>

#include "alidade/camera/camera.h"
#include "alidade/geometry/so3.h"
#include "alidade/testing/random.h"
#include "alidade/testing/reference_case.h"

namespace alidade {
namespace {

/// A barrel lens behind a port tilted by 3.6°.
Params<FlatPort> example_params() {
  Params<FlatPort> p;
  p << 576.0, 574.0, 384.0, 288.0, 0.4, -0.25, 0.08, 6e-4, -4e-4, -0.01, 0.03, 0.012, 1.5, 1.34, 0.05, -0.04;
  return p;
}

/// A point in water that the image shows, 0.1 to 4 m deep.
Eigen::Vector3d random_point(std::mt19937_64& rng, double max_angle_rad) {
  std::uniform_real_distribution<> angle(0.0, max_angle_rad), azimuth(-std::numbers::pi, std::numbers::pi),
      depth_m(0.1, 4.0);
  const double phi = azimuth(rng), z = depth_m(rng), tan = std::tan(angle(rng));
  return {z * tan * std::cos(phi), z * tan * std::sin(phi), z};
}

/// Direction beyond a surface of normal n (both unit), by Snell's law as vectors; none where all is reflected.
std::optional<Eigen::Vector3d> refracted(const Eigen::Vector3d& direction, const Eigen::Vector3d& n, double from,
                                         double to) {
  const Eigen::Vector3d tangential = from / to * (direction - direction.dot(n) * n);
  const double rest = 1.0 - tangential.squaredNorm();
  if (rest < 0.0) return std::nullopt;
  return tangential + std::sqrt(rest) * n;
}

/// The ray of a direction in air, traced from plane to plane without the axial formula.
std::optional<ObservationRay> traced(const Params<FlatPort>& p, const Eigen::Vector3d& in_air) {
  const Eigen::Vector3d n = FlatPort::normal(p);
  const Eigen::Vector3d inner = in_air * (p[10] / in_air.dot(n));
  const auto in_glass = refracted(in_air, n, 1.0, p[12]);
  const Eigen::Vector3d outer = inner + *in_glass * (p[11] / in_glass->dot(n));
  const auto in_water = refracted(*in_glass, n, p[12], p[13]);
  if (!in_water) return std::nullopt;
  return ObservationRay{outer, *in_water};
}

TEST(FlatPort, SeesThePointThatARayTracedThroughThePortHits) {
  auto rng = testing::make_rng();
  std::uniform_real_distribution<> u(20.0, 748.0), v(20.0, 556.0), distance_m(0.05, 5.0), gap_m(0.0, 0.1),
      glass_m(0.0, 0.03), tilt(-0.08, 0.08);
  for (int i = 0; i < 2000; ++i) {
    Params<FlatPort> p = example_params();
    p.segment<2>(10) << gap_m(rng), glass_m(rng);
    p.tail<2>() << tilt(rng), tilt(rng);
    const Eigen::Vector2d px(u(rng), v(rng));
    const auto in_air = Brown::unproject(FlatPort::air_lens(p), px);
    ASSERT_TRUE(in_air);
    const auto ray = traced(p, *in_air);
    ASSERT_TRUE(ray);
    const Eigen::Vector3d point_in_cam = ray->origin_in_cam + distance_m(rng) * ray->direction_in_cam;
    const auto seen = FlatPort::project(p, point_in_cam);
    ASSERT_TRUE(seen) << point_in_cam.transpose();
    EXPECT_LT((*seen - px).norm(), 1e-9) << px.transpose();
    const auto ours = FlatPort::observation_ray(p, FlatPort::domain(p), px);
    ASSERT_TRUE(ours);
    EXPECT_LT((ours->origin_in_cam - ray->origin_in_cam).norm(), 1e-14);  // 0.1 m by rounding
    EXPECT_LT((ours->direction_in_cam - ray->direction_in_cam).norm(), 1e-14);
    EXPECT_EQ(FlatPort::unproject(p, px), ours->direction_in_cam);
  }
}

TEST(FlatPort, GoesForthAndBackToTheSamePixel) {
  auto rng = testing::make_rng();
  const Camera camera{768, 576, Calibrated<FlatPort>{example_params()}, {}, 0.0, {}};
  EXPECT_FALSE(is_central(camera.lens));
  for (int i = 0; i < 2000; ++i) {
    const Eigen::Vector3d point_in_cam = random_point(rng, 0.5);
    const auto px = project(camera, point_in_cam);
    ASSERT_TRUE(px);
    const auto ray = observation_ray(camera, *px);
    ASSERT_TRUE(ray);
    const Eigen::Vector3d from = point_in_cam - ray->origin_in_cam;
    EXPECT_LT(from.cross(ray->direction_in_cam).norm(), 1e-12 * (1.0 + from.norm()));
    const auto again = point_at_range(*ray, point_in_cam.norm());
    ASSERT_TRUE(again);
    EXPECT_LT((*project(camera, *again) - *px).norm(), 1e-9);
  }
}

TEST(FlatPort, DerivativesMatchCentralDifferences) {
  auto rng = testing::make_rng();
  const auto params = example_params();
  const Eigen::Vector3d n = FlatPort::normal(params);
  for (const double max_angle_rad : {0.0, 1e-9, 1e-4, 0.5}) {
    for (int draw = 0; draw < 200; ++draw) {
      Eigen::Vector3d point_in_cam = random_point(rng, max_angle_rad);
      if (draw % 2 == 0) point_in_cam = rotation_between(Eigen::Vector3d::UnitZ(), n) * point_in_cam;
      const auto at = FlatPort::project_with_jacobians(params, point_in_cam);
      ASSERT_TRUE(at);
      EXPECT_EQ(at->px, *FlatPort::project(params, point_in_cam));
      // Steps of 10⁻⁵ of each own size; errors of the differences: rounding 10⁻¹³·10³/10⁻⁵ and h² f'''/6 of up to 10⁻⁷
      // of the largest entry near the port.
      for (int i = 0; i < 3; ++i) {
        const double h = 1e-5 * point_in_cam.z();
        const auto ahead = FlatPort::project(params, point_in_cam + h * Eigen::Vector3d::Unit(i));
        const auto behind = FlatPort::project(params, point_in_cam - h * Eigen::Vector3d::Unit(i));
        const Eigen::Vector2d numeric = (*ahead - *behind) / (2.0 * h);
        EXPECT_LT((at->J_px_point.col(i) - numeric).norm(), 1e-6 * (1.0 + at->J_px_point.norm())) << i;
      }
      for (int i = 0; i < FlatPort::num_params; ++i) {
        const double h = 1e-5 * (i == 10 || i == 11 ? 0.1 : 1.0);
        const auto ahead = FlatPort::project(params + h * Params<FlatPort>::Unit(i), point_in_cam);
        const auto behind = FlatPort::project(params - h * Params<FlatPort>::Unit(i), point_in_cam);
        ASSERT_TRUE(ahead && behind);
        const Eigen::Vector2d numeric = (*ahead - *behind) / (2.0 * h);
        EXPECT_LT((at->J_px_params.col(i) - numeric).norm(), 1e-6 * (1.0 + at->J_px_params.col(i).norm()))
            << FlatPort::param_names.at(std::size_t(i)) << " at " << point_in_cam.transpose();
      }
    }
  }
}

TEST(FlatPort, WithoutPortOrWaterIsTheBrownLens) {
  auto rng = testing::make_rng();
  Params<FlatPort> p = example_params();
  p[12] = p[13] = 1.0;  // air everywhere
  for (int i = 0; i < 500; ++i) {
    const Eigen::Vector3d point_in_cam = random_point(rng, 0.6);
    const auto seen = FlatPort::project(p, point_in_cam), brown = Brown::project(FlatPort::air_lens(p), point_in_cam);
    ASSERT_TRUE(seen && brown);
    EXPECT_LT((*seen - *brown).norm(), 1e-9);
  }
}

TEST(FlatPort, SeesNothingWhereThereIsNoWater) {
  const auto p = example_params();
  const Eigen::Vector3d n = FlatPort::normal(p);
  EXPECT_FALSE(FlatPort::project(p, 0.03 * n));   // on the glass
  EXPECT_FALSE(FlatPort::project(p, 0.041 * n));  // inside it
  EXPECT_TRUE(FlatPort::project(p, 0.0421 * n));
  EXPECT_FALSE(FlatPort::project(p, -n));
  EXPECT_FALSE(FlatPort::project(p, Eigen::Vector3d::Zero()));
  EXPECT_FALSE(FlatPort::project_with_jacobians(p, -n));
}

TEST(FlatPort, ALensOnTheGlassSeesNoFurtherThanTotalReflection) {
  Params<FlatPort> p = example_params();
  p.segment<5>(5).setZero();  // no fold of its own
  p[10] = p[11] = 0.0;
  p.tail<2>().setZero();
  const double critical = std::tan(std::asin(1.0 / 1.34));
  EXPECT_TRUE(FlatPort::project(p, {0.98 * critical, 0.0, 1.0}));
  EXPECT_FALSE(FlatPort::project(p, {1.0001 * critical, 0.0, 1.0}));
  EXPECT_FALSE(FlatPort::project(p, {3.0 * critical, 0.0, 1.0}));
  p[10] = 0.05;  // in front of a gap every point of the glass is seen, at grazing angles
  EXPECT_TRUE(FlatPort::project(p, {3.0 * critical, 0.0, 1.0}));
}

TEST(FlatPort, TheFoldIsThatOfTheLensInAir) {
  Params<FlatPort> p = example_params();
  p.segment<5>(5) << -0.45, 0.07, 0.0, 0.0, 0.0;
  p.tail<2>().setZero();
  const double fold_rad = std::atan(Brown::max_radius(FlatPort::air_lens(p)));
  const auto water = [&](double in_air_rad) { return std::tan(std::asin(std::sin(in_air_rad) / 1.34)); };
  EXPECT_TRUE(FlatPort::project(p, {100.0 * water(fold_rad - 0.02), 0.0, 100.0}));
  EXPECT_FALSE(FlatPort::project(p, {100.0 * water(fold_rad + 0.02), 0.0, 100.0}));
}

TEST(FlatPort, AnswersNothingToNonsense) {
  const auto good = example_params();
  const Eigen::Vector3d point_in_cam(0.1, 0.2, 1.0);
  const double nan = std::nan(""), inf = std::numeric_limits<double>::infinity();
  for (const double bad : {nan, inf, -inf, 1e300}) {
    for (int i = 0; i < 3; ++i) {
      Eigen::Vector3d broken = point_in_cam;
      broken[i] = bad;
      EXPECT_FALSE(FlatPort::project(good, broken));
      EXPECT_FALSE(FlatPort::project_with_jacobians(good, broken));
    }
    for (int i = 10; i < 16; ++i) {
      Params<FlatPort> p = good;
      p[i] = bad;
      EXPECT_FALSE(FlatPort::project(p, point_in_cam)) << bad << " in " << FlatPort::param_names.at(std::size_t(i));
      EXPECT_FALSE(FlatPort::unproject(p, {300.0, 200.0})) << bad << " in " << FlatPort::param_names.at(std::size_t(i));
    }
    EXPECT_FALSE(FlatPort::unproject(good, {bad, 200.0}));
  }
  for (const auto& [at, value] : {std::pair{10, -0.05}, {11, -0.01}, {12, 0.9}, {13, 0.0}, {14, 1.1}}) {
    Params<FlatPort> p = good;
    p[at] = value;
    EXPECT_FALSE(FlatPort::project(p, point_in_cam)) << at;
  }
  EXPECT_FALSE(FlatPort::project(Params<FlatPort>::Zero(), point_in_cam));
}

TEST(FlatPort, ARayBeginsBeyondSmallRanges) {
  const Camera camera{768, 576, Calibrated<FlatPort>{example_params()}, {}, 0.0, {}};
  const auto ray = observation_ray(camera, {384.0, 288.0});
  ASSERT_TRUE(ray);
  EXPECT_FALSE(point_at_range(*ray, 0.01));
  EXPECT_NEAR(point_at_range(*ray, 1.0)->norm(), 1.0, 1e-14);
}

nlohmann::json recorded(const std::string& file) {
  return nlohmann::json::parse(std::ifstream(testing::reference_case(file)));
}

Eigen::Vector3d vector_of(const nlohmann::json& values) {
  return {values[0].get<double>(), values[1].get<double>(), values[2].get<double>()};
}

// Directions in air and pixels of four ports, by a program of others.
TEST(FlatPort, AgreesWithRecordedRefraction) {
  const nlohmann::json cases = recorded("d3_flat_port.json");
  const double tolerance = cases["tol"];
  int checked = 0;
  for (const auto& row : cases["rows"]) {
    const Eigen::Vector3d normal = vector_of(row["normal"]);
    Params<FlatPort> p = Params<FlatPort>::Zero();
    p.head<4>() << 576.0, 576.0, 384.0, 288.0;
    p.tail<6>() << row["gap_m"], row["glass_m"], row["n_glass"], row["n_water"], normal.x(), normal.y();
    for (std::size_t i = 0; i < row["P"].size(); ++i, ++checked) {
      const auto px = FlatPort::project(p, vector_of(row["P"][i]));
      ASSERT_TRUE(px);
      const Eigen::Vector2d expected(row["uv_f576"][i][0], row["uv_f576"][i][1]);
      EXPECT_LT((*px - expected).norm(), tolerance);
      const auto in_air = Brown::unproject(FlatPort::air_lens(p), *px);
      EXPECT_LT((*in_air - vector_of(row["dir_air"][i])).norm(), tolerance);
    }
  }
  EXPECT_GE(checked, 20);
}

}  // namespace
}  // namespace alidade
