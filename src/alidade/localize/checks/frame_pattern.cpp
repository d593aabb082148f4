#include "alidade/localize/checks/frame_pattern.h"

#include <Eigen/Core>
#include <algorithm>
#include <cmath>
#include <numeric>

#include "alidade/geometry/decompositions.h"
#include "alidade/geometry/so3.h"

namespace alidade {
namespace {

constexpr Eigen::Index num_frames = 16, order = 5;  ///< Frames of a window, order of its polynomials.
constexpr int longest = 8;                          ///< Frames in a pattern.

/// One component of the poses of a window.
struct WindowPart {
  const NumberedPose* first = nullptr;
  Eigen::Matrix<double, num_frames, order + 1> Q;  ///< Orthonormal basis of the polynomials.
  Eigen::Vector<double, num_frames> speed, left;   ///< Per period; residual of the polynomials.
  double variance = 0.0;                           ///< Of the residual.
};

/// Overlapping windows and the six components count as independent: their correlation is in the scatter.
void add_window(std::span<const NumberedPose> poses, std::vector<WindowPart>& parts) {
  constexpr double nothing = 1e-24;  // variance of an error-free path
  const Rigid3 middle_from_world = poses[poses.size() / 2].world_from_cam.inverse();
  const double begin = poses.front().t_periods, half = 0.5 * (poses.back().t_periods - begin);
  if (!(half > 0.0)) return;
  Eigen::Matrix<double, num_frames, 6> x;
  Eigen::Matrix<double, num_frames, order + 1> powers, slopes;
  for (Eigen::Index i = 0; i < num_frames; ++i) {
    const NumberedPose& pose = poses[static_cast<std::size_t>(i)];
    const Rigid3 from_middle = middle_from_world * pose.world_from_cam;
    x.row(i) << from_middle.translation.transpose(), log_so3(from_middle.rotation).transpose();
    const double t = (pose.t_periods - begin) / half - 1.0;
    powers(i, 0) = 1.0, slopes(i, 0) = 0.0;
    for (Eigen::Index k = 1; k <= order; ++k) {
      powers(i, k) = powers(i, k - 1) * t;
      slopes(i, k) = static_cast<double>(k) * powers(i, k - 1) / half;
    }
  }
  const Eigen::MatrixXd speeds = slopes * minimum_norm_solution(powers, x);
  WindowPart part;
  part.first = poses.data();
  part.Q = orthonormal_basis(powers, order + 1);
  for (Eigen::Index c = 0; c < 6; ++c) {
    part.speed = speeds.col(c);
    part.left = x.col(c) - part.Q * (part.Q.transpose() * x.col(c));
    part.variance = part.left.squaredNorm() / static_cast<double>(num_frames - order - 1) + nothing;
    parts.push_back(part);
  }
}

/// Score of the phases' delays, which sum to zero, in an orthonormal basis.
struct PhaseScore {
  Eigen::MatrixXd basis;  ///< Delays of the phases from their coordinates.
  Eigen::VectorXd score;
  Eigen::MatrixXd information;
};

PhaseScore phase_score(std::span<const WindowPart> parts, int size) {
  const Eigen::Index num = size - 1;
  PhaseScore sum{orthonormal_basis(Eigen::VectorXd::Ones(size), size).rightCols(num), Eigen::VectorXd::Zero(num),
                 Eigen::MatrixXd::Zero(num, num)};
  std::vector<Eigen::VectorXd> scores;
  std::vector<Eigen::MatrixXd> informations;
  for (const WindowPart& part : parts) {
    Eigen::MatrixXd A(num_frames, num);
    for (Eigen::Index i = 0; i < num_frames; ++i)
      A.row(i) = part.speed[i] * sum.basis.row(static_cast<Eigen::Index>(part.first[i].number) % size);
    A -= part.Q * (part.Q.transpose() * A);
    scores.push_back(A.transpose() * part.left / part.variance);
    informations.push_back(A.transpose() * A / part.variance);
    sum.score += scores.back();
    sum.information += informations.back();
  }
  constexpr double hardly = 1e-9;
  sum.information.diagonal().array() += hardly * sum.information.trace() + hardly;
  const Eigen::MatrixXd cov = Ldlt(sum.information).inverse();
  const Eigen::VectorXd delays = cov * sum.score;
  double scatter = 0.0;  // variance of the scores over the information, mean
  for (std::size_t i = 0; i < scores.size(); ++i) {
    const Eigen::VectorXd left = scores[i] - informations[i] * delays;
    scatter += left.dot(cov * left) / static_cast<double>(num);
  }
  sum.score /= std::max(1.0, scatter);
  sum.information /= std::max(1.0, scatter);
  return sum;
}

/// Delays of frames relative to equal steps with the same mean, in units of that mean.
Eigen::VectorXd delays_of(std::span<const int> steps) {
  const auto num = static_cast<Eigen::Index>(steps.size());
  const double mean = std::accumulate(steps.begin(), steps.end(), 0.0) / static_cast<double>(num);
  Eigen::VectorXd delays(num);
  double at = 0.0;
  for (Eigen::Index k = 0; k < num; ++k) {
    delays[k] = at / mean - static_cast<double>(k);
    at += steps[static_cast<std::size_t>(k)];
  }
  return delays.array() - delays.mean();
}

/// Whether the shortest step is one period, and the steps do not repeat a shorter pattern.
bool is_pattern(std::span<const int> steps) {
  if (std::ranges::min(steps) != 1) return false;
  for (std::size_t period = 1; period < steps.size(); ++period)
    if (steps.size() % period == 0 && std::ranges::equal(steps.subspan(period), steps.first(steps.size() - period)))
      return false;
  return true;
}

/// Advances to the next combination of steps; false after the last.
bool count_up(std::vector<int>& steps, int most) {
  for (int& step : steps) {
    if (++step <= most) return true;
    step = 1;
  }
  return false;
}

struct FoundPattern {
  std::vector<int> steps;
  double gain = 0.0;  ///< Twice the log likelihood ratio, with a penalty per parameter.
};

/// Long patterns need few missing frames: a walk with that period looks as if most frames were missing.
void try_patterns(const PhaseScore& score, int size, FoundPattern& best) {
  constexpr int most = 3, short_size = 4, few_missing = 2;
  constexpr double least_share = 0.2, most_share = 1.6;  // of the delays; smoothing of the path reduces them
  constexpr double of_number = 4.0, of_longer = 6.0, of_share = 0.25;
  std::vector<int> steps(static_cast<std::size_t>(size), 1);
  while (count_up(steps, most)) {
    const int num_missing = std::accumulate(steps.begin(), steps.end(), -size);
    if (!is_pattern(steps) || (size > short_size && num_missing > few_missing)) continue;
    const Eigen::VectorXd delays = score.basis.transpose() * delays_of(steps);
    const double along = delays.dot(score.score), information = delays.dot(score.information * delays);
    const double share = along / information;
    if (!(share > least_share) || !(share < most_share)) continue;
    const double gain = along * share * (1.0 - of_share * std::pow(std::log(share), 2)) - of_number * (size - 1) -
                        of_longer * (std::ranges::max(steps) - 2);
    if (gain > best.gain) best = {steps, gain};
  }
}

}  // namespace

std::vector<int> frame_pattern(std::span<const NumberedPose> poses) {
  constexpr std::size_t wide = num_frames, enough = 3;
  constexpr double sure = 50.0;
  std::vector<WindowPart> parts;
  for (std::size_t from = 0; from + wide <= poses.size(); from += wide / 2)
    add_window(poses.subspan(from, wide), parts);
  if (parts.size() < 6 * enough) return {};
  FoundPattern best{{}, sure};
  for (int size = 2; size <= longest; ++size) try_patterns(phase_score(parts, size), size, best);
  return best.steps;
}

}  // namespace alidade
