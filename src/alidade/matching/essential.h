#pragma once

#include <Eigen/Core>
#include <cstddef>
#include <optional>
#include <span>
#include <vector>

namespace alidade {

/// The up to ten essential matrices E (norm 1, sign arbitrary) with (x₂; 1)ᵀ E (x₁; 1) = 0 for five points observed by
/// two cameras (x/z, y/z of their rays, in each camera's frame). H. Stewénius, C. Engels and D. Nistér, "Recent
/// developments on direct relative orientation", ISPRS Journal 60(4), 2006, section 3.2: from the eigenvectors of an
/// action matrix. Empty if the points do not determine them: on one ray, or not finite.
[[nodiscard]] std::vector<Eigen::Matrix3d> five_point_essentials(std::span<const Eigen::Vector2d, 5> first,
                                                                 std::span<const Eigen::Vector2d, 5> second);

/// Squared Sampson distance of a pair of points from E (Hartley & Zisserman, eq. 11.9), in the units of x/z.
[[nodiscard]] double sampson_squared(const Eigen::Matrix3d& E, const Eigen::Vector2d& first,
                                     const Eigen::Vector2d& second);

/// The essential matrix with the most inliers.
struct AgreeingEssential {
  Eigen::Matrix3d E;
  std::vector<unsigned char> agree;  ///< One per pair, 1 or 0.
  std::size_t num_agree = 0;
};
struct EssentialSearch {
  double reach = 2e-3;          ///< Largest Sampson distance of an inlier, in the units of x/z.
  double confidence = 0.99;     ///< Stop when a sample of inliers only was drawn with this probability.
  std::size_t max_draws = 300;  ///< Samples of five pairs each, at most.
};
/// RANSAC (Fischler & Bolles, 1981), with the same draws in every call. Empty for fewer than five pairs, or if no
/// sample determines a matrix.
[[nodiscard]] std::optional<AgreeingEssential> agreeing_essential(std::span<const Eigen::Vector2d> first,
                                                                  std::span<const Eigen::Vector2d> second,
                                                                  const EssentialSearch& search);

}  // namespace alidade
