#include "alidade/pantilt/head.h"

#include <gtest/gtest.h>

#include <cstdlib>
#include <fstream>
#include <nlohmann/json.hpp>
#include <numbers>

#include "alidade/pantilt/head_rotation.h"
#include "alidade/simulate/example_camera.h"
#include "alidade/testing/random.h"
#include "alidade/testing/reference_case.h"

namespace alidade {
namespace {

using Json = nlohmann::json;

Eigen::Vector3d random_vector(std::mt19937_64& rng, double size) {
  std::uniform_real_distribution<double> uniform(-size, size);
  return {uniform(rng), uniform(rng), uniform(rng)};
}

RigHead random_head(std::mt19937_64& rng) {
  RigHead drawn{{}, *example_camera("brown", 800, 600)};
  drawn.head.world_from_base = {exp_so3(random_vector(rng, 0.2)), random_vector(rng, 0.5)};
  drawn.head.pan_to_tilt_m = random_vector(rng, 0.05);
  drawn.head.tilt_to_cam_m = random_vector(rng, 0.05);
  drawn.head.cam_from_tilt = exp_so3(random_vector(rng, 0.1));
  drawn.head.encoder = {.pan_zero_rad = 0.03, .tilt_zero_rad = -0.04, .pan_scale = 1.01, .tilt_scale = 0.985};
  drawn.head.encoder.pan_cos_rad = 0.01;
  drawn.head.encoder.pan_sin_rad = -0.02;
  drawn.head.encoder.tilt_cos_rad = 0.03;
  drawn.head.encoder.tilt_sin_rad = 0.015;
  drawn.head.axes_skew_rad = 0.02;
  return drawn;
}

/// A point that a head at these readings sees off its axis.
Eigen::Vector3d point_in_observation(const RigHead& rig_head, const Eigen::Vector2d& readings, std::mt19937_64& rng) {
  const Eigen::Vector3d point_in_cam = Eigen::Vector3d(0.0, 0.0, 2.0) + random_vector(rng, 0.4);
  return world_from_cam(rig_head.head, readings) * point_in_cam;
}

Eigen::Vector2d pixel(const RigHead& rig_head, const Eigen::Vector2d& readings, const Eigen::Vector3d& point) {
  const auto seen = project(rig_head, readings, point);
  EXPECT_TRUE(seen.has_value());
  return seen ? seen->px : Eigen::Vector2d::Zero();
}

constexpr double step = 1e-6;
// Central differences of pixels of size 10³: truncation ~ f·step² ~ 10⁻⁹, rounding 10⁻¹³·10³/step ~ 10⁻⁷ px a unit.
constexpr double derivative_tolerance = 3e-6;

TEST(Head, JacobiansAreTheDerivatives) {
  std::mt19937_64 rng = testing::make_rng();
  int num_checked = 0;
  for (int i = 0; i < 50; ++i) {
    const RigHead at = random_head(rng);
    const Eigen::Vector2d readings = random_vector(rng, 0.6).head<2>();
    const Eigen::Vector3d point = point_in_observation(at, readings, rng);
    const TurnedHead turned(at.head, readings);
    const auto seen = project(turned, at.camera, point);
    ASSERT_TRUE(seen);
    const Eigen::Matrix<double, 2, num_head_params> J_px_head =
        seen->J_px_point * turned.cam_from_world_rotation.transpose() * turned.J_point_head(seen->point_in_cam);
    const auto expect_column = [&](const Eigen::Vector2d& plus, const Eigen::Vector2d& minus, const auto& column) {
      EXPECT_LE(((plus - minus) / (2.0 * step) - column).norm(), derivative_tolerance * std::max(1.0, column.norm()));
      ++num_checked;
    };
    for (int k = 0; k < 3; ++k) {
      const Eigen::Vector3d d = step * Eigen::Vector3d::Unit(k);
      expect_column(pixel(at, readings, point + d), pixel(at, readings, point - d), seen->J_px_point.col(k));
    }
    for (int k = 0; k < 2; ++k) {
      const Eigen::Vector2d d = step * Eigen::Vector2d::Unit(k);
      expect_column(pixel(at, readings + d, point), pixel(at, readings - d, point), seen->J_px_readings.col(k));
    }
    for (int k = 0; k < num_head_params; ++k) {
      const HeadVector d = step * HeadVector::Unit(k);
      expect_column(pixel({retract(at.head, d), at.camera}, readings, point),
                    pixel({retract(at.head, -d), at.camera}, readings, point), J_px_head.col(k));
    }
  }
  EXPECT_EQ(num_checked, 50 * 29);
}

TEST(Head, TurnsAsTheRotatingCameraDoes) {
  std::mt19937_64 rng = testing::make_rng();
  Head head;
  for (int i = 0; i < 50; ++i) {
    const Eigen::Vector3d angles = random_vector(rng, 1.4);
    const Eigen::Quaterniond world_from_cam_rotation = world_from_cam(head, angles.head<2>()).rotation;
    const Eigen::Quaterniond expected = base_from_cam_rotation({angles.x(), angles.y(), 0.0});
    EXPECT_LE(world_from_cam_rotation.angularDistance(expected), 1e-7);
  }
}

TEST(Head, PanTurnsLeftAndTiltTurnsUp) {
  const Head head;
  EXPECT_LT((world_from_cam(head, {0.3, 0.0}).rotation * Eigen::Vector3d::UnitZ()).x(), -0.2);
  EXPECT_LT((world_from_cam(head, {0.0, 0.3}).rotation * Eigen::Vector3d::UnitZ()).y(), -0.2);
}

TEST(Head, ReadingsBecomeAnglesByZeroThenScale) {
  const Encoder encoder{.pan_zero_rad = 0.1, .tilt_zero_rad = -0.2, .pan_scale = 1.5, .tilt_scale = 0.5};
  EXPECT_NEAR(encoder.angles({0.3, 0.2}).x(), 0.3, 1e-15);
  EXPECT_NEAR(encoder.angles({0.3, 0.2}).y(), 0.2, 1e-15);
  EXPECT_LE((encoder.readings(encoder.angles({0.7, -0.6})) - Eigen::Vector2d(0.7, -0.6)).norm(), 1e-15);
}

TEST(Head, AnErrorOfOnePeriodATurnIsTakenAwayAndPutBack) {
  Encoder encoder{.pan_zero_rad = 0.1, .pan_scale = 1.01};
  encoder.pan_cos_rad = 0.02;
  encoder.pan_sin_rad = -0.03;
  encoder.tilt_sin_rad = 0.05;
  const Eigen::Vector2d read(0.6, -0.4), angles = encoder.angles(read);
  EXPECT_NEAR(angles.x(), 1.01 * (0.6 + 0.02 * std::cos(0.6) - 0.03 * std::sin(0.6) - 0.1), 1e-15);
  EXPECT_NEAR(angles.y(), -0.4 + 0.05 * std::sin(-0.4), 1e-15);
  EXPECT_LE((encoder.readings(angles) - read).norm(), 1e-14);
  const Eigen::Vector2d d = Eigen::Vector2d::Constant(step);
  const Eigen::Vector2d by = (encoder.angles(read + d) - encoder.angles(read - d)) / (2.0 * step);
  EXPECT_LE((encoder.slopes(read) - by).norm(), 1e-9);
}

TEST(Head, AimPutsThePointOnTheAxisOrOnAnyRay) {
  std::mt19937_64 rng = testing::make_rng();
  int num_checked = 0;
  for (int i = 0; i < 200; ++i) {
    const RigHead at = random_head(rng);
    const Eigen::Vector3d target = Eigen::Vector3d(0.0, 0.0, 2.0) + random_vector(rng, 1.2);
    const Eigen::Vector3d ray = i % 2 ? Eigen::Vector3d(0.2, -0.1, 1.0) : Eigen::Vector3d::UnitZ();
    const auto readings = aim(at.head, target, ray);
    ASSERT_TRUE(readings) << i;
    const Eigen::Vector3d point_in_cam = cam_from_world(at.head, *readings) * target;
    EXPECT_LE(point_in_cam.normalized().cross(ray.normalized()).norm(), 1e-11) << i;
    EXPECT_GT(point_in_cam.z(), 0.0);
    ++num_checked;
  }
  EXPECT_EQ(num_checked, 200);
}

TEST(Head, AimHasNoAnswerWhereThereIsNone) {
  Head head;
  EXPECT_FALSE(aim(head, Eigen::Vector3d::Zero()));
  // A camera that looks along the tilt axis cannot be brought to look up.
  head.cam_from_tilt = exp_so3({0.0, -std::numbers::pi / 2.0, 0.0});
  EXPECT_FALSE(aim(head, {0.0, -1.0, 0.5}));
}

TEST(Head, RayOfAPixelMeetsThePoint) {
  std::mt19937_64 rng = testing::make_rng();
  for (int i = 0; i < 50; ++i) {
    const RigHead at = random_head(rng);
    const Eigen::Vector2d readings = random_vector(rng, 0.6).head<2>();
    const Eigen::Vector3d point = point_in_observation(at, readings, rng);
    const auto ray = ray_in_world(at, readings, pixel(at, readings, point));
    ASSERT_TRUE(ray);
    EXPECT_LE((point - ray->origin_in_world).cross(ray->direction_in_world).norm(), 1e-9);
    EXPECT_LE((ray->origin_in_world - cam_centre_in_world(at.head, readings)).norm(), 1e-14);
  }
}

TEST(Head, ProjectionMatrixIsThePinholeOfThatMoment) {
  const RigHead at = xiahou_rig()[1];
  const Eigen::Vector2d readings(0.2, -0.1);
  const Eigen::Vector3d point(0.1, -0.2, 1.5);
  const Eigen::Vector3d uvw = projection_matrix(at, readings) * point.homogeneous();
  EXPECT_LE((uvw.hnormalized() - pixel(at, readings, point)).norm(), 1e-10);
}

Json read_case(const std::string& name) { return Json::parse(std::ifstream(testing::reference_case(name))); }

template <int rows, int cols>
Eigen::Matrix<double, rows, cols> matrix_of(const Json& json) {
  Eigen::Matrix<double, rows, cols> m;
  for (std::size_t i = 0; i < rows; ++i)
    for (std::size_t j = 0; j < cols; ++j)
      m(int(i), int(j)) = (cols == 1 ? json.at(i) : json.at(i).at(j)).template get<double>();
  return m;
}

Eigen::Vector3d vector_of(const Json& json) { return matrix_of<3, 1>(json); }

TEST(Head, PaperGeometryAsComputedElsewhere) {
  const Json reference = read_case("c1_paper_geometry.json");
  constexpr double degree = std::numbers::pi / 180.0;
  const Eigen::Vector3d target = vector_of(reference["target_cm"]) / 100.0;
  std::array<RigHead, 2> rig = xiahou_rig();
  ASSERT_EQ(reference["heads"].size(), 2u);
  for (std::size_t i = 0; i < 2; ++i) {
    const Json& expected = reference["heads"][i];
    rig[i].head.world_from_base.translation = vector_of(expected["position_cm"]) / 100.0;
    const Eigen::Vector2d angles =
        Eigen::Vector2d(expected["pan_deg"].get<double>(), expected["tilt_deg"].get<double>()) * degree;
    EXPECT_LE((TurnedHead(rig[i].head, angles).cam_from_world_rotation - matrix_of<3, 3>(expected["R"])).norm(), 3e-12);
    EXPECT_LE((pixel(rig[i], angles, target) - matrix_of<2, 1>(expected["pixel"])).norm(), 1e-9);
    const auto readings = aim(rig[i].head, target);
    ASSERT_TRUE(readings);
    const Eigen::Vector2d exact = matrix_of<2, 1>(expected["exact_aim_deg"]);
    EXPECT_LE((*readings / degree - exact).norm(), 1e-10);
  }
}

TEST(Head, GeneralHeadAsComputedElsewhere) {
  const Json reference = read_case("c2_general_head.json");
  int num_checked = 0;
  for (const Json& row : reference["rows"]) {
    RigHead at = xiahou_rig()[0];
    const Json& given = row["head"];
    at.head.world_from_base = {exp_so3(vector_of(given["rvb"])).conjugate(), vector_of(given["pb"])};
    at.head.pan_to_tilt_m = vector_of(given["ot"]);
    at.head.tilt_to_cam_m = vector_of(given["oc"]);
    at.head.cam_from_tilt = exp_so3(vector_of(given["rvc"]));
    const Eigen::Vector2d readings(row["pan"].get<double>(), row["tilt"].get<double>());
    const auto seen = project(at, readings, vector_of(row["P"]));
    ASSERT_TRUE(seen);
    const Eigen::Vector2d offset = matrix_of<2, 1>(row["offset_px"]);
    const double tolerance = reference["tol"].get<double>() * 1e3;  // theirs: central differences, relative to f
    EXPECT_LE((seen->px - Eigen::Vector2d(160.0, 120.0) - offset).norm(), 1e-9);
    EXPECT_LE((seen->J_px_point - matrix_of<2, 3>(row["dz_dP"])).norm(), tolerance);
    EXPECT_LE((seen->J_px_readings - matrix_of<2, 2>(row["dz_dpan_tilt"])).norm(), tolerance);
    ++num_checked;
  }
  EXPECT_EQ(num_checked, 6);
}

}  // namespace
}  // namespace alidade
