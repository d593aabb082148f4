#include "alidade/matching/essential.h"

#include <Eigen/Eigenvalues>
#include <Eigen/LU>
#include <algorithm>
#include <array>
#include <cmath>
#include <random>

#include "alidade/geometry/decompositions.h"

namespace alidade {
namespace {

// E = x E₁ + y E₂ + z E₃ + E₄: entries are polynomials in x, y, z. Linear: x, y, z, 1.
using Linear = Eigen::Matrix<double, 4, 1>;
using Quadratic = Eigen::Matrix<double, 10, 1>;  // x² xy y² xz yz z² x y z 1
using Cubic = Eigen::Matrix<double, 20, 1>;  // x³ x²y xy² y³ x²z xyz y²z xz² yz² z³, then the quadratic ones

constexpr std::array<std::array<int, 4>, 4> linear_times_linear{
    {{0, 1, 3, 6}, {1, 2, 4, 7}, {3, 4, 5, 8}, {6, 7, 8, 9}}};
constexpr std::array<std::array<int, 4>, 10> quadratic_times_linear{{{0, 1, 4, 10},
                                                                     {1, 2, 5, 11},
                                                                     {2, 3, 6, 12},
                                                                     {4, 5, 7, 13},
                                                                     {5, 6, 8, 14},
                                                                     {7, 8, 9, 15},
                                                                     {10, 11, 13, 16},
                                                                     {11, 12, 14, 17},
                                                                     {13, 14, 15, 18},
                                                                     {16, 17, 18, 19}}};

void add_product(const Linear& a, const Linear& b, double sign, Quadratic& sum) {
  for (std::size_t i = 0; i < 4; ++i)
    for (std::size_t k = 0; k < 4; ++k)
      sum(linear_times_linear[i][k]) += sign * a(static_cast<int>(i)) * b(static_cast<int>(k));
}

void add_product(const Quadratic& a, const Linear& b, Cubic& sum) {
  for (std::size_t i = 0; i < 10; ++i)
    for (std::size_t k = 0; k < 4; ++k)
      sum(quadratic_times_linear[i][k]) += a(static_cast<int>(i)) * b(static_cast<int>(k));
}

using Entries = std::array<std::array<Linear, 3>, 3>;

Cubic determinant(const Entries& E) {
  Cubic sum = Cubic::Zero();
  for (std::size_t c = 0; c < 3; ++c) {
    Quadratic minor = Quadratic::Zero();
    add_product(E[1][(c + 1) % 3], E[2][(c + 2) % 3], 1.0, minor);
    add_product(E[1][(c + 2) % 3], E[2][(c + 1) % 3], -1.0, minor);
    add_product(minor, E[0][c], sum);
  }
  return sum;
}

/// det E = 0 and 2 E Eᵀ E − trace(E Eᵀ) E = 0, each a row of coefficients.
Eigen::Matrix<double, 10, 20> constraints(const Entries& E) {
  Eigen::Matrix<double, 10, 20> rows;
  rows.row(0) = determinant(E).transpose();
  std::array<std::array<Quadratic, 3>, 3> square;  // 2 E Eᵀ − trace
  Quadratic trace = Quadratic::Zero();
  for (std::size_t i = 0; i < 3; ++i)
    for (std::size_t k = 0; k < 3; ++k) {
      square[i][k].setZero();
      for (std::size_t j = 0; j < 3; ++j) add_product(E[i][j], E[k][j], 2.0, square[i][k]);
      if (i == k) trace += 0.5 * square[i][k];
    }
  for (std::size_t i = 0; i < 3; ++i) square[i][i] -= trace;
  for (std::size_t i = 0; i < 3; ++i)
    for (std::size_t k = 0; k < 3; ++k) {
      Cubic sum = Cubic::Zero();
      for (std::size_t j = 0; j < 3; ++j) add_product(square[i][j], E[j][k], sum);
      rows.row(static_cast<int>(1 + 3 * i + k)) = sum.transpose();
    }
  return rows;
}

/// Four 3 × 3 matrices that span the solutions E, as columns (entries row by row). Empty if the input is not finite.
std::optional<Eigen::Matrix<double, 9, 4>> null_space(std::span<const Eigen::Vector2d, 5> first,
                                                      std::span<const Eigen::Vector2d, 5> second) {
  Eigen::Matrix<double, 9, 5> products;  // one column per pair
  for (std::size_t i = 0; i < 5; ++i) {
    const Eigen::Vector3d a = second[i].homogeneous(), b = first[i].homogeneous();
    for (int r = 0; r < 3; ++r) products.block<3, 1>(3 * r, static_cast<int>(i)) = a(r) * b;
  }
  if (!products.allFinite()) return std::nullopt;
  return orthonormal_basis(products, 9).rightCols<4>();
}

/// Multiplication of the quadratic monomials by x, modulo the constraints; eigenvectors: their values at the solutions.
std::optional<Eigen::Matrix<double, 10, 10>> action_matrix(const Eigen::Matrix<double, 10, 20>& rows) {
  const Eigen::PartialPivLU<Eigen::Matrix<double, 10, 10>> cubic(rows.leftCols<10>());
  const Eigen::Matrix<double, 10, 10> reduced = cubic.solve(rows.rightCols<10>());
  if (!reduced.allFinite()) return std::nullopt;
  Eigen::Matrix<double, 10, 10> action = Eigen::Matrix<double, 10, 10>::Zero();
  const std::array cubic_of{0, 1, 2, 4, 5, 7};  // x · x², xy, y², xz, yz, z²
  for (std::size_t i = 0; i < cubic_of.size(); ++i) action.row(static_cast<int>(i)) = -reduced.row(cubic_of[i]);
  action(6, 0) = action(7, 1) = action(8, 3) = action(9, 6) = 1.0;  // x · x, y, z, 1
  return action;
}

}  // namespace

std::vector<Eigen::Matrix3d> five_point_essentials(std::span<const Eigen::Vector2d, 5> first,
                                                   std::span<const Eigen::Vector2d, 5> second) {
  std::vector<Eigen::Matrix3d> solutions;
  const auto basis = null_space(first, second);
  if (!basis) return solutions;
  Entries E;
  for (std::size_t i = 0; i < 9; ++i) E[i / 3][i % 3] = basis->row(static_cast<int>(i)).transpose();
  const auto action = action_matrix(constraints(E));
  if (!action) return solutions;
  const Eigen::EigenSolver<Eigen::Matrix<double, 10, 10>> eigen(*action);
  if (eigen.info() != Eigen::Success) return solutions;
  const auto values = eigen.eigenvalues();
  const auto vectors = eigen.eigenvectors();
  for (int k = 0; k < 10; ++k) {
    if (values(k).imag() != 0.0) continue;
    const Eigen::Vector4d weights = vectors.col(k).tail<4>().real();  // x, y, z, 1, up to a factor
    const Eigen::Matrix<double, 9, 1> entries = *basis * weights.normalized();
    if (!entries.allFinite()) continue;
    solutions.emplace_back(Eigen::Map<const Eigen::Matrix<double, 3, 3, Eigen::RowMajor>>(entries.data()));
  }
  return solutions;
}

double sampson_squared(const Eigen::Matrix3d& E, const Eigen::Vector2d& first, const Eigen::Vector2d& second) {
  const Eigen::Vector3d line = E * first.homogeneous();
  const Eigen::Vector2d back = E.leftCols<2>().transpose() * second.homogeneous();
  const double product = second.dot(line.head<2>()) + line.z();
  return product * product / (line.head<2>().squaredNorm() + back.squaredNorm());
}

namespace {

std::size_t num_within(const Eigen::Matrix3d& E, std::span<const Eigen::Vector2d> first,
                       std::span<const Eigen::Vector2d> second, double reach) {
  std::size_t num = 0;
  for (std::size_t i = 0; i < first.size(); ++i)
    if (sampson_squared(E, first[i], second[i]) <= reach * reach) ++num;
  return num;
}

std::array<std::size_t, 5> five_of(std::size_t size, std::mt19937& random) {
  std::array<std::size_t, 5> chosen{};
  for (std::size_t i = 0; i < chosen.size();) {
    chosen[i] = random() % size;
    if (std::find(chosen.begin(), chosen.begin() + static_cast<std::ptrdiff_t>(i), chosen[i]) ==
        chosen.begin() + static_cast<std::ptrdiff_t>(i))
      ++i;
  }
  return chosen;
}

/// Number of draws until a sample of inliers only has been drawn with that probability.
double enough_draws(double share, double confidence) {
  const double all_agree = std::pow(share, 5);
  return all_agree >= 1.0 ? 1.0 : std::log(1.0 - confidence) / std::log1p(-all_agree);
}

}  // namespace

std::optional<AgreeingEssential> agreeing_essential(std::span<const Eigen::Vector2d> first,
                                                    std::span<const Eigen::Vector2d> second,
                                                    const EssentialSearch& search) {
  const std::size_t size = std::min(first.size(), second.size());
  if (size < 5) return std::nullopt;
  first = first.first(size);
  second = second.first(size);
  std::optional<AgreeingEssential> best;
  std::mt19937 random(1);
  auto most_draws = static_cast<double>(search.max_draws);
  for (std::size_t draw = 0; static_cast<double>(draw) < most_draws; ++draw) {
    const auto chosen = five_of(size, random);
    std::array<Eigen::Vector2d, 5> there, here;
    for (std::size_t i = 0; i < 5; ++i) {
      there[i] = first[chosen[i]];
      here[i] = second[chosen[i]];
    }
    for (const Eigen::Matrix3d& E : five_point_essentials(there, here)) {
      const std::size_t num = num_within(E, first, second, search.reach);
      if (best && num <= best->num_agree) continue;
      best = AgreeingEssential{E, {}, num};
      const double share = static_cast<double>(num) / static_cast<double>(size);
      most_draws = std::min(most_draws, enough_draws(share, search.confidence));
    }
  }
  if (!best) return best;
  for (std::size_t i = 0; i < size; ++i)
    best->agree.push_back(sampson_squared(best->E, first[i], second[i]) <= search.reach * search.reach ? 1 : 0);
  return best;
}

}  // namespace alidade
