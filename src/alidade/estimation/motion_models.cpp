#include "alidade/estimation/motion_models.h"

#include <Eigen/Geometry>
#include <cmath>

#include "alidade/estimation/van_loan.h"

namespace alidade {
namespace {

using Matrix3 = Eigen::Matrix3d;
using Vector3 = Eigen::Vector3d;

/// The same small system on each of three axes: block (i, j) is s(i, j) I.
template <int N>
Eigen::Matrix<double, 3 * N, 3 * N> on_three_axes(const Eigen::Matrix<double, N, N>& s) {
  Eigen::Matrix<double, 3 * N, 3 * N> result = Eigen::Matrix<double, 3 * N, 3 * N>::Zero();
  for (int i = 0; i < N; ++i) {
    for (int j = 0; j < N; ++j) result.template block<3, 3>(3 * i, 3 * j).diagonal().setConstant(s(i, j));
  }
  return result;
}

template <class Model>
Belief<Model::dim> predicted_by_matrices(const Model& model, const Belief<Model::dim>& belief, double dt_s) {
  using Square = Eigen::Matrix<double, Model::dim, Model::dim>;
  const Square F = model.transition_jacobian(belief.x, dt_s);
  const Square FP = F * belief.P;
  Belief<Model::dim> result;
  result.x = model.transition(belief.x, dt_s);
  result.P.noalias() = FP * F.transpose() + model.noise(dt_s);
  mirror_upper<Model::dim>(result.P);
  return result;
}

Discretised<2> axis_of(const MeanReverting& model, double dt_s) {
  Eigen::Matrix2d A, D = Eigen::Matrix2d::Zero();
  A << 0.0, 1.0, 0.0, -1.0 / model.tau_s;
  D(1, 1) = 2.0 * model.sigma_v_m_s * model.sigma_v_m_s / model.tau_s;
  return discretised<2>(A, D, dt_s);
}

Discretised<3> axis_of(const Singer& model, double dt_s) {
  Matrix3 A, D = Matrix3::Zero();
  A << 0.0, 1.0, 0.0, 0.0, 0.0, 1.0, 0.0, 0.0, -1.0 / model.tau_s;
  D(2, 2) = 2.0 * model.sigma_a_m_s2 * model.sigma_a_m_s2 / model.tau_s;
  return discretised<3>(A, D, dt_s);
}

Matrix3 cross(const Vector3& v) {
  return (Matrix3() << 0.0, -v.z(), v.y(), v.z(), 0.0, -v.x(), -v.y(), v.x(), 0.0).finished();
}

/// The functions of θ = |φ| in a rotation about φ and its integral, and their derivatives divided by θ.
struct TurnSeries {
  double s, a, b;     ///< sin θ/θ, (1 − cos θ)/θ², (θ − sin θ)/θ³
  double ds, da, db;  ///< (d/dθ)/θ of each

  explicit TurnSeries(double theta2) {
    if (theta2 < 1e-2) {  // the next terms are below 1e-13
      const double t2 = theta2, t4 = t2 * t2, t6 = t4 * t2;
      s = 1.0 - t2 / 6.0 + t4 / 120.0 - t6 / 5040.0 + t4 * t4 / 362880.0;
      a = 0.5 - t2 / 24.0 + t4 / 720.0 - t6 / 40320.0 + t4 * t4 / 3628800.0;
      b = 1.0 / 6.0 - t2 / 120.0 + t4 / 5040.0 - t6 / 362880.0 + t4 * t4 / 39916800.0;
      ds = -1.0 / 3.0 + t2 / 30.0 - t4 / 840.0 + t6 / 45360.0 - t4 * t4 / 3991680.0;
      da = -1.0 / 12.0 + t2 / 180.0 - t4 / 6720.0 + t6 / 453600.0 - t4 * t4 / 47900160.0;
      db = -1.0 / 60.0 + t2 / 1260.0 - t4 / 60480.0 + t6 / 4989600.0 - t4 * t4 / 622702080.0;
      return;
    }
    const double t = std::sqrt(theta2), sine = std::sin(t), cosine = std::cos(t);
    s = sine / t;
    a = (1.0 - cosine) / theta2;
    b = (t - sine) / (theta2 * t);
    ds = (cosine - s) / theta2;
    da = (s - 2.0 * a) / theta2;
    db = (a - 3.0 * b) / theta2;
  }
};

}  // namespace

Eigen::Vector<double, 6> ConstantVelocity::transition(const Eigen::Vector<double, 6>& x, double dt_s) const {
  Eigen::Vector<double, 6> next = x;
  next.head<3>() += dt_s * x.tail<3>();
  return next;
}

Eigen::Matrix<double, 6, 6> ConstantVelocity::transition_jacobian(const Eigen::Vector<double, 6>&, double dt_s) const {
  Eigen::Matrix<double, 6, 6> F = Eigen::Matrix<double, 6, 6>::Identity();
  F.topRightCorner<3, 3>().diagonal().setConstant(dt_s);
  return F;
}

Eigen::Matrix<double, 6, 6> ConstantVelocity::noise(double dt_s) const {
  const double q = density();
  Eigen::Matrix2d s;
  s << q * dt_s * dt_s * dt_s / 3.0, q * dt_s * dt_s / 2.0, q * dt_s * dt_s / 2.0, q * dt_s;
  return on_three_axes<2>(s);
}

Belief<6> ConstantVelocity::predicted(const Belief<6>& belief, double dt_s) const {
  const double q = density(), q_pv = 0.5 * q * dt_s * dt_s, q_pp = q * dt_s * dt_s * dt_s / 3.0;
  Belief<6> next;
  for (int i = 0; i < 3; ++i) {
    next.x[i] = belief.x[i] + dt_s * belief.x[3 + i];
    next.x[3 + i] = belief.x[3 + i];
    for (int j = 0; j < 3; ++j) {  // by hand: three times as fast as the products of sparse 6×6 matrices
      const double vv = belief.P(3 + i, 3 + j), pv = belief.P(i, 3 + j) + dt_s * vv;
      next.P(3 + i, 3 + j) = vv;
      next.P(i, 3 + j) = next.P(3 + j, i) = pv;
      next.P(i, j) = belief.P(i, j) + dt_s * (belief.P(3 + i, j) + pv);
    }
  }
  for (int i = 0; i < 3; ++i) {
    next.P(i, i) += q_pp;
    next.P(i, 3 + i) = next.P(3 + i, i) += q_pv;
    next.P(3 + i, 3 + i) += q * dt_s;
  }
  return next;
}

Eigen::Vector<double, 6> Ballistic::transition(const Eigen::Vector<double, 6>& x, double dt_s) const {
  Eigen::Vector<double, 6> later = ConstantVelocity{sigma_a_m_s2}.transition(x, dt_s);
  later.head<3>() += 0.5 * dt_s * dt_s * gravity_m_s2;
  later.tail<3>() += dt_s * gravity_m_s2;
  return later;
}

Eigen::Matrix<double, 6, 6> Ballistic::transition_jacobian(const Eigen::Vector<double, 6>& x, double dt_s) const {
  return ConstantVelocity{sigma_a_m_s2}.transition_jacobian(x, dt_s);
}

Eigen::Matrix<double, 6, 6> Ballistic::noise(double dt_s) const { return ConstantVelocity{sigma_a_m_s2}.noise(dt_s); }

Belief<6> Ballistic::predicted(const Belief<6>& belief, double dt_s) const {
  Belief<6> later = ConstantVelocity{sigma_a_m_s2}.predicted(belief, dt_s);
  later.x = transition(belief.x, dt_s);
  return later;
}

Eigen::Vector<double, 6> MeanReverting::transition(const Eigen::Vector<double, 6>& x, double dt_s) const {
  const double decay = std::exp(-dt_s / tau_s);
  Eigen::Vector<double, 6> next;
  next << x.head<3>() + tau_s * (1.0 - decay) * x.tail<3>(), decay * x.tail<3>();
  return next;
}

Eigen::Matrix<double, 6, 6> MeanReverting::transition_jacobian(const Eigen::Vector<double, 6>&, double dt_s) const {
  return on_three_axes<2>(axis_of(*this, dt_s).F);
}

Eigen::Matrix<double, 6, 6> MeanReverting::noise(double dt_s) const { return on_three_axes<2>(axis_of(*this, dt_s).Q); }

Belief<6> MeanReverting::predicted(const Belief<6>& belief, double dt_s) const {
  return predicted_by_matrices(*this, belief, dt_s);
}

Eigen::Vector<double, 9> Singer::transition(const Eigen::Vector<double, 9>& x, double dt_s) const {
  return transition_jacobian(x, dt_s) * x;
}

Eigen::Matrix<double, 9, 9> Singer::transition_jacobian(const Eigen::Vector<double, 9>&, double dt_s) const {
  return on_three_axes<3>(axis_of(*this, dt_s).F);
}

Eigen::Matrix<double, 9, 9> Singer::noise(double dt_s) const { return on_three_axes<3>(axis_of(*this, dt_s).Q); }

Belief<9> Singer::predicted(const Belief<9>& belief, double dt_s) const {
  const Discretised<3> axis = axis_of(*this, dt_s);
  const Eigen::Matrix<double, 9, 9> F = on_three_axes<3>(axis.F), FP = F * belief.P;
  Belief<9> next;
  next.x = F * belief.x;
  next.P.noalias() = FP * F.transpose() + on_three_axes<3>(axis.Q);
  mirror_upper<9>(next.P);
  return next;
}

Eigen::Vector<double, 9> CoordinatedTurn::transition(const Eigen::Vector<double, 9>& x, double dt_s) const {
  const Vector3 v = x.segment<3>(3), phi = dt_s * x.tail<3>(), across = phi.cross(v), back = phi.cross(across);
  const TurnSeries f(phi.squaredNorm());
  Eigen::Vector<double, 9> next = x;
  next.head<3>() += dt_s * (v + f.a * across + f.b * back);
  next.segment<3>(3) += f.s * across + f.a * back;
  return next;
}

Eigen::Matrix<double, 9, 9> CoordinatedTurn::transition_jacobian(const Eigen::Vector<double, 9>& x, double dt_s) const {
  const Vector3 v = x.segment<3>(3), phi = dt_s * x.tail<3>(), across = phi.cross(v), back = phi.cross(across);
  const TurnSeries f(phi.squaredNorm());
  const Matrix3 turn = cross(phi), turn2 = turn * turn;
  const Matrix3 J_across = -cross(v);
  const Matrix3 J_back = phi * v.transpose() + phi.dot(v) * Matrix3::Identity() - 2.0 * v * phi.transpose();
  Eigen::Matrix<double, 9, 9> F = Eigen::Matrix<double, 9, 9>::Identity();
  F.block<3, 3>(0, 3) = dt_s * (Matrix3::Identity() + f.a * turn + f.b * turn2);
  F.block<3, 3>(3, 3) += f.s * turn + f.a * turn2;
  F.block<3, 3>(0, 6) = dt_s * dt_s * (f.a * J_across + f.b * J_back + (f.da * across + f.db * back) * phi.transpose());
  F.block<3, 3>(3, 6) = dt_s * (f.s * J_across + f.a * J_back + (f.ds * across + f.da * back) * phi.transpose());
  return F;
}

Eigen::Matrix<double, 9, 9> CoordinatedTurn::noise(double dt_s) const {
  Eigen::Matrix<double, 9, 9> Q = Eigen::Matrix<double, 9, 9>::Zero();
  Q.topLeftCorner<6, 6>() = ConstantVelocity{sigma_a_m_s2}.noise(dt_s);
  const double walk = turn_density_rad_s_per_rt_s * turn_density_rad_s_per_rt_s;
  Q.bottomRightCorner<3, 3>().diagonal().setConstant(walk * dt_s);
  return Q;
}

Belief<9> CoordinatedTurn::predicted(const Belief<9>& belief, double dt_s) const {
  return predicted_by_matrices(*this, belief, dt_s);
}

}  // namespace alidade
