#include "alidade/camera/brown.h"

#include <gtest/gtest.h>

#include <Eigen/Geometry>

#include <cmath>
#include <cstdlib>
#include <fstream>
#include <nlohmann/json.hpp>
#include <opencv2/calib3d.hpp>

#include "alidade/camera/radial_fold.h"
#include "alidade/testing/random.h"
#include "alidade/testing/reference_case.h"

namespace alidade {
namespace {

TEST(Brown, ProjectsAsOpenCvDoes) {
  auto rng = testing::make_rng();
  std::uniform_real_distribution<> unit(-1.0, 1.0);
  int checked = 0;
  for (int lens = 0; lens < 50; ++lens) {
    const Params<Brown> params{700.0 + 300.0 * unit(rng),
                               700.0 + 300.0 * unit(rng),
                               640.0,
                               480.0,
                               0.0,
                               0.4 * unit(rng),
                               0.2 * unit(rng),
                               0.01 * unit(rng),
                               0.01 * unit(rng),
                               0.1 * unit(rng)};
    const cv::Matx33d K(params[0], 0, params[2], 0, params[1], params[3], 0, 0, 1);
    const cv::Vec<double, 5> k(params[5], params[6], params[7], params[8], params[9]);
    std::vector<cv::Point3d> points;
    for (int i = 0; i < 200; ++i) points.emplace_back(0.8 * unit(rng), 0.8 * unit(rng), 1.9 + unit(rng));
    std::vector<cv::Point2d> reference;
    cv::projectPoints(points, cv::Vec3d(), cv::Vec3d(), K, k, reference);
    for (std::size_t i = 0; i < points.size(); ++i) {
      const auto px = Brown::project(params, {points[i].x, points[i].y, points[i].z});
      if (!px) continue;  // beyond the fold, where OpenCV answers all the same
      EXPECT_NEAR(px->x(), reference[i].x, 1e-9);
      EXPECT_NEAR(px->y(), reference[i].y, 1e-9);
      ++checked;
    }
  }
  EXPECT_GT(checked, 5000);
}

TEST(Brown, SkewShearsTheDistortedPoint) {
  Params<Brown> params{700.0, 690.0, 640.0, 480.0, 0.0, -0.2, 0.05, 0.001, -0.002, 0.01};
  const Eigen::Vector3d point_in_cam(0.3, -0.2, 1.0);
  const Eigen::Vector2d straight = Brown::project(params, point_in_cam).value();
  params[4] = 3.5;
  const Eigen::Vector2d sheared = Brown::project(params, point_in_cam).value();
  EXPECT_NEAR(sheared.x() - straight.x(), 3.5 * (straight.y() - 480.0) / 690.0, 1e-12);
  EXPECT_EQ(sheared.y(), straight.y());
}

// --- the fold -------------------------------------------------------------------------------------------------------

TEST(BrownFold, OfOneCoefficientHasAClosedForm) {
  Params<Brown> params = Params<Brown>::Zero();
  EXPECT_TRUE(std::isinf(Brown::max_radius(params)));
  params[5] = 0.3;
  EXPECT_TRUE(std::isinf(Brown::max_radius(params)));
  for (const double k1 : {-1e-9, -0.01, -0.44881, -3.0}) {
    params[5] = k1;
    EXPECT_NEAR(Brown::max_radius(params) * std::sqrt(-3.0 * k1), 1.0, 1e-14);
  }
}

TEST(BrownFold, IsTheSmallestRootOfKnownRoots) {
  auto rng = testing::make_rng();
  std::uniform_real_distribution<> log_root(-3.0, 3.0);
  for (int i = 0; i < 2000; ++i) {
    // (1 − t/a)(1 − t/b)(1 + t/c): roots a, b > 0 > −c
    const double a = std::exp(log_root(rng)), b = a * (1.01 + std::exp(log_root(rng))), c = std::exp(log_root(rng));
    const double u = -1.0 / a, v = -1.0 / b, w = 1.0 / c;
    const double coefficients[] = {u + v + w, u * v + v * w + w * u, u * v * w};
    EXPECT_NEAR(detail::first_root(coefficients) / a, 1.0, 1e-9) << a << ' ' << b << ' ' << c;
  }
}

TEST(BrownFold, IsWhereTheRadialMapStopsGrowing) {
  auto rng = testing::make_rng();
  std::uniform_real_distribution<> unit(-1.0, 1.0);
  int folded = 0;
  for (int i = 0; i < 500; ++i) {
    Params<Brown> p = Params<Brown>::Zero();
    p[5] = unit(rng), p[6] = unit(rng), p[9] = unit(rng);
    const double r_max = Brown::max_radius(p);
    const auto slope = [&](double r) {
      const double t = r * r;
      return 1.0 + t * (3.0 * p[5] + t * (5.0 * p[6] + t * 7.0 * p[9]));
    };
    for (int step = 0; step < 400; ++step) {
      const double r = (std::isinf(r_max) ? 30.0 : 0.9999 * r_max) * step / 400.0;
      ASSERT_GT(slope(r), 0.0) << r << " of " << r_max;
    }
    if (std::isinf(r_max)) continue;
    ++folded;
    EXPECT_LT(slope(r_max * (1.0 + 1e-7)), slope(r_max * (1.0 - 1e-7)));
    EXPECT_NEAR(slope(r_max), 0.0, 1e-12 * (1.0 + 20.0 * std::pow(r_max, 6)));
  }
  EXPECT_GT(folded, 100);
}

TEST(BrownFold, PointsBeyondItAreNotSeen) {
  const Params<Brown> params{768.0, 766.0, 389.0, 284.0, 0.0, -0.44881, 0.0664, 0.0, 0.0, 0.0};
  const double r_max = Brown::max_radius(params);
  EXPECT_TRUE(Brown::project(params, {0.999999 * r_max, 0.0, 1.0}));
  EXPECT_FALSE(Brown::project(params, {1.000001 * r_max, 0.0, 1.0}));
  EXPECT_FALSE(Brown::project(params, {1.3 * r_max, 0.0, 1.0}));  // would be seen in the centre of the image
  EXPECT_FALSE(Brown::project(params, {0.1, 0.1, -1.0}));
  // A pixel outside the image of the fold has no ray; just inside it has one, on the near side.
  const double edge_px = Brown::project(params, {0.9999999 * r_max, 0.0, 1.0})->x();
  EXPECT_FALSE(Brown::unproject(params, {edge_px + 0.01, 284.0}));
  const auto ray = Brown::unproject(params, {edge_px - 0.01, 284.0});
  ASSERT_TRUE(ray);
  EXPECT_LT(ray->x() / ray->z(), r_max);
}

TEST(BrownFold, WithTangentialTermsIsWhereTheDerivativeDegenerates) {
  const Params<Brown> params{768.0, 766.0, 389.0, 284.0, 0.0, -0.44881, 0.0664, 0.01316, 0.00218, 0.0};
  const double r_max = Brown::max_radius(params);
  auto rng = testing::make_rng();
  std::uniform_real_distribution<> radius(0.9 * r_max, r_max), azimuth(-M_PI, M_PI);
  int seen = 0, unseen = 0;
  for (int i = 0; i < 5000; ++i) {
    const double r = radius(rng), phi = azimuth(rng);
    const Eigen::Vector3d point_in_cam(r * std::cos(phi), r * std::sin(phi), 1.0);
    const auto px = Brown::project(params, point_in_cam);
    if (!px) {
      ++unseen;
      continue;
    }
    ++seen;
    const auto ray = Brown::unproject(params, *px);
    ASSERT_TRUE(ray) << point_in_cam.transpose();  // one-to-one up to the edge
    // On the fold itself the ray has half the digits.
    EXPECT_LT((ray->hnormalized() - point_in_cam.head<2>()).norm(), 1e-5);
  }
  EXPECT_GT(seen, 1000);
  EXPECT_GT(unseen, 100);
}

TEST(Brown, EveryPixelIsAnsweredTrulyOrNotAtAll) {
  auto rng = testing::make_rng();
  std::uniform_real_distribution<> unit(-1.0, 1.0);
  int answered = 0, refused = 0;
  for (int i = 0; i < 20000; ++i) {
    const Params<Brown> params{
        576.0,          576.0, 384.0, 288.0, unit(rng), unit(rng), 0.5 * unit(rng), 0.05 * unit(rng), 0.05 * unit(rng),
        0.5 * unit(rng)};
    const Eigen::Vector2d px(384.0 + 800.0 * unit(rng), 288.0 + 800.0 * unit(rng));
    const auto ray = Brown::unproject(params, px);
    ++(ray ? answered : refused);
    if (!ray) continue;
    EXPECT_LT((Brown::project(params, *ray).value() - px).norm(), 1e-9);
  }
  EXPECT_GT(answered, 5000);
  EXPECT_GT(refused, 1000);
}

// --- the reference case ---------------------------------------------------------------------------------------------

nlohmann::json read_case(const std::string& name) {
  return nlohmann::json::parse(std::ifstream(testing::reference_case(name)));
}

Eigen::Vector2d point2(const nlohmann::json& at) { return {at[0].get<double>(), at[1].get<double>()}; }

Params<Brown> params_of(const nlohmann::json& K, int num_coefficients) {
  Params<Brown> params = Params<Brown>::Zero();
  params.head<2>() = point2(K["fc"]);
  params.segment<2>(2) = point2(K["cc"]);
  for (int i = 0; i < num_coefficients; ++i) params[5 + i] = K["kc"][static_cast<std::size_t>(i)];
  return params;
}

TEST(BrownCase, AgreesWithTheReferenceProjection) {
  const nlohmann::json reference = read_case("d1_projection.json");
  const double tolerance = reference["tol"];
  const Params<Brown> full = params_of(reference["K"], 5), first = params_of(reference["K"], 1),
                      none = params_of(reference["K"], 0);
  EXPECT_NEAR(Brown::max_radius(full), reference["r_max"].get<double>(), tolerance);
  EXPECT_NEAR(Brown::max_radius(first), reference["r_max_k1_only"].get<double>(), tolerance);
  int checked = 0;
  for (const auto& row : reference["rows"]) {
    const Eigen::Vector3d point_in_cam(row["pc"][0].get<double>(), row["pc"][1].get<double>(),
                                       row["pc"][2].get<double>());
    const auto at = Brown::project_with_jacobians(full, point_in_cam);
    ASSERT_TRUE(at);
    EXPECT_LT((at->px - point2(row["uv_full"])).norm(), tolerance);
    EXPECT_LT((Brown::project(first, point_in_cam).value() - point2(row["uv_first"])).norm(), tolerance);
    EXPECT_LT((Brown::project(none, point_in_cam).value() - point2(row["uv_pinhole"])).norm(), tolerance);
    for (int i = 0; i < 2; ++i) {
      const std::size_t axis = static_cast<std::size_t>(i);
      // J_full and J_intr were checked there to 1e-7 against differences; entries are up to 1000
      for (int j = 0; j < 3; ++j) {
        EXPECT_NEAR(at->J_px_point(i, j), row["J_full"][axis][static_cast<std::size_t>(j)].get<double>(), 1e-7);
      }
      for (int j = 0; j < 10; ++j) {
        const double unit = j == 4 ? full[0] : 1.0;  // the case has alpha = skew / fx
        EXPECT_NEAR(at->J_px_params(i, j) * unit, row["J_intr"][axis][static_cast<std::size_t>(j)].get<double>(), 1e-7)
            << j;
      }
    }
    const auto ray = Brown::unproject(full, point2(row["uv_full"]));
    ASSERT_TRUE(ray);
    EXPECT_LT((ray->hnormalized() - point_in_cam.hnormalized()).norm(), tolerance);
    ++checked;
  }
  EXPECT_GE(checked, 12);
}

}  // namespace
}  // namespace alidade
