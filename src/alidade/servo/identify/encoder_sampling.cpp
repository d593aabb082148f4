#include "alidade/servo/identify/encoder_sampling.h"

#include <Eigen/Core>
#include <algorithm>
#include <cmath>
#include <numbers>

#include "alidade/geometry/decompositions.h"
#include "alidade/geometry/degree.h"

namespace alidade {
namespace {

/// First Fourier harmonic of the delays at one frequency.
struct Harmonic {
  double power = 0.0, cosine = 0.0, sine = 0.0;
};
/// The harmonic at equally spaced frequencies. Phases are rotated from step
/// to step, and recomputed often enough to keep rounding errors at 10⁻¹⁴.
class HarmonicSweep {
 public:
  HarmonicSweep(const std::vector<Eigen::Vector3d>& late, double step_hz) {  // (t, e, weight)
    const auto num = static_cast<Eigen::Index>(late.size());
    const Eigen::ArrayXXd rows = Eigen::Map<const Eigen::Array3Xd>(late.front().data(), 3, num).transpose();
    t_s_ = rows.col(0);
    weight_ = rows.col(2);
    weighted_ = weight_ * rows.col(1);
    turn_cos_ = phases(step_hz).cos();
    turn_sin_ = phases(step_hz).sin();
    sum_ = weight_.sum();
    sum_e_ = weighted_.sum();
    sum_ee_ = (weighted_ * rows.col(1)).sum();
  }
  [[nodiscard]] Harmonic at(double hz) {
    cos_ = phases(hz).cos();
    sin_ = phases(hz).sin();
    since_ = 0;
    return here();
  }
  /// The harmonic one step after the previous one; `hz` is its frequency.
  [[nodiscard]] Harmonic next(double hz) {
    constexpr int most = 64;
    if (++since_ == most) return at(hz);
    turned_ = cos_ * turn_cos_ - sin_ * turn_sin_;
    sin_ = sin_ * turn_cos_ + cos_ * turn_sin_;
    cos_.swap(turned_);
    return here();
  }

 private:
  [[nodiscard]] Eigen::ArrayXd phases(double hz) const { return 2.0 * std::numbers::pi * hz * t_s_; }
  [[nodiscard]] Harmonic here() const {
    const double c = (weight_ * cos_).sum(), s = (weight_ * sin_).sum(), cs = (weight_ * cos_ * sin_).sum();
    const double cc = (weight_ * cos_.square()).sum(), ss = (weight_ * sin_.square()).sum();
    Eigen::Matrix3d normal;
    normal << sum_, c, s, c, cc, cs, s, cs, ss;
    const Eigen::Vector3d right(sum_e_, (weighted_ * cos_).sum(), (weighted_ * sin_).sum());
    const Eigen::Vector3d x = solve_symmetric(normal, right);
    const double before = sum_ee_ - sum_e_ * sum_e_ / sum_, after = sum_ee_ - x.dot(right);
    return {before / std::max(after, 1e-12) - 1.0, x[1], x[2]};
  }

  Eigen::ArrayXd t_s_, weight_, weighted_;  ///< `weighted_`: e times its weight.
  Eigen::ArrayXd turn_cos_, turn_sin_, cos_, sin_, turned_;
  double sum_ = 0.0, sum_e_ = 0.0, sum_ee_ = 0.0;
  int since_ = 0;
};

/// Remaining sum of squares of the delays of readings after subtracting a sawtooth of this period and phase.
double sawtooth_cost(const std::vector<Eigen::Vector3d>& late, double period, double phase) {
  double sum = 0.0, sum_e = 0.0, sum_ee = 0.0;
  for (const Eigen::Vector3d& each : late) {
    const double cycles = (each[0] - phase) / period;
    const double e = each[1] - period * (cycles - std::floor(cycles));
    sum += each[2];
    sum_e += each[2] * e;
    sum_ee += each[2] * e * e;
  }
  return sum_ee - sum_e * sum_e / sum;
}

/// Delays of the readings relative to the model, while it moves: (t, e, weight).
std::vector<Eigen::Vector3d> lateness(const AxisReadings& readings) {
  constexpr double least_rad_s = 1.0 * degree, longest_s = 0.4;
  const std::vector<double> angles = readings.model(readings.t_s);
  std::vector<Eigen::Vector3d> late;
  const std::size_t n = readings.t_s.size();
  for (std::size_t i = 0; i < n; ++i) {
    const std::size_t before = i > 0 ? i - 1 : 0, after = std::min(i + 1, n - 1);
    const double dt = readings.t_s[after] - readings.t_s[before];
    const double rate = dt > 0.0 ? (readings.angle_rad[after] - readings.angle_rad[before]) / dt : 0.0;
    if (std::abs(rate) < least_rad_s || std::abs(rate) * 0.02 < 2.0 * readings.sigma_rad[i]) continue;
    const double e = (angles[i] - readings.angle_rad[i]) / rate, sigma = readings.sigma_rad[i] / std::abs(rate) + 1e-3;
    if (std::abs(e) < longest_s) late.emplace_back(readings.t_s[i], e, 1.0 / (sigma * sigma));
  }
  return late;
}

/// Interpolation of a model between times at which it is computed once.
class SampledModel {
 public:
  SampledModel(const AxisReadings& readings, double margin_s)
      : begin_s_(readings.t_s.front() - margin_s),
        step_s_(std::max(least_step_s, (readings.t_s.back() - begin_s_ + margin_s) / max_points)) {
    std::vector<double> times;
    for (double t = begin_s_; t < readings.t_s.back() + margin_s + 2.0 * step_s_; t += step_s_) times.push_back(t);
    angles_ = readings.model(times);
  }
  [[nodiscard]] double at(double t_s) const {
    const double place = std::clamp((t_s - begin_s_) / step_s_, 0.0, static_cast<double>(angles_.size()) - 1.001);
    const auto i = static_cast<std::size_t>(place);
    const double share = place - static_cast<double>(i);
    return angles_[i] + share * (angles_[i + 1] - angles_[i]);
  }

 private:
  static constexpr double least_step_s = 1e-3, max_points = 2e5;
  double begin_s_, step_s_;
  std::vector<double> angles_;
};

}  // namespace

double EncoderSampling::cycle(double t_s) const { return std::floor((t_s - phase_s) / period_s); }
double EncoderSampling::last_s(double t_s) const { return phase_s + cycle(t_s) * period_s; }

double robust_residual(double z, double threshold) {
  const double size = std::abs(z);
  return size <= threshold ? z : std::copysign(threshold * std::sqrt(1.0 + 2.0 * std::log(size / threshold)), z);
}

std::optional<EncoderSampling> found_sampling(const AxisReadings& readings) {
  constexpr double slowest_hz = 3.0, fastest_hz = 120.0, min_gain = 0.5;
  constexpr std::size_t least = 60;
  const std::vector<Eigen::Vector3d> late = lateness(readings);
  if (late.size() < least) return std::nullopt;
  const double step_hz = 0.2 / (late.back()[0] - late.front()[0] + 1.0);
  double best = 0.0, best_hz = 0.0;
  HarmonicSweep sweep(late, step_hz);
  for (double hz = slowest_hz; hz < fastest_hz; hz += step_hz) {
    const double power = (hz == slowest_hz ? sweep.at(hz) : sweep.next(hz)).power;
    if (power > best) {
      best = power;
      best_hz = hz;
    }
  }
  if (best < min_gain) return std::nullopt;
  const Harmonic found = sweep.at(best_hz);
  const double amplitude = std::hypot(found.cosine, found.sine) * std::numbers::pi * best_hz;  // 1 for a full sawtooth
  if (amplitude < 0.5 || amplitude > 1.6) return std::nullopt;
  double cost = 1e300;
  EncoderSampling sampling;
  for (int i = -12; i <= 12; ++i) {
    const double period = 1.0 / (best_hz + step_hz * i / 6.0);
    for (int k = 0; k < 100; ++k) {
      const double phase = period * k / 100.0, tried = sawtooth_cost(late, period, phase);
      if (tried >= cost) continue;
      cost = tried;
      sampling = {period, phase};
    }
  }
  if (!(cost < 0.5 * sawtooth_cost(late, 1e-9, 0.0))) return std::nullopt;
  return sampling;
}

EncoderSampling refined_sampling(const AxisReadings& readings, const EncoderSampling& given) {
  constexpr double threshold = 4.0, first_s = 4e-3, closer = 0.2, same = 1.0;
  constexpr int half = 10, rounds = 4;
  const SampledModel sampled(readings, 2.0 * given.period_s);
  const double begin_s = readings.t_s.front(), end_s = readings.t_s.back();
  const double middle_s = given.last_s(0.5 * (begin_s + end_s));
  const double cycles = std::max(1.0, 0.5 * (end_s - begin_s) / given.period_s);
  // The samples of the model stay where they were fitted, except for the period; their assignment to readings changes.
  const auto cost_of = [&](double period, double shift) {
    double cost = 0.0;
    for (std::size_t i = 0; i < readings.t_s.size(); ++i) {
      const double sample_s = middle_s + period * std::floor((readings.t_s[i] - middle_s - shift) / period);
      const double z =
          robust_residual((sampled.at(sample_s) - readings.angle_rad[i]) / readings.sigma_rad[i], threshold);
      cost += z * z;
    }
    return cost;
  };
  double reach_s = std::min(first_s, 0.2 * given.period_s), period = given.period_s, shift = 0.0;
  for (int round = 0; round < rounds; ++round, reach_s *= closer) {
    double least = 1e300;
    Eigen::Vector2d sum = Eigen::Vector2d::Zero(), centre(period, shift);
    double count = 0.0;
    for (int i = -half; i <= half; ++i)
      for (int k = -half; k <= half; ++k) {
        const Eigen::Vector2d at = centre + Eigen::Vector2d(i / cycles, k) * reach_s / half;
        const double cost = cost_of(at[0], at[1]);
        if (cost > least + same) continue;
        if (cost < least - same) sum.setZero(), count = 0.0;
        least = std::min(least, cost);
        sum += at;
        count += 1.0;
      }
    period = sum[0] / count;
    shift = sum[1] / count;
  }
  return {period, middle_s + shift};
}

std::vector<double> sample_times(const AxisReadings& readings, const EncoderSampling& sampling,
                                 const std::vector<double>& edges_s) {
  constexpr double edge_s = 1.5e-3;
  const std::size_t n = readings.t_s.size();
  std::vector<double> times(n), other(n);
  for (std::size_t i = 0; i < n; ++i) {
    const double t = readings.t_s[i], period = sampling.period_s;
    times[i] = sampling.last_s(t);
    const double into = t - times[i], edge = edge_s + edges_s[i];
    other[i] = into < edge ? times[i] - period : period - into < edge ? times[i] + period : times[i];
  }
  const std::vector<double> first = readings.model(times);
  std::vector<std::size_t> order(n);
  for (std::size_t i = 0; i < n; ++i) order[i] = i;
  std::ranges::sort(order, {}, [&](std::size_t i) { return other[i]; });
  std::vector<double> sorted = other;
  std::ranges::sort(sorted);
  const std::vector<double> second = readings.model(sorted);
  for (std::size_t i = 0; i < n; ++i) {
    const std::size_t at = order[i];
    if (std::abs(second[i] - readings.angle_rad[at]) < std::abs(first[at] - readings.angle_rad[at]))
      times[at] = other[at];
  }
  for (std::size_t i = 1; i < n; ++i) times[i] = std::max(times[i], times[i - 1]);
  return times;
}

}  // namespace alidade
