#include "alidade/localize/filter/feature.h"

#include <gtest/gtest.h>

#include <cstdlib>
#include <nlohmann/json.hpp>

#include "alidade/files/files.h"
#include "alidade/localize/distortion.h"
#include "alidade/simulate/example_camera.h"
#include "alidade/simulate/underwater.h"
#include "alidade/testing/random.h"
#include "alidade/testing/reference_case.h"

namespace alidade {
namespace {

using Json = nlohmann::json;

std::vector<Camera> cameras() {
  return {underwater_camera(), *example_camera("pinhole", 768, 576), *example_camera("kannala_brandt", 768, 576)};
}

struct Case {
  Rigid3 world_from_cam;
  Feature feature;
};

Case random_case(std::mt19937_64& rng, FeatureKind kind) {
  std::uniform_real_distribution<double> unit(-1.0, 1.0);
  const auto vector = [&] {
    const double x = unit(rng), y = unit(rng), z = unit(rng);
    return Eigen::Vector3d(x, y, z);
  };
  Case made;
  made.world_from_cam = {exp_so3(2.0 * vector()), vector()};
  const Eigen::Vector3d point_in_cam(0.3 * unit(rng), 0.3 * unit(rng), 1.5 + unit(rng));
  const Eigen::Vector3d point_in_world = made.world_from_cam * point_in_cam;
  made.feature.kind = kind;
  made.feature.values.head<3>() = point_in_world;
  if (kind == FeatureKind::xyz) return made;
  const Eigen::Vector3d origin_in_world = made.world_from_cam.translation + 0.2 * vector();
  const Eigen::Vector3d ray_in_world = point_in_world - origin_in_world;
  const AnglesOfBearing angles = angles_of(ray_in_world);
  made.feature.values << origin_in_world, angles.theta, angles.phi, 1.0 / ray_in_world.norm();
  return made;
}

TEST(Feature, DerivativesOfViewsAreThoseOfCentralDifferences) {
  auto rng = testing::make_rng();
  int num_cases = 0;
  constexpr double step = 1e-6;
  // Relative to the largest entry: step² and rounding over step.
  const auto expect_near = [](const Eigen::Vector2d& is, const Eigen::Vector2d& should, double scale) {
    EXPECT_LT((is - should).norm(), 1e-6 * scale);
  };
  for (const Camera& camera : cameras()) {
    for (const FeatureKind kind : {FeatureKind::xyz, FeatureKind::inverse_depth}) {
      for (int k = 0; k < 30; ++k, ++num_cases) {
        const Case at = random_case(rng, kind);
        const auto view = expected_view(camera, at.world_from_cam, at.feature);
        ASSERT_TRUE(view);
        const double scale = 1.0 + view->J_px_pose.norm() + view->J_px_feature.norm();
        for (int i = 0; i < 6; ++i) {
          const auto moved = [&](double by) {
            Case other = at;
            if (i < 3)
              other.world_from_cam.translation[i] += by;
            else
              other.world_from_cam.rotation =
                  other.world_from_cam.rotation * exp_so3(by * Eigen::Vector3d::Unit(i - 3));
            return expected_view(camera, other.world_from_cam, other.feature)->px;
          };
          expect_near(view->J_px_pose.col(i), (moved(step) - moved(-step)) / (2.0 * step), scale);
        }
        for (int i = 0; i < at.feature.dim(); ++i) {
          const auto moved = [&](double by) {
            Case other = at;
            other.feature.values[i] += by;
            return expected_view(camera, other.world_from_cam, other.feature)->px;
          };
          expect_near(view->J_px_feature.col(i), (moved(step) - moved(-step)) / (2.0 * step), scale);
        }
      }
    }
  }
  EXPECT_EQ(num_cases, 180);
}

TEST(Feature, ANewOneIsSeenWhereItWasAndItsDerivativesAreRight) {
  auto rng = testing::make_rng();
  std::uniform_real_distribution<double> unit(-1.0, 1.0);
  constexpr double step = 1e-6;
  for (const Camera& camera : cameras()) {
    for (const FeatureKind kind : {FeatureKind::xyz, FeatureKind::inverse_depth}) {
      for (int k = 0; k < 20; ++k) {
        const Rigid3 world_from_cam = random_case(rng, kind).world_from_cam;
        const Eigen::Vector2d px(384.0 + 200.0 * unit(rng), 288.0 + 150.0 * unit(rng));
        const RangePrior prior{0.8, 0.1};
        const auto made = new_feature(camera, world_from_cam, px, 0.5, prior, kind);
        ASSERT_TRUE(made);
        EXPECT_LT((expected_view(camera, world_from_cam, made->feature)->px - px).norm(), 1e-7);
        EXPECT_NEAR((place_of(made->feature).point_in_world - world_from_cam.translation).norm(), 0.8, 1e-9);
        const int dim = made->feature.dim();
        for (int i = 0; i < 6; ++i) {
          const auto at = [&](double by) {
            Rigid3 other = world_from_cam;
            if (i < 3)
              other.translation[i] += by;
            else
              other.rotation = other.rotation * exp_so3(by * Eigen::Vector3d::Unit(i - 3));
            return new_feature(camera, other, px, 0.5, prior, kind)->feature.values;
          };
          const Eigen::Vector<double, 6> column = (at(step) - at(-step)) / (2.0 * step);
          EXPECT_LT((made->J_pose.col(i) - column).head(dim).cwiseAbs().maxCoeff(), 1e-6) << i;
        }
        // Covariance of pixel and distance by differences.
        Eigen::Matrix<double, 6, 3> J;
        for (int i = 0; i < 3; ++i) {
          const auto at = [&](double by) {
            Eigen::Vector2d there = px;
            if (i < 2) there[i] += by;
            return new_feature(camera, world_from_cam, there, 0.5, {0.8 + (i == 2 ? by : 0.0), 0.1}, kind)
                ->feature.values;
          };
          J.col(i) = (at(step) - at(-step)) / (2.0 * step) * (i < 2 ? 0.5 : 0.08);
        }
        const Eigen::Matrix<double, 6, 6> cov = J * J.transpose();
        EXPECT_LT((made->J_range - J.col(2) / prior.sigma_rel).head(dim).cwiseAbs().maxCoeff(), 1e-7);
        EXPECT_LT((made->cov - cov).topLeftCorner(dim, dim).cwiseAbs().maxCoeff(), 1e-7);
      }
    }
  }
}

TEST(Feature, BehindTheCameraIsNotSeenAndInfinityIs) {
  const Camera camera = underwater_camera();
  Feature feature;
  feature.values.head<3>() = Eigen::Vector3d(0.0, 0.0, -1.0);
  EXPECT_FALSE(expected_view(camera, {}, feature));
  feature.kind = FeatureKind::inverse_depth;
  for (const double rho : {1.0, 1e-3, 1e-6, 0.0, -1e-6}) {  // an estimate may pass infinity by a little
    feature.values << 0.1, 0.0, 0.0, 0.05, -0.02, rho;
    const auto view = expected_view(camera, {}, feature);
    ASSERT_TRUE(view) << rho;
    EXPECT_TRUE(view->px.allFinite() && view->J_px_pose.allFinite() && view->J_px_feature.allFinite());
  }
}

TEST(Feature, IsLinearWhenItsDepthIsSure) {
  Feature feature;
  feature.kind = FeatureKind::inverse_depth;
  feature.values << 0.0, 0.0, 0.0, 0.0, 0.0, 1.0;
  EXPECT_NEAR(linearity_index(feature, 0.1, Eigen::Vector3d::Zero()), 0.4, 1e-12);         // 4 · 0.1 · 1
  EXPECT_NEAR(linearity_index(feature, 0.1, Eigen::Vector3d(1.0, 0.0, 1.0)), 0.0, 1e-12);  // seen from the side
}

TEST(Feature, ViewsAreThoseOfTheReferenceCases) {
  const Json d1 = Json::parse(read_file(testing::reference_case("d1_projection.json")));
  const double tolerance = d1["tol"];
  int num_seen = 0;
  for (const Json& row : d1["rows"]) {
    const std::vector<double> point = row["pc"];
    Feature feature;
    feature.values.head<3>() = Eigen::Vector3d(point[0], point[1], point[2]);
    const std::array<const char*, 3> names{"uv_pinhole", "uv_first", "uv_full"};
    for (const DistortionVariant variant :
         {DistortionVariant::none, DistortionVariant::radial1, DistortionVariant::full}) {
      const auto view = expected_view(*with_distortion(underwater_camera(), variant), {}, feature);
      if (!view) continue;  // outside the domain, where the reference goes on
      const std::vector<double> px = row[names[static_cast<std::size_t>(variant)]];
      EXPECT_LT((view->px - Eigen::Vector2d(px[0], px[1])).norm(), tolerance * 10);  // px, from 1e-8 in (x, y)
      ++num_seen;
    }
  }
  EXPECT_GE(num_seen, 24);
  const Json d2 = Json::parse(read_file(testing::reference_case("d2_motion_measurement.json")));
  for (const Json& row : d2["rows"]) {
    const std::vector<double> x = row["x"], y = row["y"], px = row["uv"];
    const Rigid3 world_from_cam{Eigen::Quaterniond(x[3], x[4], x[5], x[6]), {x[0], x[1], x[2]}};
    Feature feature;
    feature.values.head<3>() = Eigen::Vector3d(y[0], y[1], y[2]);
    const auto view = expected_view(underwater_camera(), world_from_cam, feature);
    ASSERT_TRUE(view);
    EXPECT_LT((view->px - Eigen::Vector2d(px[0], px[1])).norm(), 1e-7);
    const auto expect_block = [&](const char* name, const auto& block) {
      for (int i = 0; i < 2; ++i)
        for (int j = 0; j < 3; ++j)
          EXPECT_NEAR(block(i, j),
                      row[name][static_cast<std::size_t>(i)][static_cast<std::size_t>(j)].template get<double>(), 1e-6)
              << name;  // entries of 1e3, given to 1e-8 relative
    };
    expect_block("Jr", view->J_px_pose.leftCols<3>().eval());
    expect_block("Jtheta", view->J_px_pose.rightCols<3>().eval());
    expect_block("Jy", view->J_px_feature.leftCols<3>().eval());
    // The quaternion form: ∂u/∂q (4 columns) taken to the error by δq = ½ q ⊗ (0, δθ).
    const double w = x[3], qx = x[4], qy = x[5], qz = x[6];
    Eigen::Matrix<double, 4, 3> E;
    E << -qx, -qy, -qz, w, -qz, qy, qz, w, -qx, -qy, qx, w;
    Eigen::Matrix<double, 2, 4> Jq;
    for (int i = 0; i < 2; ++i)
      for (int j = 0; j < 4; ++j) Jq(i, j) = row["Jq"][static_cast<std::size_t>(i)][static_cast<std::size_t>(j)];
    EXPECT_LT((0.5 * Jq * E - view->J_px_pose.rightCols<3>()).cwiseAbs().maxCoeff(), 1e-6);
  }
}

}  // namespace
}  // namespace alidade
