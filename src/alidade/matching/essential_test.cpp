#include "alidade/matching/essential.h"

#include <gtest/gtest.h>

#include <Eigen/LU>
#include <algorithm>
#include <cmath>
#include <limits>
#include <opencv2/calib3d.hpp>
#include <opencv2/core/eigen.hpp>
#include <random>

#include "alidade/geometry/rigid3.h"
#include "alidade/geometry/so3.h"

namespace alidade {
namespace {

struct Pairs {
  Eigen::Matrix3d E;
  std::vector<Eigen::Vector2d> first, second;
};

/// Points before two cameras; in a plane where `flat`.
Pairs pairs_of(unsigned seed, std::size_t num, bool flat = false) {
  std::mt19937 random(seed);
  std::uniform_real_distribution<double> uniform(-1.0, 1.0);
  const auto draw = [&](double size) -> Eigen::Vector3d {
    return size * Eigen::Vector3d(uniform(random), uniform(random), uniform(random));
  };
  const Rigid3 second_from_first{exp_so3(draw(0.4)), draw(1.0)};
  Pairs pairs{
      cross_matrix(second_from_first.translation.normalized()) * second_from_first.rotation.toRotationMatrix(), {}, {}};
  pairs.E.normalize();
  while (pairs.first.size() < num) {
    Eigen::Vector3d point = draw(2.0) + Eigen::Vector3d(0, 0, 6);
    if (flat) point.z() = 6.0 + 0.3 * point.x() - 0.2 * point.y();
    pairs.first.emplace_back(point.hnormalized());
    pairs.second.emplace_back((second_from_first * point).hnormalized());
  }
  return pairs;
}

double distance_up_to_sign(const Eigen::Matrix3d& a, const Eigen::Matrix3d& b) {
  return std::min((a - b).norm(), (a + b).norm());
}

double nearest(const std::vector<Eigen::Matrix3d>& all, const Eigen::Matrix3d& E) {
  double least = std::numeric_limits<double>::infinity();
  for (const Eigen::Matrix3d& one : all) least = std::min(least, distance_up_to_sign(one, E));
  return least;
}

std::vector<Eigen::Matrix3d> solve(const Pairs& pairs) {
  return five_point_essentials(std::span(pairs.first).first<5>(), std::span(pairs.second).first<5>());
}

std::vector<Eigen::Matrix3d> by_opencv(const Pairs& pairs) {
  std::vector<cv::Point2d> first, second;
  for (std::size_t i = 0; i < 5; ++i) {
    first.emplace_back(pairs.first[i].x(), pairs.first[i].y());
    second.emplace_back(pairs.second[i].x(), pairs.second[i].y());
  }
  const cv::Mat stack = cv::findEssentialMat(first, second, cv::Mat::eye(3, 3, CV_64F), cv::RANSAC, 0.99, 1e-9);
  std::vector<Eigen::Matrix3d> all;
  for (int row = 0; row + 3 <= stack.rows; row += 3) {
    Eigen::Matrix3d E;
    cv::cv2eigen(stack.rowRange(row, row + 3), E);
    all.push_back(E.normalized());
  }
  return all;
}

TEST(FivePoints, TheTrueMatrixIsAmongTheSolutions) {
  for (unsigned seed = 1; seed <= 100; ++seed)
    for (const bool flat : {false, true}) {
      const Pairs pairs = pairs_of(seed, 5, flat);
      EXPECT_LT(nearest(solve(pairs), pairs.E), 1e-6) << seed << flat;
    }
}

TEST(FivePoints, EverySolutionIsEssentialAndMeetsThePoints) {
  for (unsigned seed = 1; seed <= 100; ++seed) {
    const Pairs pairs = pairs_of(seed, 5);
    for (const Eigen::Matrix3d& E : solve(pairs)) {
      EXPECT_NEAR(E.norm(), 1.0, 1e-12);
      EXPECT_NEAR(E.determinant(), 0.0, 1e-6) << seed;
      EXPECT_LT((2.0 * E * E.transpose() * E - (E * E.transpose()).trace() * E).norm(), 1e-6) << seed;
      for (std::size_t i = 0; i < 5; ++i) EXPECT_LT(sampson_squared(E, pairs.first[i], pairs.second[i]), 1e-18) << seed;
    }
  }
}

TEST(FivePoints, HasTheSolutionsThatOpenCvHas) {
  int num = 0, missed = 0;
  for (unsigned seed = 1; seed <= 100; ++seed) {
    const Pairs pairs = pairs_of(seed, 5);
    const auto ours = solve(pairs);
    for (const Eigen::Matrix3d& E : by_opencv(pairs)) {
      ++num;
      if (nearest(ours, E) > 1e-4) ++missed;
    }
  }
  EXPECT_GT(num, 300);
  EXPECT_LE(missed, num / 100);  // two roots that nearly meet
}

TEST(FivePoints, NothingOfWhatDeterminesNothing) {
  Pairs pairs = pairs_of(1, 5);
  pairs.first[2].x() = std::numeric_limits<double>::quiet_NaN();
  EXPECT_TRUE(solve(pairs).empty());
  for (Eigen::Vector2d& at : pairs.first) at.setZero();
  for (const Eigen::Matrix3d& E : solve(pairs)) EXPECT_TRUE(E.allFinite());
}

TEST(AgreeingEssential, FindsTheMatrixAmongFalsePairs) {
  for (unsigned seed = 1; seed <= 20; ++seed) {
    Pairs pairs = pairs_of(seed, 100, seed % 2 == 0);
    std::mt19937 random(seed);
    std::uniform_real_distribution<double> uniform(-0.3, 0.3);
    for (std::size_t i = 0; i < 30; ++i) pairs.second[i] = {uniform(random), uniform(random)};
    const auto found = agreeing_essential(pairs.first, pairs.second, {1e-6, 0.999, 1000});
    ASSERT_TRUE(found.has_value());
    // Points in a plane have a second one.
    if (seed % 2 != 0) EXPECT_LT(distance_up_to_sign(found->E, pairs.E), 1e-6) << seed;
    EXPECT_GE(found->num_agree, 70u);
    EXPECT_EQ(std::count(found->agree.begin() + 30, found->agree.end(), 1), 70) << seed;
  }
  EXPECT_FALSE(agreeing_essential(std::span<const Eigen::Vector2d>{}, {}, {}).has_value());
}

TEST(AgreeingEssential, SampsonsDistanceIsThatOfTheNearestPairThatAgrees) {
  const Pairs pairs = pairs_of(3, 1);
  const Eigen::Vector2d moved(1e-6, -2e-6);
  const double squared = sampson_squared(pairs.E, pairs.first[0] + moved, pairs.second[0]);
  // To first order: the residual over the length of its gradient in all four coordinates.
  const auto residual = [&](const Eigen::Vector4d& d) {
    return (pairs.second[0] + d.tail<2>()).homogeneous().dot(pairs.E * (pairs.first[0] + d.head<2>()).homogeneous());
  };
  Eigen::Vector4d gradient;
  for (int i = 0; i < 4; ++i) {
    const Eigen::Vector4d step = 1e-6 * Eigen::Vector4d::Unit(i);
    gradient(i) = (residual(step) - residual(-step)) / 2e-6;
  }
  const double expected = gradient.head<2>().dot(moved) / gradient.norm();
  EXPECT_NEAR(std::sqrt(squared), std::abs(expected), 1e-4 * std::abs(expected));
}

}  // namespace
}  // namespace alidade
