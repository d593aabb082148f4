#include "alidade/localize/imu/imu_rates.h"

#include <Eigen/LU>
#include <algorithm>
#include <cmath>

#include "alidade/geometry/decompositions.h"
#include "alidade/localize/imu/imu_alignment.h"

namespace alidade {
namespace {

/// ∫ rate dt from the first reading on; gives the mean between any two times without a gap between them.
class RateIntegral {
 public:
  explicit RateIntegral(std::span<const ImuReading> readings) : readings_(readings) {
    const double max_gap_s = max_imu_gap_s(readings);
    sums_.push_back({});
    for (std::size_t i = 1; i < readings.size(); ++i) {
      const double h = readings[i].t_s - readings[i - 1].t_s;
      const Eigen::Vector3d twice = readings[i].rate_rad_s + readings[i - 1].rate_rad_s;
      sums_.push_back({sums_.back().angle + 0.5 * h * twice, sums_.back().num_gaps + (h > max_gap_s ? 1 : 0)});
    }
  }
  [[nodiscard]] std::optional<Eigen::Vector3d> mean(double from_s, double to_s) const {
    const auto begin = at(from_s), end = at(to_s);
    if (!begin || !end || begin->num_gaps != end->num_gaps) return std::nullopt;
    return Eigen::Vector3d((end->angle - begin->angle) / (to_s - from_s));
  }

 private:
  struct Sum {
    Eigen::Vector3d angle = Eigen::Vector3d::Zero();
    std::size_t num_gaps = 0;
  };
  /// Empty within a gap.
  [[nodiscard]] std::optional<Sum> at(double t_s) const {
    const auto after = std::ranges::upper_bound(readings_, t_s, {}, &ImuReading::t_s);
    if (after == readings_.begin() || after == readings_.end()) return std::nullopt;
    const auto i = static_cast<std::size_t>(after - readings_.begin());
    if (sums_[i].num_gaps != sums_[i - 1].num_gaps) return std::nullopt;
    const ImuReading &a = *(after - 1), &b = *after;
    const double h = b.t_s - a.t_s, s = t_s - a.t_s;
    const Eigen::Vector3d rate = a.rate_rad_s + 0.5 * s / h * (b.rate_rad_s - a.rate_rad_s);
    return Sum{sums_[i - 1].angle + s * rate, sums_[i - 1].num_gaps};
  }
  std::span<const ImuReading> readings_;
  std::vector<Sum> sums_;
};

/// The camera's mean rate in an interval.
struct CameraRate {
  double from_s = 0.0, to_s = 0.0;
  Eigen::Vector3d rate = Eigen::Vector3d::Zero();
};

/// Consecutive intervals: overlapping ones would not be independent.
std::vector<CameraRate> camera_rates(std::span<const TimedPose> path) {
  constexpr double long_enough_s = 0.095, too_long_s = 0.5;
  constexpr std::size_t most = 1000;
  std::vector<CameraRate> rates;
  for (std::size_t i = 0, end = 0; i + 1 < path.size(); i = end) {
    for (end = i + 1; end + 1 < path.size() && path[end].t_s - path[i].t_s < long_enough_s;) ++end;
    const double dt_s = path[end].t_s - path[i].t_s;
    if (!(dt_s < too_long_s)) continue;
    const auto turn = path[i].world_from_cam.rotation.conjugate() * path[end].world_from_cam.rotation;
    rates.push_back({path[i].t_s, path[end].t_s, log_so3(turn) / dt_s});
  }
  const std::size_t stride = rates.size() / most + 1;
  std::vector<CameraRate> some;
  for (std::size_t i = 0; i < rates.size(); i += stride) some.push_back(rates[i]);
  return some;
}

/// Sums about the means.
struct Moments {
  std::size_t num = 0;
  Eigen::Vector3d cam = Eigen::Vector3d::Zero(), imu = Eigen::Vector3d::Zero();
  Eigen::Matrix3d cam_imu = Eigen::Matrix3d::Zero(), imu_imu = Eigen::Matrix3d::Zero();
  double cam_cam = 0.0;

  /// Residual sum of squares of the camera's rates after the best linear function of the IMU's.
  [[nodiscard]] double left() const {
    Eigen::Matrix3d H = imu_imu;
    constexpr double hardly = 1e-9;
    H.diagonal().array() += hardly * (imu_imu.trace() + 1e-12);
    return cam_cam - (cam_imu * Ldlt(H).solve_each(cam_imu.transpose())).trace();
  }
};

Moments moments(std::span<const CameraRate> rates, const RateIntegral& integral, double late_s) {
  Moments sums;
  for (const CameraRate& each : rates) {
    const auto imu = integral.mean(each.from_s + late_s, each.to_s + late_s);
    if (!imu) continue;
    ++sums.num;
    sums.cam += each.rate;
    sums.imu += *imu;
    sums.cam_imu += each.rate * imu->transpose();
    sums.imu_imu += *imu * imu->transpose();
    sums.cam_cam += each.rate.squaredNorm();
  }
  if (sums.num == 0) return sums;
  const double num = static_cast<double>(sums.num);
  sums.cam /= num;
  sums.imu /= num;
  sums.cam_imu -= num * sums.cam * sums.imu.transpose();
  sums.imu_imu -= num * sums.imu * sums.imu.transpose();
  sums.cam_cam -= num * sums.cam.squaredNorm();
  return sums;
}

/// The clock offset with the least residual, by a grid and a parabola through the best one's neighbours.
void find_clock(std::span<const CameraRate> rates, const RateIntegral& integral, RateMatch& match) {
  constexpr double most_s = 1.0, step_s = 0.01;
  constexpr int num_steps = static_cast<int>(most_s / step_s + 0.5);
  constexpr double enough_share = 0.6;
  const auto enough = static_cast<std::size_t>(enough_share * static_cast<double>(rates.size()));
  const auto left_at = [&](double late_s) {
    const Moments sums = moments(rates, integral, late_s);
    return sums.num >= std::max<std::size_t>(enough, 10) ? sums.left() / static_cast<double>(sums.num) : 1e300;
  };
  int best = 0;
  double least = left_at(0.0);
  for (int i = -num_steps; i <= num_steps; ++i) {
    const double left = left_at(i * step_s);
    if (!(left < least)) continue;
    least = left;
    best = i;
  }
  if (std::abs(best) >= num_steps || !(least < 1e299)) return;
  const double before = left_at((best - 1) * step_s), after = left_at((best + 1) * step_s);
  const double bend = before - 2.0 * least + after;
  if (!(bend > 0.0) || !(before + after < 1e299)) return;
  const double offset = 0.5 * (before - after) / bend;
  // For the mean square Q/N, with noise σ² = Q/(3N): σ_t² = 2 σ² / Q″.
  const double noise = std::max(least - bend * 0.5 * offset * offset, 1e-12) / 3.0;
  match.sigma_late_s = step_s * std::sqrt(2.0 * noise / (bend * static_cast<double>(rates.size())));
  match.late_s = step_s * (best + offset);
}

constexpr double unsure_s = 0.05;

/// Drift of the clock, from independent offsets of parts of the path: a straight line through them, if its slope is
/// significant.
void find_clock_rate(std::span<const CameraRate> rates, const RateIntegral& integral, RateMatch& match) {
  constexpr std::size_t part_of = 40, fewest = 3, most = 12;
  const std::size_t num_parts = std::min(rates.size() / part_of, most);
  if (num_parts < fewest) return;
  Eigen::Matrix2d H = Eigen::Matrix2d::Zero();
  Eigen::Vector2d b = Eigen::Vector2d::Zero();
  double squares = 0.0, num = 0.0;
  for (std::size_t i = 0; i < num_parts; ++i) {
    const std::size_t begin = i * rates.size() / num_parts, end = (i + 1) * rates.size() / num_parts;
    RateMatch part;
    find_clock(rates.subspan(begin, end - begin), integral, part);
    if (!(part.sigma_late_s < unsure_s)) continue;
    const Eigen::Vector2d row(1.0, 0.5 * (rates[begin].from_s + rates[end - 1].to_s) - match.mid_s);
    const double weight = 1.0 / (part.sigma_late_s * part.sigma_late_s);
    H += weight * row * row.transpose();
    b += weight * part.late_s * row;
    squares += weight * part.late_s * part.late_s;
    num += 1.0;
  }
  if (num < fewest) return;
  const Eigen::Matrix2d cov = H.inverse();
  const Eigen::Vector2d line = cov * b;
  const double left = std::max((squares - b.dot(line)) / (num - 2.0), 1.0), sigma = std::sqrt(left * cov(1, 1));
  constexpr double clear = 5.0, any_rate = 0.02;
  if (!(std::abs(line[1]) > clear * sigma) || !(std::abs(line[1]) < any_rate)) return;
  match.late_s = line[0];
  match.sigma_late_s = std::sqrt(left * cov(0, 0));
  match.clock_rate = line[1];
  match.sigma_clock_rate = sigma;
}

}  // namespace

double path_time_s(const RateMatch& match, double t_s) {
  return match.mid_s + (t_s - match.mid_s - match.late_s) / (1.0 + match.clock_rate);
}

RateMatch match_rates(std::span<const ImuReading> given, std::span<const TimedPose> path) {
  RateMatch match;
  match.mid_s = 0.5 * (path.front().t_s + path.back().t_s);
  const std::vector<CameraRate> rates = camera_rates(path);
  const RateIntegral of_given(given);
  find_clock(rates, of_given, match);
  if (!(match.sigma_late_s < unsure_s)) match.late_s = 0.0;
  find_clock_rate(rates, of_given, match);
  std::vector<ImuReading> readings(given.begin(), given.end());
  for (ImuReading& reading : readings) reading.t_s = path_time_s(match, reading.t_s);
  const Moments sums = moments(rates, RateIntegral(readings), 0.0);
  match.num = sums.num;
  constexpr std::size_t enough = 10;
  if (sums.num < enough) return match;
  const double num = static_cast<double>(sums.num), left = std::max(sums.left(), 1e-12);
  const Svd svd = svd_of(sums.cam_imu);
  const double sign = (svd.U * svd.V.transpose()).determinant() < 0.0 ? -1.0 : 1.0;
  const Eigen::Matrix3d R = svd.U * Eigen::Vector3d(1.0, 1.0, sign).asDiagonal() * svd.V.transpose();
  const double variance = left / (3.0 * num), squares = sums.imu_imu.trace();
  match.cam_from_imu = Eigen::Quaterniond(R);
  match.mirrored_chi2 =
      sign < 0.0 && squares > 0.0
          ? (std::pow(svd.values.sum(), 2) - std::pow(svd.values[0] + svd.values[1] - svd.values[2], 2)) /
                (squares * variance)
          : 0.0;
  const double in_common = svd.values[0] + svd.values[1] + std::abs(svd.values[2]);
  match.ratio = squares > 0.0 ? in_common / squares : 1.0;
  match.sigma_ratio = squares > 0.0 ? std::sqrt(variance / squares) : 1e9;
  match.explained = sums.cam_cam > 0.0 ? 1.0 - left / sums.cam_cam : 0.0;
  match.signal_rad_s = match.ratio * std::sqrt(squares / num);
  const Eigen::Matrix3d in_cam = match.ratio * match.ratio * R * sums.imu_imu * R.transpose();
  match.information = (in_cam.trace() * Eigen::Matrix3d::Identity() - in_cam) / variance;
  match.mean_imu = sums.imu;
  match.mean_cam = sums.cam;
  return match;
}

}  // namespace alidade
