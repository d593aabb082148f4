#include "alidade/network/moving_scale.h"

#include <algorithm>
#include <cmath>

#include "alidade/geometry/decompositions.h"
#include "alidade/geometry/so3.h"

namespace alidade {
namespace {

struct Pairs {
  std::vector<Eigen::Vector3d> path, truth;
  std::vector<double> t_s;
};

Pairs pairs_at(std::span<const double> t_s, std::span<const Eigen::Vector3d> path, const TrueTrack& truth,
               double offset_s, double rate, std::size_t stride) {
  Pairs pairs;
  for (std::size_t i = 0; i < t_s.size(); i += stride) {
    const auto true_position = truth.at(offset_s + rate * t_s[i]);
    if (!true_position) continue;
    pairs.path.push_back(path[i]);
    pairs.truth.push_back(*true_position);
    pairs.t_s.push_back(t_s[i]);
  }
  return pairs;
}

std::vector<double> misses(const Pairs& pairs, const Similarity& fit) {
  std::vector<double> lengths;
  for (std::size_t i = 0; i < pairs.path.size(); ++i)
    lengths.push_back(
        (fit.scale * (fit.b_from_a.rotation * pairs.path[i]) + fit.b_from_a.translation - pairs.truth[i]).norm());
  return lengths;
}

double quantile(std::vector<double> values, double share) {
  const auto at = values.begin() + static_cast<std::ptrdiff_t>(share * static_cast<double>(values.size() - 1));
  std::ranges::nth_element(values, at);
  return *at;
}
double median(const std::vector<double>& values) { return quantile(values, 0.5); }
double kept_most(const std::vector<double>& off) { return quantile(off, 0.9); }

/// Without the tenth that is furthest off.
Pairs most_of(const Pairs& pairs, const Similarity& fit) {
  const std::vector<double> off = misses(pairs, fit);
  const double most = kept_most(off);
  Pairs kept;
  for (std::size_t i = 0; i < off.size(); ++i) {
    if (!(off[i] <= most)) continue;
    kept.path.push_back(pairs.path[i]);
    kept.truth.push_back(pairs.truth[i]);
    kept.t_s.push_back(pairs.t_s[i]);
  }
  return kept;
}

/// Fitted again without the tenth that is furthest off, a few times: wrong stretches of a path do not pull, and a
/// target that mostly stands still does not hide where it moved.
std::optional<Similarity> robust_fit(const Pairs& pairs) {
  auto fit = aligned(pairs.path, pairs.truth, false);
  for (int round = 0; fit && round < 4; ++round) {
    const Pairs kept = most_of(pairs, *fit);
    fit = aligned(kept.path, kept.truth, false);
  }
  return fit;
}

/// RMS of nine tenths.
double trimmed_rms(const std::vector<double>& off) {
  const double most = kept_most(off);
  double sum2 = 0.0, num = 0.0;
  for (const double one : off) {
    if (!(one <= most)) continue;
    sum2 += one * one;
    num += 1.0;
  }
  return std::sqrt(sum2 / num);
}

Eigen::Vector3d mean_of(std::span<const Eigen::Vector3d> points) {
  Eigen::Vector3d mean = Eigen::Vector3d::Zero();
  for (const Eigen::Vector3d& point : points) mean += point / static_cast<double>(points.size());
  return mean;
}

constexpr double hopeless = 1e9;

/// Typical miss over the truth's extent: small where the paths are one.
double misfit(const Pairs& pairs) {
  if (pairs.path.size() < 20) return hopeless;
  const auto fit = robust_fit(pairs);
  if (!fit || !(fit->scale > 0.0)) return hopeless;
  const Eigen::Vector3d mean = mean_of(pairs.truth);
  double extent2 = 0.0;
  for (const Eigen::Vector3d& point : pairs.truth) extent2 += (point - mean).squaredNorm();
  return trimmed_rms(misses(pairs, *fit)) / std::sqrt(extent2 / static_cast<double>(pairs.truth.size()));
}

/// The clock by which a path lies on the true one.
class ClockSearch {
 public:
  ClockSearch(std::span<const double> t_s, std::span<const Eigen::Vector3d> path, const TrueTrack& truth)
      : t_s_(t_s), path_(path), truth_(truth), mid_s_(0.5 * (t_s.front() + t_s.back())) {}

  /// At all offsets at which the truth covers most of the path, then ever closer around the best.
  void search(std::size_t coarse) {
    const double from_s = truth_.t_s.front() - t_s_.back(), to_s = truth_.t_s.back() - t_s_.front();
    for (double offset_s = from_s; offset_s <= to_s; offset_s += 0.5) consider(offset_s, 1.0, coarse, 0.7);
    double centre_s = offset_s_, rate = 1.0;
    for (const double step_s : {0.1, 0.02, 0.005}) {
      least_ = hopeless;
      const double rate_step = 1e-3 * step_s / 0.1;
      for (int drift = -3; drift <= 3; ++drift)
        for (int k = -6; k <= 6; ++k)
          consider(centre_s + step_s * k, rate + rate_step * drift, std::max<std::size_t>(1, coarse / 3), 0.5);
      rate = rate_;
      centre_s = offset_s_ - mid_s_ + rate * mid_s_;
    }
  }

  /// An offset at the midpoint of the path, so that rates do not move it.
  void consider(double offset_s, double rate, std::size_t stride, double min_covered) {
    const double at_zero_s = offset_s + mid_s_ - rate * mid_s_;
    const Pairs pairs = pairs_at(t_s_, path_, truth_, at_zero_s, rate, stride);
    if (covered(pairs, stride) < min_covered) return;
    const double now = misfit(pairs);
    if (!(now < least_)) return;
    least_ = now;
    offset_s_ = at_zero_s;
    rate_ = rate;
  }

  [[nodiscard]] double covered(const Pairs& pairs, std::size_t stride) const {
    return static_cast<double>(pairs.path.size() * stride) / static_cast<double>(t_s_.size());
  }
  [[nodiscard]] double offset_s() const { return offset_s_; }
  [[nodiscard]] double rate() const { return rate_; }

 private:
  std::span<const double> t_s_;
  std::span<const Eigen::Vector3d> path_;
  const TrueTrack& truth_;
  double mid_s_, offset_s_ = 0.0, rate_ = 1.0, least_ = hopeless;
};

/// Residuals of the similarity and the clock, linearised: truth − path ≈ D x, x as in PathMatch::cov.
struct MatchSystem {
  Eigen::Matrix<double, 9, 9> N = Eigen::Matrix<double, 9, 9>::Zero();  ///< DᵀD over the number of moments.
  Eigen::Matrix<double, 9, 1> g = Eigen::Matrix<double, 9, 1>::Zero();
  std::vector<Eigen::Vector3d> left_m;

  /// x of the first `num` alone; what cannot be determined stays.
  [[nodiscard]] Eigen::VectorXd step(Eigen::Index num) const { return inverse(num) * g.head(num); }
  /// Of N's first `num`, scaled to a unit diagonal; directions that nothing determines get a large variance.
  [[nodiscard]] Eigen::MatrixXd inverse(Eigen::Index num) const {
    const Eigen::VectorXd scale = N.diagonal().head(num).cwiseMax(1e-300).cwiseSqrt().cwiseInverse();
    const SymmetricEigen eigen = symmetric_eigen(scaled_by(scale, N.topLeftCorner(num, num)));
    const Eigen::MatrixXd V = scale.asDiagonal() * eigen.vectors;
    return V * eigen.values.cwiseMax(1e-9).cwiseInverse().asDiagonal() * V.transpose();
  }
};

/// Velocity of the path at its moments, in the truth's world, per second of the truth: smoother than the truth's own.
std::vector<Eigen::Vector3d> velocities(const Pairs& pairs, const Similarity& fit, double rate) {
  const std::size_t num = pairs.path.size();
  std::vector<Eigen::Vector3d> v(num, Eigen::Vector3d::Zero());
  for (std::size_t i = 0; i < num; ++i) {
    const std::size_t before = i > 0 ? i - 1 : 0, after = std::min(num - 1, i + 1);
    const double apart_s = rate * (pairs.t_s[after] - pairs.t_s[before]);
    if (apart_s > 0.0) v[i] = fit.scale / apart_s * (fit.b_from_a.rotation * (pairs.path[after] - pairs.path[before]));
  }
  return v;
}

MatchSystem match_system(const Pairs& pairs, const PathMatch& match) {
  MatchSystem system;
  const Similarity& fit = match.truth_from_path;
  const std::vector<Eigen::Vector3d> v = velocities(pairs, fit, match.rate);
  const double share = 1.0 / static_cast<double>(pairs.path.size());
  for (std::size_t i = 0; i < pairs.path.size(); ++i) {
    const Eigen::Vector3d on_truth = fit.scale * (fit.b_from_a.rotation * pairs.path[i]) + fit.b_from_a.translation;
    const Eigen::Vector3d arm = on_truth - match.middle, r = pairs.truth[i] - on_truth;
    Eigen::Matrix<double, 3, 9> D;
    D << Eigen::Matrix3d::Identity(), -cross_matrix(arm), arm, -v[i], -v[i] * (pairs.t_s[i] - match.middle_s);
    system.N += share * D.transpose() * D;
    system.g += share * D.transpose() * r;
    system.left_m.push_back(r);
  }
  return system;
}

/// The clock of least squares near that of the search, with the similarity that belongs to it.
void refine_clock(std::span<const double> t_s, std::span<const Eigen::Vector3d> path, const TrueTrack& truth,
                  PathMatch& match) {
  constexpr double max_step_s = 0.02, enough_s = 1e-6;
  for (int round = 0; round < 10; ++round) {
    const Pairs pairs = pairs_at(t_s, path, truth, match.offset_s, match.rate, 1);
    const Eigen::VectorXd step = match_system(most_of(pairs, match.truth_from_path), match).step(9);
    const double offset_s = std::clamp(step[7], -max_step_s, max_step_s);
    const double drift = std::clamp(step[8], -1e-3, 1e-3);
    PathMatch moved = match;
    moved.rate += drift;
    moved.offset_s += offset_s - drift * match.middle_s;
    const Pairs again = pairs_at(t_s, path, truth, moved.offset_s, moved.rate, 1);
    const auto fit = again.path.size() >= pairs.path.size() * 9 / 10 ? robust_fit(again) : std::nullopt;
    if (!fit || !(trimmed_rms(misses(again, *fit)) <= trimmed_rms(misses(pairs, match.truth_from_path)))) return;
    moved.truth_from_path = *fit;
    match = moved;
    if (std::abs(offset_s) < enough_s) return;
  }
}

/// By how much the residuals' variance over blocks of time exceeds that of residuals which err each by itself, at most.
double slowness(const std::vector<Eigen::Vector3d>& left_m) {
  double all2 = 0.0, most = 1.0;
  for (const Eigen::Vector3d& r : left_m) all2 += r.squaredNorm();
  for (std::size_t block = 2; block <= left_m.size() / 8 && all2 > 0.0; block *= 2) {
    double sum2 = 0.0;
    for (std::size_t i = 0; i + block <= left_m.size(); i += block) {
      Eigen::Vector3d sum = Eigen::Vector3d::Zero();
      for (std::size_t k = i; k < i + block; ++k) sum += left_m[k];
      sum2 += sum.squaredNorm();
    }
    most = std::max(most, sum2 / all2);
  }
  return most;
}

/// Where the clock is not free: what is not known of it by so little that it is not named.
void count_clock(const MatchSystem& system, double variance, PathMatch& match) {
  constexpr double from_sigmas = 2.5;  // as of focal lengths
  const Eigen::MatrixXd inverse = system.inverse(8);
  const Eigen::VectorXd step = inverse * system.g.head<8>();
  double all2 = 0.0;
  for (const Eigen::Vector3d& r : system.left_m) all2 += r.squaredNorm() / static_cast<double>(system.left_m.size());
  // Of what is left by the clock that is asked for: a wrong one must not hide in residuals of its own.
  const double left = std::clamp(1.0 - step.dot(system.g.head<8>()) / all2, 1e-4, 1.0);
  match.late_s = step[7];
  match.sigma_late_s = std::sqrt(left * variance * inverse(7, 7));
  if (std::abs(match.late_s) < from_sigmas * match.sigma_late_s) return;
  const Eigen::VectorXd followed = inverse.col(7).head(7) / inverse(7, 7) * match.late_s;
  match.cov.topLeftCorner<7, 7>() += followed * followed.transpose();
}

/// How far a path is from the truth that it lies on, and how well it determines similarity and clock.
void fill_misses(const Pairs& pairs, double duration_s, bool clock_is_free, PathMatch& match) {
  const std::vector<double> off = misses(pairs, match.truth_from_path);
  match.median_m = median(off);
  match.middle = mean_of(pairs.truth);
  double sum2 = 0.0, extent2 = 0.0;
  for (std::size_t i = 0; i < off.size(); ++i) {
    sum2 += off[i] * off[i] / static_cast<double>(off.size());
    extent2 += (pairs.truth[i] - match.middle).squaredNorm() / static_cast<double>(off.size());
  }
  match.rms_m = std::sqrt(sum2);
  match.extent_m = std::sqrt(extent2);
  const MatchSystem system = match_system(most_of(pairs, match.truth_from_path), match);
  // What is left varies slowly: moments 2 s apart, at the least, are taken to err on their own.
  const double alone =
      std::clamp(static_cast<double>(off.size()) / slowness(system.left_m), 3.0, std::max(3.0, duration_s / 2.0));
  const double variance = match.median_m * match.median_m / alone;
  const Eigen::Index num = clock_is_free ? 9 : 7;
  match.cov.topLeftCorner(num, num) = variance * system.inverse(num);
  if (!clock_is_free) count_clock(system, variance, match);
}

}  // namespace

std::optional<PathMatch> match_path(std::span<const double> t_s, std::span<const Eigen::Vector3d> path,
                                    const TrueTrack& truth, bool clock_is_free) {
  if (t_s.size() < 20 || truth.t_s.size() < 3) return std::nullopt;
  const std::size_t coarse = std::max<std::size_t>(1, t_s.size() / 200);
  ClockSearch clock(t_s, path, truth);
  if (clock_is_free)
    clock.search(coarse);
  else
    clock.consider(0.0, 1.0, coarse, 0.5);
  PathMatch match;
  match.offset_s = clock.offset_s();
  match.rate = clock.rate();
  match.middle_s = 0.5 * (t_s.front() + t_s.back());
  Pairs pairs = pairs_at(t_s, path, truth, match.offset_s, match.rate, 1);
  match.covered = clock.covered(pairs, 1);
  if (match.covered < 0.5) return std::nullopt;
  const auto fit = robust_fit(pairs);
  if (!fit) return std::nullopt;
  match.truth_from_path = *fit;
  match.middle = mean_of(pairs.truth);
  if (clock_is_free) {
    refine_clock(t_s, path, truth, match);
    pairs = pairs_at(t_s, path, truth, match.offset_s, match.rate, 1);
  }
  fill_misses(pairs, t_s.back() - t_s.front(), clock_is_free, match);
  return match;
}

}  // namespace alidade
