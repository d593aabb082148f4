#include "alidade/network/moving_scale.h"

#include <Eigen/LU>
#include <algorithm>
#include <cmath>

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

/// Fitted again without the tenth that is furthest off, a few times: wrong stretches of a path do not pull, and a
/// target that mostly stands still does not hide where it moved.
std::optional<Similarity> robust_fit(const Pairs& pairs) {
  auto fit = aligned(pairs.path, pairs.truth, false);
  for (int round = 0; fit && round < 4; ++round) {
    const std::vector<double> off = misses(pairs, *fit);
    const double most = kept_most(off);
    Pairs kept;
    for (std::size_t i = 0; i < off.size(); ++i) {
      if (!(off[i] <= most)) continue;
      kept.path.push_back(pairs.path[i]);
      kept.truth.push_back(pairs.truth[i]);
    }
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

/// How far a path is from the truth that it lies on.
void fill_misses(const Pairs& pairs, double duration_s, PathMatch& match) {
  const std::vector<double> off = misses(pairs, match.truth_from_path);
  match.median_m = median(off);
  const Eigen::Vector3d mean = mean_of(pairs.truth);
  double sum2 = 0.0, extent2 = 0.0;
  for (std::size_t i = 0; i < off.size(); ++i) {
    sum2 += off[i] * off[i] / static_cast<double>(off.size());
    extent2 += (pairs.truth[i] - mean).squaredNorm() / static_cast<double>(off.size());
  }
  match.rms_m = std::sqrt(sum2);
  match.extent_m = std::sqrt(extent2);
  // What is left varies slowly: moments 2 s apart are taken to err on their own.
  const double alone = std::max(3.0, duration_s / 2.0);
  match.sigma_scale = match.median_m / match.extent_m / std::sqrt(alone);
  match.sigma_translation_m = match.median_m / std::sqrt(alone);
  match.middle = mean;
  Eigen::Matrix3d inertia = Eigen::Matrix3d::Zero();
  for (const Eigen::Vector3d& point : pairs.truth) {
    const Eigen::Vector3d arm = point - mean;
    inertia += (arm.squaredNorm() * Eigen::Matrix3d::Identity() - arm * arm.transpose()) /
               static_cast<double>(pairs.truth.size());
  }
  match.cov_rotation = match.sigma_translation_m * match.sigma_translation_m * inertia.inverse();
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
  const Pairs pairs = pairs_at(t_s, path, truth, match.offset_s, match.rate, 1);
  match.covered = clock.covered(pairs, 1);
  if (match.covered < 0.5) return std::nullopt;
  const auto fit = robust_fit(pairs);
  if (!fit) return std::nullopt;
  match.truth_from_path = *fit;
  fill_misses(pairs, t_s.back() - t_s.front(), match);
  return match;
}

}  // namespace alidade
