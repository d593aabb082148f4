#include "alidade/localize/checks/scale_readings.h"

#include <Eigen/Dense>
#include <algorithm>
#include <array>
#include <cmath>
#include <limits>

#include "alidade/estimation/median.h"
#include "alidade/geometry/decompositions.h"

namespace alidade {

namespace {

/// The two frames around a time, and the weight of the second.
template <typename Step>
struct Around {
  const Step *before = nullptr, *after = nullptr;
  double share = 0.0;
};

template <typename Step>
std::optional<Around<Step>> around(std::span<const Step> path, double t_s) {
  const auto after = std::ranges::lower_bound(path, t_s, {}, &Step::t_s);
  if (after == path.end()) return std::nullopt;
  const auto before = after->t_s == t_s || after == path.begin() ? after : after - 1;
  if (before->t_s > t_s || !before->has_pose() || !after->has_pose()) return std::nullopt;
  const double gap_s = after->t_s - before->t_s;
  return Around<Step>{&*before, &*after, gap_s > 0.0 ? (t_s - before->t_s) / gap_s : 0.0};
}

}  // namespace

std::optional<Rigid3> pose_at(std::span<const PathStep> path, double t_s) {
  const auto there = around(path, t_s);
  if (!there) return std::nullopt;
  const auto [before, after, share] = *there;
  const Rigid3 &a = before->world_from_cam, &b = after->world_from_cam;
  return Rigid3{a.rotation.slerp(share, b.rotation), (1.0 - share) * a.translation + share * b.translation};
}

SensorPath::SensorPath(std::span<const PathStep> path) {
  steps.reserve(path.size());
  for (const PathStep& step : path) {
    steps.push_back({step.t_s, step.has_pose()});
    steps.back().numbers << step.world_from_cam.translation, step.world_from_cam.rotation.toRotationMatrix();
  }
}

std::optional<SensorPath::Numbers> SensorPath::at(double t_s) const {
  const auto there = around(std::span<const Step>(steps), t_s);
  if (!there) return std::nullopt;
  return (1.0 - there->share) * there->before->numbers + there->share * there->after->numbers;
}

Eigen::Matrix3d position_cov_at(std::span<const PathStep> path, double t_s) {
  const auto after = std::ranges::lower_bound(path, t_s, {}, &PathStep::t_s);
  if (after == path.end() || !after->has_pose()) return Eigen::Matrix3d::Zero();
  const Eigen::Matrix3d R = after->world_from_cam.rotation.toRotationMatrix();
  return R * after->cov.topLeftCorner<3, 3>() * R.transpose();
}

double persistent_square(std::span<const Eigen::Vector3d> left) {
  if (left.size() < 3) return 0.0;
  double squares = 0.0, steps = 0.0;
  for (std::size_t i = 0; i < left.size(); ++i) {
    squares += left[i].squaredNorm();
    if (i > 0) steps += 0.5 * (left[i] - left[i - 1]).squaredNorm();
  }
  const double num = static_cast<double>(left.size());
  return std::max(0.0, squares / num - steps / (num - 1.0));
}

SensorPath SensorPath::filtered(double tau_s) const {
  constexpr double forgotten = 3.0;  // time constants
  SensorPath path = *this;
  double since_s = 0.0;
  bool has_last = false;
  for (std::size_t i = 0; i < steps.size(); ++i) {
    if (has_last && steps[i].is_shown) {
      // The path is linear between two frames.
      const Step &now = steps[i], &before = steps[i - 1];
      const double gap_s = now.t_s - before.t_s, kept = std::exp(-gap_s / tau_s);
      const double of_speed = (1.0 - kept) * tau_s / gap_s;
      path.steps[i].numbers += kept * (path.steps[i - 1].numbers - before.numbers);
      path.steps[i].numbers -= of_speed * (now.numbers - before.numbers);
    } else if (steps[i].is_shown) {
      since_s = steps[i].t_s;
    }
    has_last = steps[i].is_shown;
  }
  for (Step& step : path.steps) step.is_shown = step.is_shown && step.t_s >= since_s + forgotten * tau_s;
  return path;
}

std::vector<PathStep> filtered(std::span<const PathStep> path, double tau_s) {
  const SensorPath shown = SensorPath(path).filtered(tau_s);
  std::vector<PathStep> steps(path.begin(), path.end());
  for (std::size_t i = 0; i < steps.size(); ++i) {
    steps[i].world_from_cam.translation = shown.steps[i].numbers.col(0);
    if (!shown.steps[i].is_shown) steps[i].event = FrameEvent::waiting;
  }
  return steps;
}

std::vector<PathStep> without_jitter(std::span<const PathStep> path, double half_s) {
  constexpr std::size_t enough = 5;
  std::vector<PathStep> steps(path.begin(), path.end());
  std::size_t first = 0, last = 0;
  for (std::size_t i = 0; i < path.size(); ++i) {
    while (path[i].t_s - path[first].t_s > half_s) ++first;
    while (last < path.size() && path[last].t_s - path[i].t_s <= half_s) ++last;
    if (!path[i].has_pose() || last - first < enough) continue;
    Eigen::Matrix3d H = Eigen::Matrix3d::Zero(), g = Eigen::Matrix3d::Zero();
    std::size_t num = 0;
    for (std::size_t k = first; k < last; ++k) {
      if (!path[k].has_pose()) continue;
      const double t = (path[k].t_s - path[i].t_s) / half_s;
      const Eigen::Vector3d powers(1.0, t, t * t);
      H += powers * powers.transpose();
      g += powers * path[k].world_from_cam.translation.transpose();
      ++num;
    }
    if (num >= enough) steps[i].world_from_cam.translation = (H.inverse() * g).row(0).transpose();
  }
  return steps;
}

}  // namespace alidade
