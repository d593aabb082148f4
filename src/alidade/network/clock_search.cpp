#include "alidade/network/clock_search.h"

#include <tbb/parallel_for.h>

#include <algorithm>
#include <cmath>
#include <functional>
#include <opencv2/calib3d.hpp>
#include <opencv2/core/eigen.hpp>
#include <vector>

#include "alidade/matching/essential.h"

namespace alidade {
namespace {

constexpr double agree_px = 4.0, min_agree = 2e-3;
constexpr std::size_t min_common = 30;

struct Common {
  std::vector<double> t_s;
  std::vector<Eigen::Vector2d> first, second;
};

/// At most so many moments at which both see the target.
Common common_observations(const ObservationSeries& first, const ObservationSeries& second, double offset_s,
                           std::size_t most) {
  Common common;
  const std::size_t stride = std::max<std::size_t>(1, first.t_s.size() / most);
  for (std::size_t i = 0; i < first.t_s.size(); i += stride) {
    const auto there = second.seen_at(first.t_s[i] + offset_s);
    if (!there) continue;
    common.t_s.push_back(first.t_s[i]);
    common.first.emplace_back(first.at[i].x(), first.at[i].y());
    common.second.emplace_back(there->x(), there->y());
  }
  return common;
}

double threshold(const ObservationSeries& a, const ObservationSeries& b) {
  return std::max(min_agree, agree_px / std::min(a.px, b.px));
}

/// Share of the common observations that agree with their best epipolar geometry.
ObservationPair agreement(std::span<const ObservationSeries> series, std::size_t first, std::size_t second,
                          double offset_s, std::size_t most, std::size_t max_draws) {
  ObservationPair pair{first, second, offset_s, 0.0, 0};
  const Common common = common_observations(series[first], series[second], offset_s, most);
  pair.num_common = common.t_s.size();
  if (pair.num_common < min_common) return pair;
  const auto found =
      agreeing_essential(common.first, common.second, {threshold(series[first], series[second]), 0.99, max_draws});
  if (!found) return pair;
  pair.share = static_cast<double>(found->num_agree) / static_cast<double>(pair.num_common);
  return pair;
}

/// Few common observations agree by chance: what counts is how many beyond.
double strength(const ObservationPair& pair) {
  constexpr double by_chance = 40.0;
  return pair.share * static_cast<double>(pair.num_common) / (static_cast<double>(pair.num_common) + by_chance);
}

}  // namespace

std::optional<ObservationPair> agreeing_offset(std::span<const ObservationSeries> series, std::size_t first,
                                               std::size_t second, double search_s, const Progress& progress) {
  constexpr double coarse_s = 0.25, fine_s = 0.05;
  const auto steps = static_cast<int>(std::ceil(search_s / coarse_s));
  std::vector<double> offsets_s;
  for (int k = -steps; k <= steps; ++k) offsets_s.push_back(coarse_s * k);
  std::vector<ObservationPair> coarse(offsets_s.size());
  constexpr std::size_t at_once = 32;  // between reports of progress
  for (std::size_t begin = 0; begin < coarse.size(); begin += at_once) {
    const std::size_t end = std::min(begin + at_once, coarse.size());
    tbb::parallel_for(begin, end,
                      [&](std::size_t i) { coarse[i] = agreement(series, first, second, offsets_s[i], 140, 40); });
    report_progress(progress, "clocks", end - 1, coarse.size());
  }
  // Few samples can miss the best geometry: the best few offsets are looked at again.
  constexpr std::size_t max_again = 6;
  const auto again = coarse.begin() + static_cast<std::ptrdiff_t>(std::min(max_again, coarse.size()));
  std::ranges::partial_sort(coarse, again, std::greater{}, strength);
  ObservationPair best{first, second, 0.0, -1.0, 0};
  const auto consider = [&](const std::vector<double>& each_s) {
    std::vector<ObservationPair> pairs(each_s.size());
    tbb::parallel_for(std::size_t{0}, pairs.size(),
                      [&](std::size_t i) { pairs[i] = agreement(series, first, second, each_s[i], 300, 300); });
    for (const ObservationPair& pair : pairs)
      if (strength(pair) > strength(best)) best = pair;
  };
  offsets_s.clear();
  for (auto one = coarse.begin(); one != again; ++one)
    if (one->num_common >= min_common) offsets_s.push_back(one->offset_s);
  consider(offsets_s);
  if (best.num_common < min_common) return std::nullopt;
  const double centre_s = best.offset_s;
  const int around = steps > 0 ? static_cast<int>(std::round(0.6 * coarse_s / fine_s)) : 0;
  offsets_s.clear();
  for (int k = -around; k <= around; ++k)
    if (k != 0) offsets_s.push_back(centre_s + fine_s * k);
  consider(offsets_s);
  return best;
}

std::optional<RelativePose> relative_pose(const ObservationSeries& first, const ObservationSeries& second,
                                          double offset_s) {
  const Common common = common_observations(first, second, offset_s, 2000);
  if (common.t_s.size() < min_common) return std::nullopt;
  const auto found = agreeing_essential(common.first, common.second, {threshold(first, second), 0.999, 1000});
  if (!found) return std::nullopt;
  std::vector<cv::Point2d> in_first, in_second;
  for (std::size_t i = 0; i < common.t_s.size(); ++i) {
    in_first.emplace_back(common.first[i].x(), common.first[i].y());
    in_second.emplace_back(common.second[i].x(), common.second[i].y());
  }
  constexpr double furthest = 1e3;
  cv::Mat E, R, t, points, agree(found->agree, true);
  cv::eigen2cv(found->E, E);
  cv::recoverPose(E, in_first, in_second, cv::Mat::eye(3, 3, CV_64F), R, t, furthest, agree, points);
  // Rays that agree but meet behind a camera are of one whose images are mirrored.
  if (2 * cv::countNonZero(agree) < static_cast<int>(found->num_agree)) return std::nullopt;
  Eigen::Matrix3d rotation;
  Eigen::Vector3d translation;
  cv::cv2eigen(R, rotation);
  cv::cv2eigen(t, translation);
  RelativePose pose{{Eigen::Quaterniond(rotation), translation}, {}, {}};
  for (std::size_t i = 0; i < common.t_s.size(); ++i) {
    if (agree.at<unsigned char>(static_cast<int>(i)) == 0) continue;
    const Eigen::Vector4d point(points.at<double>(0, static_cast<int>(i)), points.at<double>(1, static_cast<int>(i)),
                                points.at<double>(2, static_cast<int>(i)), points.at<double>(3, static_cast<int>(i)));
    pose.t_s.push_back(common.t_s[i]);
    pose.point_in_first.emplace_back(point.head<3>() / point.w());
  }
  if (pose.t_s.size() < min_common) return std::nullopt;
  return pose;
}

namespace {

/// The pose with which the most points agree; none where a solver finds its points too near to each other.
std::optional<Resection> agreeing_pose(const std::vector<cv::Point3d>& points, const std::vector<cv::Point2d>& seen,
                                       double reach, cv::SolvePnPMethod solver) try {
  cv::Mat turn, translation, agree;
  if (!cv::solvePnPRansac(points, seen, cv::Mat::eye(3, 3, CV_64F), cv::noArray(), turn, translation, false, 100,
                          static_cast<float>(reach), 0.99, agree, solver))
    return std::nullopt;
  Eigen::Vector3d phi, t;
  cv::cv2eigen(turn, phi);
  cv::cv2eigen(translation, t);
  return Resection{
      {exp_so3(phi), t}, static_cast<double>(agree.rows) / static_cast<double>(points.size()), points.size()};
} catch (const cv::Exception&) {
  return std::nullopt;
}

}  // namespace

std::optional<Resection> resection(const ObservationSeries& camera, std::span<const double> t_s,
                                   std::span<const Eigen::Vector3d> point_in_world, double offset_s, double rate) {
  std::vector<cv::Point3d> points;
  std::vector<cv::Point2d> seen;
  const double mid_s = 0.5 * (t_s.front() + t_s.back());
  for (std::size_t i = 0; i < t_s.size(); ++i) {
    const auto at = camera.seen_at(t_s[i] + offset_s + (rate - 1.0) * (t_s[i] - mid_s));
    if (!at) continue;
    points.emplace_back(point_in_world[i].x(), point_in_world[i].y(), point_in_world[i].z());
    seen.emplace_back(at->x(), at->y());
  }
  if (points.size() < min_common) return std::nullopt;
  const double reach = std::max(2.0 * min_agree, 2.0 * agree_px / camera.px);
  constexpr double most = 0.5;
  const auto best = agreeing_pose(points, seen, reach, cv::SOLVEPNP_SQPNP);
  if (best && best->share >= most) return best;
  // It refuses points that are one, as of a target that rests; EPnP is wrong where they are in a plane.
  const auto other = agreeing_pose(points, seen, reach, cv::SOLVEPNP_EPNP);
  return other && !(best && best->share >= other->share) ? other : best;
}

}  // namespace alidade
