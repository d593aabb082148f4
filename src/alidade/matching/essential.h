#pragma once

#include <Eigen/Core>
#include <cstddef>
#include <optional>
#include <span>
#include <vector>

namespace alidade {

/// The up to ten essential matrices E (norm 1, sign free), (x₂; 1)ᵀ E (x₁; 1) = 0, of five points that two cameras see
/// (x/z, y/z of their rays, in each camera's frame). H. Stewénius, C. Engels and D. Nistér, "Recent developments on
/// direct relative orientation", ISPRS Journal 60(4), 2006, section 3.2: the eigenvectors of an action matrix. Empty
/// where the points do not determine them: on one ray, or not finite.
[[nodiscard]] std::vector<Eigen::Matrix3d> five_point_essentials(std::span<const Eigen::Vector2d, 5> first,
                                                                 std::span<const Eigen::Vector2d, 5> second);

/// Sampson's distance of a pair of points from E, squared (Hartley & Zisserman, eq. 11.9): in the units of x/z.
[[nodiscard]] double sampson_squared(const Eigen::Matrix3d& E, const Eigen::Vector2d& first,
                                     const Eigen::Vector2d& second);

/// The essential matrix with which the most pairs agree.
struct AgreeingEssential {
  Eigen::Matrix3d E;
  std::vector<unsigned char> agree;  ///< One for each pair, 1 or 0.
  std::size_t num_agree = 0;
};
struct EssentialSearch {
  double reach = 2e-3;          ///< Largest Sampson distance of a pair that agrees, in the units of x/z.
  double confidence = 0.99;     ///< Ends when a sample of pairs that all agree was drawn with this probability.
  std::size_t max_draws = 300;  ///< Of five pairs each.
};
/// RANSAC (Fischler & Bolles, 1981), the same draws in every call. None of fewer than five pairs, or where no draw
/// determines one.
[[nodiscard]] std::optional<AgreeingEssential> agreeing_essential(std::span<const Eigen::Vector2d> first,
                                                                  std::span<const Eigen::Vector2d> second,
                                                                  const EssentialSearch& search);

}  // namespace alidade
