#include "alidade/localize/imu/imu_alignment.h"

#include <Eigen/LU>
#include <algorithm>
#include <array>
#include <cmath>

#include "alidade/estimation/median.h"
#include "alidade/geometry/decompositions.h"
#include "alidade/geometry/degree.h"
#include "alidade/imu/preintegration.h"
#include "alidade/localize/imu/imu_rates.h"

namespace alidade {
namespace {

constexpr double little = 0.5;  // of the camera's rates: less correlation with the IMU's is chance

struct ForceSize {
  double mean = 0.0;    ///< Over gravity.
  double spread = 0.0;  ///< Over the mean.
};

/// Magnitude of the forces, over the readings within the path's time span.
std::optional<ForceSize> force_size(const Imu& imu, std::span<const TimedPose> path) {
  double sum = 0.0, squares = 0.0, num = 0.0;
  for (const ImuReading& reading : imu.readings) {
    if (reading.t_s < path.front().t_s || reading.t_s > path.back().t_s) continue;
    sum += reading.force_m_s2.norm();
    squares += reading.force_m_s2.squaredNorm();
    num += 1.0;
  }
  constexpr double few = 10.0;
  if (num < few) return std::nullopt;
  const double mean = sum / num, variance = std::max(squares / num - mean * mean, 0.0);
  return ForceSize{mean / imu.gravity_m_s2, std::sqrt(variance) / std::max(mean, 1e-9)};
}

/// Forces in g are mostly gravity, with nearly constant magnitude; accelerations without gravity are not.
ImuFault force_fault(const ForceSize& force) {
  constexpr double near = 0.3, in_g = 1.0 / 9.81, none = 0.3, nearly_one_size = 0.25;
  if (std::abs(force.mean - 1.0) < near) return ImuFault::none;
  if (std::abs(force.mean / in_g - 1.0) < near && force.spread < nearly_one_size) return ImuFault::force_g;
  return force.mean < none ? ImuFault::no_gravity : ImuFault::force_unit;
}

/// Fault of the rates, as far as the camera's rotations reveal it.
ImuFault rates_fault(const RateMatch& match, ImuEstimate& estimate) {
  constexpr double hardly_rad_s = 0.02, certain_chi2 = 30.0, near = 0.05, certain = 5.0;
  if (match.num == 0) return ImuFault::other_time;
  if (match.signal_rad_s < hardly_rad_s) return ImuFault::none;
  if (match.explained < little) return ImuFault::other_motion;
  if (match.mirrored_chi2 > certain_chi2) return ImuFault::mirrored;
  estimate.ratio = match.ratio;
  if (std::abs(match.ratio / degree - 1.0) < 2.0 * near) return ImuFault::rate_degrees;
  if (std::abs(match.ratio - 1.0) > near + certain * match.sigma_ratio) return ImuFault::rate_unit;
  return ImuFault::none;
}

/// Uses the given mounting, if the rotations do not contradict it; else the estimated one.
ImuFault mount(const Imu& imu, const RateMatch& match, ImuEstimate& estimate) {
  constexpr double certain_chi2 = 30.0, most_sigma_rad = 0.1;
  const Eigen::Matrix3d information = match.information;
  estimate.is_mounting_given = imu.mounting.has_value();
  if (imu.mounting) {
    estimate.cam_from_imu = imu.mounting->cam_from_imu;
    const Eigen::Vector3d off = log_so3(estimate.cam_from_imu.rotation * match.cam_from_imu.conjugate());
    const double given = imu.mounting->sigma_rotation_rad * imu.mounting->sigma_rotation_rad;
    // (H⁻¹ + σ² I)⁻¹, also valid if H is rank-deficient.
    const Eigen::Matrix3d weight =
        (Eigen::Matrix3d::Identity() + given * information).partialPivLu().solve(information);
    estimate.angle_rad = off.norm();
    if (match.explained < little) return ImuFault::none;  // a camera that hardly rotates
    if (!(off.dot(weight * off) > certain_chi2)) return ImuFault::none;
    estimate.cam_from_imu.rotation = match.cam_from_imu;
    return ImuFault::mounting;
  }
  estimate.cam_from_imu.rotation = match.cam_from_imu;
  const double least = symmetric_eigen3(information).values[0];
  return least > 1.0 / (most_sigma_rad * most_sigma_rad) ? ImuFault::none : ImuFault::unmounted;
}

/// Three nodes of the path with the steps between them: D = λ (m − arm) + h Rᵀ γ + J β, with λ = 1/scale, γ = λ g and β
/// = λ times the bias of the forces.
struct AlignmentRow {
  Eigen::Vector3d D;
  Eigen::Matrix<double, 3, 7> J;
  Eigen::Vector3d force_in_world;  ///< Mean over the first step.
  double weight = 1.0;
};

std::vector<AlignmentRow> rows_of(std::span<const ImuReading> readings, std::span<const TimedPose> path,
                                  const Eigen::Vector3d& rate_bias, const Eigen::Vector3d& imu_in_cam) {
  constexpr double apart_s = 0.25;
  const double max_gap_s = max_imu_gap_s(readings);
  std::vector<std::size_t> nodes{0};
  for (std::size_t k = 1; k < path.size(); ++k)
    if (path[k].t_s - path[nodes.back()].t_s >= apart_s - 1e-6) nodes.push_back(k);
  std::vector<std::optional<ImuStep>> steps;
  for (std::size_t i = 0; i + 1 < nodes.size(); ++i)
    steps.push_back(preintegrated(readings, path[nodes[i]].t_s, path[nodes[i + 1]].t_s, max_gap_s, rate_bias,
                                  Eigen::Vector3d::Zero()));
  std::vector<AlignmentRow> rows;
  for (std::size_t i = 0; i + 1 < steps.size(); ++i) {
    if (!steps[i] || !steps[i + 1]) continue;
    const ImuStep &a = *steps[i], &b = *steps[i + 1];
    const Rigid3 &p0 = path[nodes[i]].world_from_cam, &p1 = path[nodes[i + 1]].world_from_cam,
                 &p2 = path[nodes[i + 2]].world_from_cam;
    const Eigen::Matrix3d R0t = p0.rotation.conjugate().toRotationMatrix(), R01 = R0t * p1.rotation.toRotationMatrix();
    const auto change = [&](const Eigen::Vector3d& q0, const Eigen::Vector3d& q1, const Eigen::Vector3d& q2) {
      return Eigen::Vector3d(R0t * ((q2 - q1) / b.dt_s - (q1 - q0) / a.dt_s));
    };
    const Eigen::Vector3d arm = change(p0.rotation * imu_in_cam, p1.rotation * imu_in_cam, p2.rotation * imu_in_cam);
    AlignmentRow row{
        change(p0.translation, p1.translation, p2.translation), {}, p0.rotation * a.velocity / a.dt_s, 1.0};
    row.J.col(0) = a.velocity - a.position / a.dt_s + R01 * b.position / b.dt_s - arm;
    row.J.middleCols<3>(1) = 0.5 * (a.dt_s + b.dt_s) * R0t;
    row.J.rightCols<3>() = a.velocity_by_force - a.position_by_force / a.dt_s + R01 * b.position_by_force / b.dt_s;
    rows.push_back(row);
  }
  return rows;
}

struct AlignmentFit {
  Eigen::Vector<double, 7> x = Eigen::Vector<double, 7>::Zero();
  Eigen::Matrix<double, 7, 7> cov = Eigen::Matrix<double, 7, 7>::Zero();
};

enum class Gravity { free, known };

/// With Gravity::known: priors of the magnitudes of gravity, linearised at the direction in `before`, and of the bias.
std::optional<AlignmentFit> fit(std::span<const AlignmentRow> rows, const Imu& imu, Gravity gravity,
                                const AlignmentFit* before) {
  Eigen::Matrix<double, 7, 7> H = Eigen::Matrix<double, 7, 7>::Zero();
  Eigen::Vector<double, 7> g = Eigen::Vector<double, 7>::Zero();
  double weights = 0.0, squares = 0.0;
  for (const AlignmentRow& row : rows) {
    H += row.weight * row.J.transpose() * row.J;
    g += row.weight * row.J.transpose() * row.D;
    weights += 3.0 * row.weight;
    if (before) squares += row.weight * (row.D - row.J * before->x).squaredNorm();
  }
  const double variance = before ? squares / std::max(weights - 7.0, 1.0) : 1.0;
  if (before && gravity == Gravity::known) {
    const double lambda = before->x[0];
    Eigen::Vector<double, 7> of_gravity = Eigen::Vector<double, 7>::Zero();
    of_gravity.segment<3>(1) = before->x.segment<3>(1).normalized();
    of_gravity[0] = -imu.gravity_m_s2;
    H += variance / std::pow(lambda * imu.sigma_gravity_m_s2, 2) * of_gravity * of_gravity.transpose();
    H.diagonal().tail<3>().array() += variance / std::pow(lambda * imu.noise.sigma_force_bias, 2);
  } else {
    H.diagonal().tail<3>().array() += 1e-3 * H.diagonal().tail<3>().sum();  // for a camera that hardly rotates
  }
  const Ldlt ldlt(H);
  if (!(ldlt.min_pivot() > 0.0)) return std::nullopt;
  AlignmentFit out{ldlt.solve(g), variance * ldlt.inverse()};
  if (!out.x.allFinite() || !out.cov.allFinite()) return std::nullopt;
  return out;
}

void weigh(std::vector<AlignmentRow>& rows, const AlignmentFit& at) {
  std::vector<double> sizes;
  for (const AlignmentRow& row : rows) sizes.push_back((row.D - row.J * at.x).norm());
  const double usual = 3.0 * median_of(sizes) + 1e-12;  // the median of three components is 1.5σ
  for (std::size_t i = 0; i < rows.size(); ++i) rows[i].weight = 1.0 / (1.0 + std::pow(sizes[i] / usual, 2));
}

/// Reason why forces do not determine the scale: in the world frame they are constant if a camera does not accelerate.
ImuFault undetermined(std::span<const AlignmentRow> rows) {
  constexpr double hardly_m_s2 = 0.2;
  Eigen::Vector3d mean = Eigen::Vector3d::Zero();
  for (const AlignmentRow& row : rows) mean += row.force_in_world / static_cast<double>(rows.size());
  double squares = 0.0;
  for (const AlignmentRow& row : rows) squares += (row.force_in_world - mean).squaredNorm();
  return squares < hardly_m_s2 * hardly_m_s2 * static_cast<double>(rows.size()) ? ImuFault::still : ImuFault::misfit;
}

/// Estimates scale, gravity and the force bias.
ImuFault find_scale(const Imu& imu, std::span<const ImuReading> readings, std::span<const TimedPose> path,
                    ImuEstimate& estimate) {
  std::vector<AlignmentRow> rows = rows_of(readings, path, estimate.rate_bias, estimate.cam_from_imu.translation);
  constexpr std::size_t enough = 8;
  if (rows.size() < enough) return ImuFault::few;
  auto found = fit(rows, imu, Gravity::free, nullptr);
  if (!found) return undetermined(rows);
  constexpr double certain = 5.0;
  const auto sure = fit(rows, imu, Gravity::free, &*found);
  if (sure && sure->x[0] < -certain * std::sqrt(sure->cov(0, 0))) return ImuFault::reversed;
  constexpr int rounds = 4;
  for (int round = 0; round < rounds; ++round) {
    if (found->x[0] == 0.0) return undetermined(rows);
    weigh(rows, *found);
    const AlignmentFit before = *found;
    found = fit(rows, imu, Gravity::known, &before);
    if (!found) return undetermined(rows);
  }
  const double lambda = found->x[0];
  if (!(lambda > 0.0)) return undetermined(rows);
  estimate.scale = 1.0 / lambda;
  estimate.sigma_scale = std::sqrt(found->cov(0, 0)) / lambda;
  estimate.gravity_in_world = found->x.segment<3>(1) / lambda;
  estimate.force_bias = found->x.tail<3>() / lambda;
  constexpr double useless = 0.3;
  return estimate.sigma_scale < useless ? ImuFault::none : undetermined(rows);
}

}  // namespace

double max_imu_gap_s(std::span<const ImuReading> readings) {
  constexpr double usual_gaps = 4.5;
  return usual_gaps * usual_period_s(readings);
}

ImuAlignment align_imu(const Imu& imu, std::span<const TimedPose> path) {
  ImuAlignment out;
  ImuEstimate& estimate = out.estimate;
  if (path.size() < 3 || imu.readings.size() < 3) {
    estimate.fault = ImuFault::few;
    return out;
  }
  const std::optional<ForceSize> force = force_size(imu, path);
  estimate.fault = force ? force_fault(*force) : ImuFault::other_time;
  estimate.ratio = force ? force->mean : 1.0;
  if (estimate.fault != ImuFault::none) return out;
  RateMatch match = match_rates(imu.readings, path);
  if (match.explained < little) match.late_s = match.clock_rate = 0.0;
  estimate.fault = rates_fault(match, estimate);
  if (estimate.fault == ImuFault::none) estimate.fault = mount(imu, match, estimate);
  estimate.late_s = match.late_s;
  estimate.sigma_late_s = match.sigma_late_s;
  estimate.clock_rate = match.clock_rate;
  estimate.sigma_clock_rate = match.sigma_clock_rate;
  if (estimate.fault != ImuFault::none) return out;
  const Eigen::Quaterniond& rotation = estimate.cam_from_imu.rotation;
  for (const ImuReading& reading : imu.readings)
    out.readings.push_back(
        {path_time_s(match, reading.t_s), rotation * reading.rate_rad_s, rotation * reading.force_m_s2});
  estimate.rate_bias = rotation * match.mean_imu - match.mean_cam;
  estimate.fault = find_scale(imu, out.readings, path, estimate);
  return out;
}

}  // namespace alidade
