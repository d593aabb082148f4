#include "alidade/network/moving_scale.h"

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

/// Typical miss over the truth's extent: small where the paths are one.
double misfit(const Pairs& pairs) {
  constexpr double hopeless = 1e9;
  if (pairs.path.size() < 20) return hopeless;
  const auto fit = robust_fit(pairs);
  if (!fit || !(fit->scale > 0.0)) return hopeless;
  Eigen::Vector3d mean = Eigen::Vector3d::Zero();
  for (const Eigen::Vector3d& point : pairs.truth) mean += point / static_cast<double>(pairs.truth.size());
  double extent2 = 0.0;
  for (const Eigen::Vector3d& point : pairs.truth) extent2 += (point - mean).squaredNorm();
  return trimmed_rms(misses(pairs, *fit)) / std::sqrt(extent2 / static_cast<double>(pairs.truth.size()));
}

}  // namespace

std::optional<PathMatch> match_path(std::span<const double> t_s, std::span<const Eigen::Vector3d> path,
                                    const TrueTrack& truth, bool clock_is_free) {
  if (t_s.size() < 20 || truth.t_s.size() < 3) return std::nullopt;
  PathMatch match;
  const std::size_t coarse = std::max<std::size_t>(1, t_s.size() / 200);
  const auto covered = [&](const Pairs& pairs, std::size_t stride) {
    return static_cast<double>(pairs.path.size() * stride) / static_cast<double>(t_s.size());
  };
  double least = 1e9;
  const double path_mid_s = 0.5 * (t_s.front() + t_s.back());
  const auto consider = [&](double offset_s, double rate, std::size_t stride, double min_covered) {
    // Offset at the midpoint of the path, so that rates do not move it.
    const double at_zero_s = offset_s + path_mid_s - rate * path_mid_s;
    const Pairs pairs = pairs_at(t_s, path, truth, at_zero_s, rate, stride);
    if (covered(pairs, stride) < min_covered) return;
    const double now = misfit(pairs);
    if (!(now < least)) return;
    least = now;
    match.offset_s = at_zero_s;
    match.rate = rate;
  };
  if (clock_is_free) {
    const double from_s = truth.t_s.front() - t_s.back(), to_s = truth.t_s.back() - t_s.front();
    for (double offset_s = from_s; offset_s <= to_s; offset_s += 0.5) consider(offset_s, 1.0, coarse, 0.7);
    double centre_s = match.offset_s, rate = 1.0;
    for (const double step_s : {0.1, 0.02, 0.005}) {
      least = 1e9;
      const double rate_step = 1e-3 * step_s / 0.1;
      const double around_s = centre_s, around = rate;
      for (int drift = -3; drift <= 3; ++drift)
        for (int k = -6; k <= 6; ++k)
          consider(around_s + step_s * k, around + rate_step * drift, std::max<std::size_t>(1, coarse / 3), 0.5);
      rate = match.rate;
      centre_s = match.offset_s - path_mid_s + rate * path_mid_s;
    }
  } else {
    consider(0.0, 1.0, coarse, 0.5);
  }
  const Pairs pairs = pairs_at(t_s, path, truth, match.offset_s, match.rate, 1);
  match.covered = covered(pairs, 1);
  if (match.covered < 0.5) return std::nullopt;
  const auto fit = robust_fit(pairs);
  if (!fit) return std::nullopt;
  match.truth_from_path = *fit;
  const std::vector<double> off = misses(pairs, *fit);
  match.median_m = median(off);
  Eigen::Vector3d mean = Eigen::Vector3d::Zero();
  for (const Eigen::Vector3d& point : pairs.truth) mean += point / static_cast<double>(pairs.truth.size());
  double sum2 = 0.0, extent2 = 0.0;
  for (std::size_t i = 0; i < off.size(); ++i) {
    sum2 += off[i] * off[i] / static_cast<double>(off.size());
    extent2 += (pairs.truth[i] - mean).squaredNorm() / static_cast<double>(off.size());
  }
  match.rms_m = std::sqrt(sum2);
  match.extent_m = std::sqrt(extent2);
  // What is left varies slowly: moments 2 s apart are taken to err on their own.
  const double alone = std::max(3.0, (t_s.back() - t_s.front()) / 2.0);
  match.sigma_scale = match.median_m / match.extent_m / std::sqrt(alone);
  return match;
}

}  // namespace alidade
