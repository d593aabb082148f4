#include "alidade/localize/frames/white_pixels.h"

#include <Eigen/Core>
#include <algorithm>
#include <array>
#include <cmath>
#include <map>
#include <utility>
#include <vector>

#include "alidade/estimation/median.h"
#include "alidade/geometry/decompositions.h"
#include "alidade/geometry/so3.h"
#include "alidade/geometry/third_difference.h"

namespace alidade {
namespace {

using PixelsById = std::map<long, Eigen::Vector2d>;
using FlowOfPose = Eigen::Matrix<double, 2, 6>;
using PoseChange = Eigen::Vector<double, 6>;

constexpr std::size_t num_of_window = 4, windows_of_block = 12;
constexpr std::size_t min_points = 4, min_for_misfits = 8, max_points = 64;

/// A point over the frames of a window.
struct WindowPoint {
  long id = 0;
  Eigen::Vector2d third = Eigen::Vector2d::Zero(), slope = Eigen::Vector2d::Zero();  ///< With unit-norm weights. [px]
  FlowOfPose J = FlowOfPose::Zero();  ///< W.r.t. translation, at one metre, and rotation.
  bool fits = true;
};
using WindowPoints = std::vector<WindowPoint>;

/// Residuals of third differences.
struct Remains {
  std::vector<double> sizes_px, motions_px;
  double num_free = 0.0;  ///< Degrees of freedom left by poses and points.
};

PixelsById pixels_of(const ObservationFrame& frame) {
  PixelsById pixels;
  for (const FeatureObservation& each : frame.observations)
    if (!(each.sigma_px > 0.0)) pixels[each.id] = each.px;
  return pixels;
}

/// Step of each point between two frames relative to the median step, over the typical size of that.
std::map<long, double> leaps_between(const PixelsById& before, const PixelsById& after) {
  std::vector<std::pair<long, Eigen::Vector2d>> steps;
  std::vector<double> u, v, sizes;
  for (const auto& [id, px] : before) {
    const auto at = after.find(id);
    if (at == after.end()) continue;
    steps.emplace_back(id, at->second - px);
    u.push_back(steps.back().second.x());
    v.push_back(steps.back().second.y());
  }
  if (steps.size() < min_points) return {};
  const Eigen::Vector2d usual(median_of(std::move(u)), median_of(std::move(v)));
  for (const auto& step : steps) sizes.push_back((step.second - usual).norm());
  const double usual_size = std::max(median_of(sizes) / rayleigh_median, 1e-9);
  std::map<long, double> leaps;
  for (std::size_t i = 0; i < steps.size(); ++i) leaps[steps[i].first] = sizes[i] / usual_size;
  return leaps;
}

/// The frames without pixels that jump away and back: mismatches.
std::vector<PixelsById> without_leaps(std::span<const ObservationFrame> frames) {
  constexpr double far_leap = 6.0;  // σ
  std::vector<PixelsById> pixels;
  for (const ObservationFrame& frame : frames) pixels.push_back(pixels_of(frame));
  std::vector<std::map<long, double>> leaps;
  for (std::size_t k = 0; k + 1 < pixels.size(); ++k) leaps.push_back(leaps_between(pixels[k], pixels[k + 1]));
  const auto leap_of = [](const std::map<long, double>& of_all, long id) {
    const auto at = of_all.find(id);
    return at == of_all.end() ? std::optional<double>() : at->second;
  };
  for (std::size_t k = 0; k < pixels.size(); ++k)
    std::erase_if(pixels[k], [&](const auto& each) {
      const auto to = k > 0 ? leap_of(leaps[k - 1], each.first) : std::nullopt;
      const auto from = k < leaps.size() ? leap_of(leaps[k], each.first) : std::nullopt;
      return (to || from) && std::min(to.value_or(*(to ? to : from)), from.value_or(*(to ? to : from))) > far_leap;
    });
  return pixels;
}

/// Derivative of a pixel with respect to the camera's pose.
std::optional<FlowOfPose> flow_at(const Camera& camera, const Eigen::Vector2d& px) {
  const auto ray = observation_ray(camera, px);
  const auto point = ray ? point_at_range(*ray, 1.0) : std::nullopt;
  const auto seen = point ? project_with_jacobians(camera, *point) : std::nullopt;
  if (!seen) return std::nullopt;
  FlowOfPose J;
  J << -seen->J_px_point, seen->J_px_point * cross_matrix(*point);
  if (!J.allFinite()) return std::nullopt;
  return J;
}

/// The points present in all four frames, at most `max_points`.
WindowPoints window_points(std::span<const PixelsById> pixels, const std::array<double, num_of_window>& t_s,
                           const Camera& camera) {
  const std::array<double, num_of_window> weights = third_difference(t_s);
  const double middle_s = 0.25 * (t_s[0] + t_s[1] + t_s[2] + t_s[3]);
  double squares = 0.0;
  for (const double each : t_s) squares += (each - middle_s) * (each - middle_s);
  WindowPoints points;
  const std::size_t every = 1 + pixels[0].size() / max_points;
  std::size_t num = 0;
  for (const auto& [id, first] : pixels[0]) {
    if (num++ % every != 0) continue;
    WindowPoint point{.id = id};
    Eigen::Vector2d mean = Eigen::Vector2d::Zero();
    std::size_t num_seen = 0;
    for (std::size_t k = 0; k < num_of_window; ++k) {
      const auto at = pixels[k].find(id);
      if (at == pixels[k].end()) break;
      ++num_seen;
      mean += at->second / num_of_window;
      point.third += weights[k] * at->second;
      point.slope += (t_s[k] - middle_s) / std::sqrt(squares) * at->second;
    }
    const auto J = num_seen == num_of_window ? flow_at(camera, mean) : std::nullopt;
    if (J) points.emplace_back(std::move(point)).J = *J;
  }
  return points;
}

/// The change of pose that explains a difference of the points, by weighted least squares. Empty: undetermined.
template <typename WeightOf>
std::optional<PoseChange> pose_change(const WindowPoints& points, Eigen::Vector2d WindowPoint::*difference,
                                      const WeightOf& weight_of) {
  Eigen::Matrix<double, 6, 6> H = Eigen::Matrix<double, 6, 6>::Zero();
  PoseChange g = PoseChange::Zero();
  for (std::size_t i = 0; i < points.size(); ++i) {
    const double weight = weight_of(i);
    if (!(weight > 0.0)) continue;
    H += weight * points[i].J.transpose() * points[i].J;
    g += weight * points[i].J.transpose() * (points[i].*difference);
  }
  const Llt llt(H);
  if (!llt.is_positive()) return std::nullopt;
  return llt.solve(g);
}

std::vector<double> misfits_of(const WindowPoints& points, const PoseChange& change) {
  std::vector<double> misfits_px;
  for (const WindowPoint& point : points) misfits_px.push_back((point.third - point.J * change).norm());
  return misfits_px;
}

/// Least squares, which sets `fits`; with many points first least absolute errors, then without outliers.
std::optional<PoseChange> third_of_pose(WindowPoints& points) {
  constexpr int num_weighted = 6, num_again = 2;
  constexpr double far_off = 5.0;  // σ
  const auto by_fits = [&](std::size_t i) { return points[i].fits ? 1.0 : 0.0; };
  for (WindowPoint& point : points) point.fits = true;
  auto change = pose_change(points, &WindowPoint::third, by_fits);
  if (points.size() < min_for_misfits) return change;
  const auto usual_px = [](const std::vector<double>& misfits_px) {
    return std::max(median_of(misfits_px) / rayleigh_median, 1e-9);
  };
  for (int i = 0; i < num_weighted && change; ++i) {
    const std::vector<double> misfits_px = misfits_of(points, *change);
    const double least_px = 0.5 * usual_px(misfits_px);
    change = pose_change(points, &WindowPoint::third,
                         [&](std::size_t k) { return 1.0 / std::max(misfits_px[k], least_px); });
  }
  for (int i = 0; i < num_again && change; ++i) {
    const std::vector<double> misfits_px = misfits_of(points, *change);
    const double most_px = far_off * usual_px(misfits_px);
    for (std::size_t k = 0; k < points.size(); ++k) points[k].fits = misfits_px[k] <= most_px;
    change = pose_change(points, &WindowPoint::third, by_fits);
  }
  return change;
}

/// Some fifty frames, with common inverse depths of the points.
class Block {
 public:
  explicit Block(std::vector<WindowPoints> windows) : windows_(std::move(windows)) {}

  /// Alternates between the poses' differences and the inverse depths.
  [[nodiscard]] Remains remains() {
    constexpr int num_rounds = 4;
    Remains remains;
    for (int i = 0; i < num_rounds; ++i) {
      remains = by_poses();
      adjust_depths(normal_from_mad * median_of(remains.sizes_px));
    }
    const double num_free = remains.num_free - num_of_depths_;
    if (num_free > 0.0)
      for (double& size_px : remains.sizes_px) size_px *= std::sqrt(remains.num_free / num_free);
    remains.num_free = std::max(num_free, 0.0);
    return remains;
  }

 private:
  struct OfPoint {
    double sum = 0.0, squares = 0.0, squares_of_third = 0.0;
  };

  /// Residuals of each window's points after its pose change, scaled to their full noise.
  Remains by_poses() {
    constexpr double least_share = 0.02;
    Remains remains;
    of_points_.clear();
    for (WindowPoints& points : windows_) {
      WindowPoints placed = points;
      for (WindowPoint& point : placed) point.J.leftCols<3>() *= inverse_depth_of(point.id);
      const auto change = third_of_pose(placed);
      const auto by_fits = [&](std::size_t i) { return placed[i].fits ? 1.0 : 0.0; };
      const auto slope = pose_change(placed, &WindowPoint::slope, by_fits);
      if (!change || !slope) continue;
      Eigen::MatrixXd H = Eigen::MatrixXd::Zero(6, 6);
      for (const WindowPoint& point : placed)
        if (point.fits) H += point.J.transpose() * point.J;
      const Eigen::Matrix<double, 6, 6> cov = inverse_symmetric(H);
      remains.num_free -= 6.0;
      for (std::size_t i = 0; i < placed.size(); ++i) {
        if (!placed[i].fits) continue;
        const Eigen::Vector2d motion = placed[i].J * *change, left = placed[i].third - motion;
        const Eigen::Vector2d share =
            Eigen::Vector2d::Ones() - (placed[i].J * cov * placed[i].J.transpose()).diagonal();
        for (int k = 0; k < 2; ++k)
          if (share[k] > least_share) remains.sizes_px.push_back(std::abs(left[k]) / std::sqrt(share[k]));
        remains.motions_px.push_back(motion.norm());
        remains.num_free += 2.0;
        note(points[i], *change, *slope);
      }
    }
    return remains;
  }

  /// Accumulates the information on a point's inverse depth from its differences.
  void note(const WindowPoint& point, const PoseChange& third, const PoseChange& slope) {
    constexpr double weight_of_slope = 0.1;  // large motions are not linear
    OfPoint& of_point = of_points_[point.id];
    const auto add = [&](const Eigen::Vector2d& seen, const PoseChange& change, double weight) {
      const Eigen::Vector2d by_translation = point.J.leftCols<3>() * change.head<3>();
      const Eigen::Vector2d rest = seen - point.J.rightCols<3>() * change.tail<3>();
      of_point.sum += weight * by_translation.dot(rest);
      of_point.squares += weight * by_translation.squaredNorm();
    };
    add(point.third, third, 1.0);
    of_point.squares_of_third = of_point.squares_of_third + (point.J.leftCols<3>() * third.head<3>()).squaredNorm();
    add(point.slope, slope, weight_of_slope);
  }

  /// Solves for the inverse depths, with a prior at the typical one, σ half of it.
  void adjust_depths(double sigma_px) {
    constexpr double precision = 4.0, least = 0.2, most = 5.0;
    const double of_prior = precision * sigma_px * sigma_px + 1e-12;
    std::vector<double> all;
    num_of_depths_ = 0.0;
    for (const auto& [id, of_point] : of_points_) {
      const double inverse = (of_point.sum + of_prior) / (of_point.squares + of_prior);
      num_of_depths_ += of_point.squares_of_third / (of_point.squares + of_prior);
      inverse_depths_[id] = std::clamp(inverse, least, most);
      all.push_back(inverse_depths_[id]);
    }
    const double usual = median_of(std::move(all));
    for (auto& [id, inverse] : inverse_depths_) inverse /= usual;
  }

  [[nodiscard]] double inverse_depth_of(long id) const {
    const auto at = inverse_depths_.find(id);
    return at == inverse_depths_.end() ? 1.0 : at->second;
  }

  std::vector<WindowPoints> windows_;
  std::map<long, OfPoint> of_points_;
  std::map<long, double> inverse_depths_;
  double num_of_depths_ = 0.0;  ///< Degrees of freedom of third differences that the inverse depths use.
};

/// The windows of a block of consecutive frames at the usual rate.
std::vector<WindowPoints> windows_of(std::span<const ObservationFrame> frames, const Camera& camera, double usual_s) {
  constexpr double longest = 1.6, shortest = 0.3;  // of the usual time between frames
  const std::vector<PixelsById> pixels = without_leaps(frames);
  std::vector<WindowPoints> windows;
  for (std::size_t k = 0; k + num_of_window <= frames.size(); k += num_of_window) {
    std::array<double, num_of_window> t_s{};
    for (std::size_t i = 0; i < num_of_window; ++i) t_s[i] = frames[k + i].t_s;
    bool is_even = true;
    for (std::size_t i = 1; i < num_of_window; ++i)
      is_even = is_even && t_s[i] - t_s[i - 1] > shortest * usual_s && t_s[i] - t_s[i - 1] < longest * usual_s;
    if (!is_even) continue;
    WindowPoints points = window_points(std::span(pixels).subspan(k, num_of_window), t_s, camera);
    if (points.size() >= min_points) windows.push_back(std::move(points));
  }
  return windows;
}

/// Over all frames, or for a long recording over blocks spread across it.
Remains remains_of(std::span<const ObservationFrame> frames, const Camera& camera) {
  constexpr std::size_t frames_of_block = num_of_window * windows_of_block, most_blocks = 8;
  std::vector<double> gaps_s;
  for (std::size_t k = 1; k < frames.size(); ++k) gaps_s.push_back(frames[k].t_s - frames[k - 1].t_s);
  const double usual_s = median_of(std::move(gaps_s));
  const std::size_t num_blocks = (frames.size() + frames_of_block - 1) / frames_of_block;
  const std::size_t num = std::min(num_blocks, most_blocks);
  Remains all;
  for (std::size_t b = 0; b < num; ++b) {
    const std::size_t first = b * num_blocks / num * frames_of_block;
    const auto part = frames.subspan(first, std::min(frames_of_block, frames.size() - first));
    const Remains some = Block(windows_of(part, camera, usual_s)).remains();
    if (!(some.num_free > 0.0)) continue;
    all.sizes_px.insert(all.sizes_px.end(), some.sizes_px.begin(), some.sizes_px.end());
    all.motions_px.insert(all.motions_px.end(), some.motions_px.begin(), some.motions_px.end());
    all.num_free += some.num_free;
  }
  return all;
}

}  // namespace

std::optional<WhitePixels> white_pixels(std::span<const ObservationFrame> frames, const Camera& camera) {
  constexpr double min_free = 40.0, of_normal = 1.6449;  // 90 % of normal sizes, in σ
  Remains remains = remains_of(frames, camera);
  if (!(remains.num_free >= min_free)) return std::nullopt;
  std::vector<double>& sizes_px = remains.sizes_px;
  const auto at_90 = sizes_px.begin() + static_cast<std::ptrdiff_t>(9 * sizes_px.size() / 10);
  std::ranges::nth_element(sizes_px, at_90);
  const double large_px = *at_90, sigma_px = normal_from_mad * median_of(std::move(sizes_px));
  // σ from the median size of n independent ones has a relative σ of 1.17/√n; poses and depths correlate these.
  return WhitePixels{.sigma_px = sigma_px,
                     .relative = 1.3 / std::sqrt(remains.num_free),
                     .motion_px = median_of(std::move(remains.motions_px)),
                     .tails = large_px / (of_normal * std::max(sigma_px, 1e-12))};
}

std::optional<double> other_sigma_px(std::span<const ObservationFrame> frames, const Camera& camera, double usual_px) {
  constexpr double min_px = 0.1, max_px = 6.0;  // accuracy that point detectors reach, and that they need
  constexpr double min_off = 3.0, min_change = 0.1, max_tails = 1.2, of_motion = 0.1;
  const auto white = white_pixels(frames, camera);
  if (!white || white->sigma_px > max_px || white->tails > max_tails) return std::nullopt;
  const double change = white->sigma_px / usual_px - 1.0;
  if (!(std::abs(change) > std::max(min_off * white->relative, min_change))) return std::nullopt;
  if (change > 0.0 && white->sigma_px < of_motion * white->motion_px) return std::nullopt;
  return std::max(white->sigma_px, min_px);
}

}  // namespace alidade
