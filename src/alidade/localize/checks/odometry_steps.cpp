#include "alidade/localize/checks/odometry_steps.h"

#include <algorithm>
#include <cmath>
#include <vector>

#include "alidade/estimation/median.h"
#include "alidade/geometry/decompositions.h"

namespace alidade {
namespace {

constexpr std::size_t num_parts = 5;

struct Step {
  Eigen::Vector3d of_path, of_vehicle;
  std::size_t part = 0;
  bool is_used = true;
  Eigen::Vector3d left = Eigen::Vector3d::Zero();
};

/// Variances of each coordinate.
struct StepNoise {
  double white = 1.0;  ///< Of a position.
  double walk = 1e-3;  ///< Of a step; accumulates.
  [[nodiscard]] double of_step() const { return 2.0 * white + walk; }
};

std::vector<Step> steps_of(std::span<const Place> places) {
  std::vector<Step> steps;
  for (std::size_t i = 1; i < places.size(); ++i) {
    const double share = 0.5 * (places[i - 1].way_m + places[i].way_m) / places.back().way_m;
    const auto part = static_cast<std::size_t>(share * static_cast<double>(num_parts));
    steps.push_back({places[i].of_path - places[i - 1].of_path, places[i].of_vehicle - places[i - 1].of_vehicle,
                     std::min(part, num_parts - 1)});
  }
  return steps;
}

/// C⁻¹ S for the path's consecutive steps S: neighbours share a position, and its error.
std::vector<Eigen::Vector3d> weighed(std::span<const Step> steps, const StepNoise& noise) {
  std::vector<Eigen::Vector3d> x(steps.size());
  std::vector<double> upper(steps.size());
  for (std::size_t i = 0; i < steps.size(); ++i) {
    const double before = i > 0 ? upper[i - 1] : 0.0;
    const double pivot = noise.of_step() + noise.white * before;
    upper[i] = -noise.white / pivot;
    x[i] = steps[i].of_path;
    if (i > 0) x[i] += noise.white * x[i - 1];
    x[i] /= pivot;
  }
  for (std::size_t i = steps.size() - 1; i-- > 0;) x[i] -= upper[i] * x[i + 1];
  return x;
}

/// A part's steps: num / den is its scale, 1 / den the variance of that.
struct PartSums {
  double num = 0.0, den = 0.0;
  Eigen::Matrix3d vehicle_from_path = Eigen::Matrix3d::Identity();
  std::size_t num_steps = 0;
};

PartSums sums_of(std::span<const Step> steps, const StepNoise& noise) {
  PartSums sums;
  Eigen::Matrix3d products = Eigen::Matrix3d::Zero();
  for (std::size_t begin = 0, end = 0; begin < steps.size(); begin = std::max(end, begin + 1)) {
    for (end = begin; end < steps.size() && steps[end].is_used;) ++end;
    if (end == begin) continue;
    const std::span<const Step> chain = steps.subspan(begin, end - begin);
    const std::vector<Eigen::Vector3d> x = weighed(chain, noise);
    for (std::size_t i = 0; i < chain.size(); ++i) {
      products += chain[i].of_vehicle * x[i].transpose();
      sums.den += x[i].dot(chain[i].of_path);
    }
    sums.num_steps += chain.size();
  }
  const Svd svd = svd_of(products);
  sums.vehicle_from_path = svd.U * svd.V.transpose();
  sums.num = svd.values.sum();
  // The best rotation biases it upwards, by 1.5 over the scale.
  constexpr double of_rotation = 1.5;
  if (sums.num > 0.0) sums.num -= std::min(of_rotation * sums.den / sums.num, 0.5 * sums.num);
  return sums;
}

/// Variance of each coordinate of the residuals, from the median of squares of sums over `together` steps.
double variance_of(std::span<const Step> steps, std::size_t together, bool is_in_plane) {
  constexpr double middle_of_two = 1.386, middle_of_three = 2.366;  // medians of χ²
  std::vector<double> squares;
  for (std::size_t i = 0; i + together <= steps.size(); ++i) {
    Eigen::Vector3d sum = Eigen::Vector3d::Zero();
    for (std::size_t k = i; k < i + together; ++k) sum += steps[k].left;
    if (steps[i].part == steps[i + together - 1].part) squares.push_back(sum.squaredNorm());
  }
  if (squares.empty()) return 0.0;
  return median_of(std::move(squares)) / (is_in_plane ? middle_of_two : middle_of_three);
}

StepNoise noise_of(std::span<const Step> steps) {
  const bool is_in_plane = std::ranges::all_of(steps, [](const Step& step) { return step.of_vehicle.z() == 0.0; });
  constexpr std::size_t most = 10, share = 20;
  const std::size_t together = std::clamp(steps.size() / share, std::size_t{2}, most);
  const double of_one = variance_of(steps, 1, is_in_plane), of_many = variance_of(steps, together, is_in_plane);
  double length2 = 0.0;
  for (const Step& step : steps) length2 += step.of_vehicle.squaredNorm() / static_cast<double>(steps.size());
  constexpr double hardly = 1e-8;
  StepNoise noise;
  noise.walk = std::max((of_many - of_one) / static_cast<double>(together - 1), 0.0);
  noise.white = std::max(0.5 * (of_one - noise.walk), 0.0) + hardly * length2;
  noise.walk = std::min(noise.walk, of_one) + hardly * length2;
  return noise;
}

struct AllSums {
  std::vector<PartSums> parts;
  double num = 0.0, den = 0.0;
  [[nodiscard]] double scale() const { return den > 0.0 ? num / den : 0.0; }
};

AllSums all_sums(std::span<const Step> steps, const StepNoise& noise) {
  AllSums all;
  for (std::size_t begin = 0, end = 0; begin < steps.size(); begin = end) {
    while (end < steps.size() && steps[end].part == steps[begin].part) ++end;
    all.parts.push_back(sums_of(steps.subspan(begin, end - begin), noise));
    all.num += all.parts.back().num, all.den += all.parts.back().den;
  }
  return all;
}

/// Residual of each step.
void take_left(const AllSums& all, std::vector<Step>& steps) {
  std::size_t at = 0;
  for (std::size_t i = 0; i < steps.size(); ++i) {
    if (i > 0 && steps[i].part != steps[i - 1].part) ++at;
    const Eigen::Vector3d by_path = all.parts[at].vehicle_from_path * steps[i].of_path;
    steps[i].left = steps[i].of_vehicle - all.scale() * by_path;
  }
}

/// Scatter of the parts over their variances; at least 1.
double scatter_of(const AllSums& all) {
  constexpr std::size_t enough = 5;
  double chi2 = 0.0, num = 0.0;
  for (const PartSums& part : all.parts) {
    if (part.num_steps < enough || !(part.den > 0.0)) continue;
    const double away = part.num / part.den - all.scale();
    chi2 += part.den * away * away;
    num += 1.0;
  }
  return num > 1.0 ? std::max(1.0, chi2 / (num - 1.0)) : 1.0;
}

/// The steps as fitted to the path; outliers are not used.
struct FittedSteps {
  std::vector<Step> steps;
  StepNoise noise;
  AllSums all;
};

std::optional<FittedSteps> fitted_steps(std::span<const Place> places) {
  constexpr std::size_t enough = 10;
  constexpr int rounds = 3;
  constexpr double rejected_beyond = 4.0, three = 3.0;  // σ, coordinates
  if (places.size() <= enough || !(places.back().way_m > 0.0)) return std::nullopt;
  FittedSteps fitted{steps_of(places), {}, {}};
  for (int round = 0; round < rounds; ++round) {
    take_left(all_sums(fitted.steps, fitted.noise), fitted.steps);
    fitted.noise = noise_of(fitted.steps);
    const double limit = rejected_beyond * rejected_beyond * three * fitted.noise.of_step();
    for (Step& step : fitted.steps) step.is_used = step.left.squaredNorm() <= limit;
  }
  fitted.all = all_sums(fitted.steps, fitted.noise);
  return fitted.all.scale() > 0.0 ? std::optional(std::move(fitted)) : std::nullopt;
}

/// A part of the steps with its own scale: the decrease of χ² by it.
struct Stretch {
  std::size_t begin = 0, end = 0;
  double ratio = 1.0, gain = 0.0;
};

Stretch stretch_of(std::span<const Step> in_path, const StepNoise& noise, double scale, std::size_t begin,
                   std::size_t end) {
  const std::span<const Step> chain = in_path.subspan(begin, end - begin);
  const std::vector<Eigen::Vector3d> x = weighed(chain, noise);
  double num = 0.0, den = 0.0;
  for (std::size_t i = 0; i < chain.size(); ++i)
    num += x[i].dot(chain[i].of_vehicle), den += x[i].dot(chain[i].of_path);
  if (!(den > 0.0)) return {begin, end};
  return {begin, end, num / (den * scale), (num - scale * den) * (num - scale * den) / den};
}

/// The part with the largest gain; its ends are optimised.
Stretch most_gain(std::span<const Step> in_path, const StepNoise& noise, double scale) {
  constexpr std::size_t fewest = 5, longest = 4;  // at most a quarter of all
  const std::size_t num = in_path.size();
  Stretch best;
  const auto look = [&](std::size_t begin, std::size_t end) {
    if (begin + fewest > end || end > num || longest * (end - begin) > num) return false;
    const Stretch one = stretch_of(in_path, noise, scale, begin, end);
    if (one.gain > best.gain) best = one;
    return one.gain >= best.gain;
  };
  for (const std::size_t part : {4u, 8u, 16u, 32u}) {
    const std::size_t length = std::max(num / part, fewest);
    for (std::size_t begin = 0; begin + length <= num; begin += std::max(length / 4, std::size_t{1}))
      look(begin, begin + length);
  }
  for (double last = 0.0; best.gain > last;) {
    last = best.gain;
    const Stretch at = best;
    look(at.begin + 1, at.end), look(at.begin, at.end + 1), look(at.begin, at.end - 1);
    if (at.begin > 0) look(at.begin - 1, at.end);
  }
  return best;
}

}  // namespace

std::optional<StepScale> scale_by_steps(std::span<const Place> places) {
  const auto fitted = fitted_steps(places);
  if (!fitted) return std::nullopt;
  const AllSums& all = fitted->all;
  StepScale found{std::log(all.scale()), std::sqrt(scatter_of(all) / all.den) / all.scale(), fitted->steps.size()};
  for (const PartSums& part : all.parts) found.num_used += part.num_steps;
  return found;
}

std::optional<Slip> slip_of(std::span<const Place> places) {
  constexpr double clear = 30.0, least = 0.1;
  const auto fitted = fitted_steps(places);
  if (!fitted) return std::nullopt;
  const double scale = fitted->all.scale();
  std::vector<Step> in_path = fitted->steps;
  std::size_t at = 0;
  for (std::size_t i = 0; i < in_path.size(); ++i) {
    if (i > 0 && in_path[i].part != in_path[i - 1].part) ++at;
    const Eigen::Matrix3d path_from_vehicle = fitted->all.parts[at].vehicle_from_path.transpose();
    in_path[i].of_vehicle = path_from_vehicle * in_path[i].of_vehicle;
    if (!in_path[i].is_used) in_path[i].of_vehicle = scale * in_path[i].of_path;
  }
  const Stretch best = most_gain(in_path, fitted->noise, scale);
  if (!(best.gain > clear) || !(std::abs(std::log(std::abs(best.ratio))) > least)) return std::nullopt;
  Slip slip{best.begin, best.end, best.ratio, {}};
  for (std::size_t i = best.begin; i < best.end; ++i) slip.excess.push_back(fitted->steps[i].left);
  return slip;
}

}  // namespace alidade
