#include <gtest/gtest.h>

#include <cmath>
#include <limits>
#include <numbers>

#include "alidade/camera/camera.h"
#include "alidade/testing/random.h"

namespace alidade {
namespace {

// The laws that every lens obeys. A new model joins by one line here and one example below.
template <class Model>
struct CameraModelLaws : ::testing::Test {};
using AllModels = ::testing::Types<Pinhole, Brown, KannalaBrandt>;
TYPED_TEST_SUITE(CameraModelLaws, AllModels);

template <class Model>
struct Example;
template <>
struct Example<Pinhole> {
  static constexpr double max_angle_rad = 1.1;
  static Params<Pinhole> params() { return {800.0, 810.0, 640.0, 480.0, 0.7}; }
};
template <>
struct Example<Brown> {
  static constexpr double max_angle_rad = 0.69;  // r = 0.825, the fold is at 0.99 and inside it by the tangential terms
  static Params<Brown> params() {
    return Params<Brown>{768.0, 766.0, 389.0, 284.0, -0.4, -0.44881, 0.0664, 0.01316, 0.00218, 0.003};
  }
};
template <>
struct Example<KannalaBrandt> {
  static constexpr double max_angle_rad = 2.2;  // sees backwards; folds near 2.4
  static Params<KannalaBrandt> params() {
    return Params<KannalaBrandt>{300.0, 305.0, 640.0, 480.0, 0.3, -0.02, 0.004, -0.001, 1e-5};
  }
};

Eigen::Vector3d random_ray(std::mt19937_64& rng, double max_angle_rad) {
  std::uniform_real_distribution<> angle(0.0, max_angle_rad), azimuth(-std::numbers::pi, std::numbers::pi);
  const double theta = angle(rng), phi = azimuth(rng);
  return {std::sin(theta) * std::cos(phi), std::sin(theta) * std::sin(phi), std::cos(theta)};
}

TYPED_TEST(CameraModelLaws, UnprojectInvertsProject) {
  auto rng = testing::make_rng();
  const auto params = Example<TypeParam>::params();
  std::uniform_real_distribution<> range_m(0.01, 100.0);
  for (int i = 0; i < 5000; ++i) {
    const Eigen::Vector3d ray = random_ray(rng, Example<TypeParam>::max_angle_rad);
    const auto px = TypeParam::project(params, range_m(rng) * ray);
    ASSERT_TRUE(px) << "ray " << ray.transpose();
    const auto back = TypeParam::unproject(params, *px);
    ASSERT_TRUE(back) << "pixel " << px->transpose();
    // 1e-13 in the distorted point, divided by a slope that is above 0.1 here
    EXPECT_LT((*back - ray).norm(), 1e-11) << "ray " << ray.transpose();
    EXPECT_NEAR(back->norm(), 1.0, 1e-14);
  }
}

TYPED_TEST(CameraModelLaws, ProjectionDoesNotDependOnTheRange) {
  auto rng = testing::make_rng();
  const auto params = Example<TypeParam>::params();
  for (int i = 0; i < 1000; ++i) {
    const Eigen::Vector3d ray = random_ray(rng, Example<TypeParam>::max_angle_rad);
    const auto near = TypeParam::project(params, 1e-3 * ray), far = TypeParam::project(params, 1e6 * ray);
    ASSERT_TRUE(near && far);
    EXPECT_LT((*near - *far).norm(), 1e-9);  // rounding of pixels near 1000
  }
}

TYPED_TEST(CameraModelLaws, DerivativesMatchCentralDifferences) {
  auto rng = testing::make_rng();
  const auto params = Example<TypeParam>::params();
  for (const double max_angle_rad : {0.0, 1e-12, 1e-9, 1e-4, Example<TypeParam>::max_angle_rad}) {
    for (int draw = 0; draw < 200; ++draw) {
      const Eigen::Vector3d point_in_cam = 2.0 * random_ray(rng, max_angle_rad);
      const auto at = TypeParam::project_with_jacobians(params, point_in_cam);
      ASSERT_TRUE(at);
      EXPECT_EQ(at->px, *TypeParam::project(params, point_in_cam));
      for (int i = 0; i < 3; ++i) {
        const Eigen::Vector3d h = 1e-5 * Eigen::Vector3d::Unit(i);
        const auto ahead = TypeParam::project(params, point_in_cam + h);
        const auto behind = TypeParam::project(params, point_in_cam - h);
        // rounding 1e-13·1000/1e-5 = 1e-8; truncation h²/6 times a third derivative of up to 1e4
        EXPECT_LT((at->J_px_point.col(i) - (*ahead - *behind) / 2e-5).norm(), 1e-6) << i << ": " << point_in_cam;
      }
      for (int i = 0; i < TypeParam::num_params; ++i) {
        const Params<TypeParam> h = 1e-5 * Params<TypeParam>::Unit(i);
        const auto ahead = TypeParam::project(params + h, point_in_cam);
        const auto behind = TypeParam::project(params - h, point_in_cam);
        ASSERT_TRUE(ahead && behind);
        // linear in each parameter: rounding alone
        EXPECT_LT((at->J_px_params.col(i) - (*ahead - *behind) / 2e-5).norm(), 1e-7)
            << TypeParam::param_names.at(std::size_t(i));
      }
    }
  }
}

TYPED_TEST(CameraModelLaws, TheDomainOfABatchIsThatOfEachPoint) {
  auto rng = testing::make_rng();
  const auto params = Example<TypeParam>::params();
  const auto domain = TypeParam::domain(params);
  int seen = 0, unseen = 0;
  for (int i = 0; i < 5000; ++i) {
    const Eigen::Vector3d point_in_cam = random_ray(rng, std::numbers::pi);
    const auto one = TypeParam::project(params, point_in_cam);
    const auto of_batch = TypeParam::project(params, domain, point_in_cam);
    ASSERT_EQ(one.has_value(), of_batch.has_value()) << point_in_cam;
    EXPECT_EQ(one, of_batch);
    EXPECT_EQ(one.has_value(), TypeParam::project_with_jacobians(params, point_in_cam).has_value());
    ++(one ? seen : unseen);
  }
  EXPECT_GT(seen, 500);
  EXPECT_GT(unseen, 500);
}

TYPED_TEST(CameraModelLaws, AnswersNothingToNonsense) {
  const auto params = Example<TypeParam>::params();
  const double nan = std::nan(""), inf = std::numeric_limits<double>::infinity();
  for (const double bad : {nan, inf, -inf, 1e300, -1e300}) {
    for (int i = 0; i < 3; ++i) {
      Eigen::Vector3d point_in_cam(0.1, 0.2, 1.0);
      point_in_cam[i] = bad;
      EXPECT_FALSE(TypeParam::project(params, point_in_cam)) << bad << " in " << i;
      EXPECT_FALSE(TypeParam::project_with_jacobians(params, point_in_cam)) << bad << " in " << i;
    }
    for (int i = 0; i < 2; ++i) {
      Eigen::Vector2d px(300.0, 200.0);
      px[i] = bad;
      EXPECT_FALSE(TypeParam::unproject(params, px)) << bad << " in " << i;
    }
    for (int i = 0; i < TypeParam::num_params; ++i) {
      if (std::isfinite(bad) && (i < 5 || bad > 0.0)) continue;  // huge but lawful
      Params<TypeParam> broken = params;
      broken[i] = bad;
      EXPECT_FALSE(TypeParam::project(broken, {0.1, 0.2, 1.0}))
          << bad << " in " << TypeParam::param_names.at(std::size_t(i));
      EXPECT_FALSE(TypeParam::project(broken, TypeParam::domain(broken), {0.1, 0.2, 1.0}));
      EXPECT_FALSE(TypeParam::project_with_jacobians(broken, {0.1, 0.2, 1.0}));
      if (std::isinf(bad) && i < 2) continue;  // an infinite focal length sees along the axis
      EXPECT_FALSE(TypeParam::unproject(broken, {300.0, 200.0})) << bad << " in " << i;
    }
  }
  EXPECT_FALSE(TypeParam::project(params, Eigen::Vector3d::Zero()));
  EXPECT_FALSE(TypeParam::project(params, -Eigen::Vector3d::UnitZ()));
  EXPECT_FALSE(TypeParam::project_with_jacobians(params, Eigen::Vector3d::Zero()));
}

TYPED_TEST(CameraModelLaws, TheLensValueKeepsTheModel) {
  const Params<TypeParam> values = Example<TypeParam>::params();
  const Lens lens = Calibrated<TypeParam>{values};
  EXPECT_EQ(model_name(lens), TypeParam::name);
  ASSERT_EQ(param_names(lens).size(), std::size_t(TypeParam::num_params));
  EXPECT_EQ(param_names(lens)[4], "skew");
  EXPECT_EQ(params(lens), values);
  const auto empty = make_lens(TypeParam::name);
  ASSERT_TRUE(empty);
  EXPECT_EQ(params(*empty), Params<TypeParam>::Zero());
  EXPECT_EQ(params(with_params(*empty, values)), values);

  const Camera camera{640, 480, lens, {}, 0.0, {}};
  const std::vector<Eigen::Vector3d> points_in_cam{{0.1, 0.2, 1.0}, {0.0, 0.0, -1.0}};
  const auto pixels = project(camera, points_in_cam);
  ASSERT_EQ(pixels.size(), 2u);
  EXPECT_EQ(pixels[0], TypeParam::project(values, points_in_cam[0]));
  EXPECT_FALSE(pixels[1]);
  const auto at = project_with_jacobians(camera, points_in_cam[0]);
  ASSERT_TRUE(at);
  EXPECT_EQ(at->J_px_params, TypeParam::project_with_jacobians(values, points_in_cam[0])->J_px_params);
  EXPECT_FALSE(project_with_jacobians(camera, points_in_cam[1]));
  const auto ray = unproject(camera, *pixels[0]);
  EXPECT_EQ(ray, unproject(camera, std::vector<Eigen::Vector2d>{*pixels[0]})[0]);
}

TEST(MakeLens, KnowsNoOtherNames) { EXPECT_FALSE(make_lens("fisheye")); }

}  // namespace
}  // namespace alidade
