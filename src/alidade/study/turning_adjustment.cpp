#include "alidade/study/turning_adjustment.h"

#include <Eigen/Cholesky>
#include <algorithm>
#include <cmath>
#include <limits>

namespace alidade {
namespace {

constexpr std::size_t coarse_rows = 24;  // enough to come near
constexpr int max_coarse_steps = 12, max_steps = 12;
constexpr double near = 1e-3;   // of a coarse step: its gain over all squares; all rows contain more
constexpr double there = 1e-5;  // of a full step: its gain over the variance, 3·10⁻³ σ; what is left is its square

}  // namespace

TurningAdjustment::TurningAdjustment(const std::vector<Eigen::Quaterniond>& cam_from_start, std::size_t num_points)
    : num_points_(num_points), groups_((num_points + 3) / 4) {
  for (const Eigen::Quaterniond& rotation : cam_from_start) {
    const Eigen::Matrix3d R = rotation.toRotationMatrix();
    for (int i = 0; i < 3; ++i)
      for (int j = 0; j < 3; ++j) rotations_.push_back(R(i, j));
  }
  u_.resize(groups_.size() * num_rows());
  v_.resize(groups_.size() * num_rows());
}

void TurningAdjustment::take(std::span<const Eigen::Vector2d> px) {
  for (std::size_t g = 0; g < groups_.size(); ++g) {
    for (std::size_t row = 0; row < num_rows(); ++row) {
      Lanes &u = u_[g * num_rows() + row], &v = v_[g * num_rows() + row];
      for (std::size_t lane = 0; lane < 4; ++lane) {
        // A lane without a point repeats the last one; its sums are not used.
        const Eigen::Vector2d& pixel = px[row * num_points_ + std::min(4 * g + lane, num_points_ - 1)];
        u[static_cast<Eigen::Index>(lane)] = pixel.x();
        v[static_cast<Eigen::Index>(lane)] = pixel.y();
      }
    }
  }
}

/// Where the first row sees them, as far as the intrinsics are right.
void TurningAdjustment::place_points(const Eigen::Vector4d& k) {
  for (std::size_t g = 0; g < groups_.size(); ++g) {
    const Lanes x = (u_[g * num_rows()] - k[2]) / k[0], y = (v_[g * num_rows()] - k[3]) / k[1];
    const double* R = rotations_.data();
    const Lanes z = R[2] * x + R[5] * y + R[8];  // by the transpose: start_from_cam
    groups_[g].a = (R[0] * x + R[3] * y + R[6]) / z;
    groups_[g].b = (R[1] * x + R[4] * y + R[7]) / z;
  }
}

void TurningAdjustment::sum_row(std::size_t row, const Eigen::Vector4d& k, Group& s, std::size_t g) const {
  const double* R = &rotations_[9 * row];
  const Lanes inverse_z = 1.0 / (R[6] * s.a + R[7] * s.b + R[8]);
  const Lanes x = (R[0] * s.a + R[1] * s.b + R[2]) * inverse_z;
  const Lanes y = (R[3] * s.a + R[4] * s.b + R[5]) * inverse_z;
  const Lanes ru = u_[g * num_rows() + row] - (k[0] * x + k[2]);
  const Lanes rv = v_[g * num_rows() + row] - (k[1] * y + k[3]);
  const Lanes scale_u = k[0] * inverse_z, scale_v = k[1] * inverse_z;
  const Lanes ua = (R[0] - x * R[6]) * scale_u, ub = (R[1] - x * R[7]) * scale_u;
  const Lanes va = (R[3] - y * R[6]) * scale_v, vb = (R[4] - y * R[7]) * scale_v;
  s.xx += x * x;
  s.x += x;
  s.yy += y * y;
  s.y += y;
  s.ax += ua * x;
  s.a1 += ua;
  s.bx += ub * x;
  s.b1 += ub;
  s.ay += va * y;
  s.a2 += va;
  s.by += vb * y;
  s.b2 += vb;
  s.aa += ua * ua + va * va;
  s.ab += ua * ub + va * vb;
  s.bb += ub * ub + vb * vb;
  s.gfx += x * ru;
  s.gcx += ru;
  s.gfy += y * rv;
  s.gcy += rv;
  s.ga += ua * ru + va * rv;
  s.gb += ub * ru + vb * rv;
  s.squares += ru * ru + rv * rv;
}

void TurningAdjustment::pass(std::size_t stride, const Eigen::Vector4d& k) {
  for (std::size_t g = 0; g < groups_.size(); ++g) {
    Group sums = groups_[g];
    for (Lanes* each : {&sums.xx,  &sums.x,   &sums.yy,  &sums.y,  &sums.ax, &sums.a1,     &sums.bx, &sums.b1,
                        &sums.ay,  &sums.a2,  &sums.by,  &sums.b2, &sums.aa, &sums.ab,     &sums.bb, &sums.gfx,
                        &sums.gcx, &sums.gfy, &sums.gcy, &sums.ga, &sums.gb, &sums.squares})
      each->setZero();
    for (std::size_t row = 0; row < num_rows(); row += stride) sum_row(row, k, sums, g);
    groups_[g] = sums;
  }
}

namespace {

/// Of point i of a group: its coupling with the intrinsics, and the inverse of its own information.
template <typename Group>
Eigen::Matrix<double, 2, 4> coupling_of(const Group& s, Eigen::Index i) {
  return Eigen::Matrix<double, 2, 4>{{s.ax[i], s.ay[i], s.a1[i], s.a2[i]}, {s.bx[i], s.by[i], s.b1[i], s.b2[i]}};
}

template <typename Group>
Eigen::Matrix2d inverse_of(const Group& s, Eigen::Index i) {
  const double determinant = s.aa[i] * s.bb[i] - s.ab[i] * s.ab[i];
  return Eigen::Matrix2d{{s.bb[i], -s.ab[i]}, {-s.ab[i], s.aa[i]}} / determinant;
}

}  // namespace

/// A Gauss–Newton step of the sums of a pass. False: they do not determine the intrinsics.
bool TurningAdjustment::step(std::size_t num_rows, Eigen::Vector4d& k) {
  Eigen::Matrix4d& S = information_;
  Eigen::Vector4d gradient = Eigen::Vector4d::Zero();
  S.setZero();
  squares_ = gain_ = 0.0;
  const auto n = static_cast<double>(num_rows);
  for (std::size_t point = 0; point < num_points_; ++point) {
    const Group& s = groups_[point / 4];
    const auto i = static_cast<Eigen::Index>(point % 4);
    const Eigen::Matrix<double, 2, 4> B = coupling_of(s, i);
    const Eigen::Matrix2d D_inverse = inverse_of(s, i);
    const Eigen::Vector2d g(s.ga[i], s.gb[i]);
    S(0, 0) += s.xx[i];
    S(0, 2) += s.x[i];
    S(2, 2) += n;
    S(1, 1) += s.yy[i];
    S(1, 3) += s.y[i];
    S(3, 3) += n;
    S -= (B.transpose() * D_inverse * B).triangularView<Eigen::Upper>().toDenseMatrix();
    gradient += Eigen::Vector4d(s.gfx[i], s.gfy[i], s.gcx[i], s.gcy[i]) - B.transpose() * (D_inverse * g);
    squares_ += s.squares[i];
    gain_ += g.dot(D_inverse * g);
  }
  S.triangularView<Eigen::StrictlyLower>() = S.transpose();
  const Eigen::LLT<Eigen::Matrix4d> llt(S);
  if (llt.info() != Eigen::Success) return false;
  const Eigen::Vector4d move = llt.solve(gradient);
  gain_ += move.dot(gradient);
  if (!std::isfinite(gain_)) return false;
  k += move;
  for (std::size_t point = 0; point < num_points_; ++point) {
    Group& s = groups_[point / 4];
    const auto i = static_cast<Eigen::Index>(point % 4);
    const Eigen::Vector2d by = inverse_of(s, i) * (Eigen::Vector2d(s.ga[i], s.gb[i]) - coupling_of(s, i) * move);
    s.a[i] += by.x();
    s.b[i] += by.y();
  }
  return k[0] > 1.0 && k[1] > 1.0;
}

TurningAdjustment::Solution TurningAdjustment::solve(std::span<const Eigen::Vector2d> px,
                                                     const Eigen::Vector4d& start) {
  take(px);
  Solution found;
  found.k = start;
  place_points(found.k);
  const std::size_t stride = std::max<std::size_t>(num_rows() / coarse_rows, 1);
  const std::size_t used = (num_rows() + stride - 1) / stride;
  for (int i = 0; i < max_coarse_steps; ++i) {
    pass(stride, found.k);
    if (!step(used, found.k)) return found;
    if (gain_ < near * squares_) break;
  }
  const double dof = 2.0 * static_cast<double>(num_rows() * num_points_) - 4.0 - 2.0 * static_cast<double>(num_points_);
  for (int i = 0; i < max_steps && !found.has_value; ++i) {
    pass(1, found.k);
    if (!step(num_rows(), found.k)) return found;
    found.has_value = gain_ * dof < there * squares_;
  }
  found.sigma_px = std::sqrt(squares_ / dof);
  found.cov = found.sigma_px * found.sigma_px * information_.inverse();
  return found;
}

Eigen::Matrix4d TurningAdjustment::bound(std::span<const Eigen::Vector2d> px, const Eigen::Vector4d& k,
                                         double sigma_px) {
  take(px);
  place_points(k);
  pass(1, k);
  Eigen::Vector4d moved = k;
  if (!step(num_rows(), moved)) return Eigen::Matrix4d::Constant(std::numeric_limits<double>::infinity());
  return sigma_px * sigma_px * information_.inverse();
}

}  // namespace alidade
