#include "alidade/turned/focal_start.h"

#include <algorithm>
#include <cmath>
#include <limits>
#include <tuple>

#include "alidade/geometry/decompositions.h"

namespace alidade {
namespace {

constexpr double spread = 0.004;  // of a match's residual, half widths: includes distortion and hand motion
constexpr double truncate_at = 9.0;
constexpr double better = 0.99;  // share of the cost

/// The inliers of a link, thinned.
struct LinkPoints {
  std::vector<Eigen::Vector2d> a, b;
};

/// Normalised points, with y divided by `aspect` so that pixels become square.
LinkPoints points_of(const MatchedPhotos& photos, const PhotoLink& link, double aspect) {
  constexpr std::size_t max_points = 100;
  const PhotoScale scale(photos);
  const MatchedPair& pair = photos.pairs[link.pair];
  const std::size_t step = std::max<std::size_t>(1, link.inliers.size() / max_points);
  LinkPoints points;
  for (std::size_t i = 0; i < link.inliers.size(); i += step) {
    const FeatureMatch& match = pair.matches[static_cast<std::size_t>(link.inliers[i])];
    const auto px = [&](int photo, int feature) {
      Eigen::Vector2d at =
          scale.normalised(photos.features[static_cast<std::size_t>(photo)][static_cast<std::size_t>(feature)]);
      at.y() /= aspect;
      return at;
    };
    points.a.push_back(px(pair.photo_a, match.a));
    points.b.push_back(px(pair.photo_b, match.b));
  }
  return points;
}

struct Turn {
  Eigen::Matrix3d b_from_a = Eigen::Matrix3d::Identity();
  double cost = 0.0;
};

/// Robust rotation between both sets of rays: iteratively reweighted by the residuals.
Turn robust_turn(const LinkPoints& points, double focal) {
  const auto ray = [focal](const Eigen::Vector2d& q) { return Eigen::Vector3d(q.x() / focal, q.y() / focal, 1.0); };
  std::vector<double> weights(points.a.size(), 1.0);
  Turn turn;
  constexpr int rounds = 4;
  for (int round = 0; round < rounds; ++round) {
    Eigen::Matrix3d sum = Eigen::Matrix3d::Zero();
    for (std::size_t i = 0; i < points.a.size(); ++i) {
      sum += weights[i] * ray(points.b[i]).normalized() * ray(points.a[i]).normalized().transpose();
    }
    turn.b_from_a = nearest_rotation(sum);
    turn.cost = 0.0;
    for (std::size_t i = 0; i < points.a.size(); ++i) {
      const Eigen::Vector3d seen = turn.b_from_a * ray(points.a[i]);
      double misfit = 1e3;
      if (seen.z() > 0.05) misfit = (focal * seen.head<2>() / seen.z() - points.b[i]).squaredNorm() / (spread * spread);
      weights[i] = 1.0 / ((1.0 + misfit) * (1.0 + misfit));
      turn.cost += std::min(misfit, truncate_at);
    }
    turn.cost /= static_cast<double>(points.a.size());
  }
  return turn;
}

}  // namespace

std::vector<FocalStart> focal_starts(const MatchedPhotos& photos, const std::vector<PhotoLink>& links, double aspect,
                                     std::size_t most) {
  constexpr std::size_t max_links = 60;  // suffice for the focal length; rotations are estimated for all links
  std::vector<LinkPoints> points;
  for (const PhotoLink& link : links) points.push_back(points_of(photos, link, aspect));
  const std::size_t step = (links.size() + max_links - 1) / max_links;
  std::vector<FocalStart> tried;
  for (double focal = 0.25; focal < 60.0; focal *= 1.05) {
    FocalStart start{focal, aspect, 0.0, {}};
    for (std::size_t i = 0; i < links.size(); i += step) start.cost += robust_turn(points[i], focal).cost;
    tried.push_back(std::move(start));
  }
  std::vector<FocalStart> minima;
  for (std::size_t i = 0; i < tried.size(); ++i) {
    const double before = i > 0 ? tried[i - 1].cost : std::numeric_limits<double>::infinity();
    const double after = i + 1 < tried.size() ? tried[i + 1].cost : std::numeric_limits<double>::infinity();
    if (tried[i].cost <= before && tried[i].cost < after) minima.push_back(tried[i]);
  }
  std::sort(minima.begin(), minima.end(), [](const FocalStart& a, const FocalStart& b) { return a.cost < b.cost; });
  if (minima.size() > most) minima.resize(most);
  for (FocalStart& start : minima) {
    for (const LinkPoints& each : points) start.b_from_a.push_back(robust_turn(each, start.focal).b_from_a);
  }
  return minima;
}

FocalStart start_at(double focal, const MatchedPhotos& photos, const std::vector<PhotoLink>& links, double aspect) {
  FocalStart start{focal, aspect, 0.0, {}};
  for (const PhotoLink& link : links) {
    const Turn turn = robust_turn(points_of(photos, link, aspect), focal);
    start.cost += turn.cost;
    start.b_from_a.push_back(turn.b_from_a);
  }
  return start;
}

double likely_aspect(const MatchedPhotos& photos, const std::vector<PhotoLink>& links) {
  constexpr std::size_t max_links = 20;
  constexpr double most = 2.0, step = 1.06, focal_step = 1.15;
  std::vector<const PhotoLink*> used;
  for (std::size_t i = 0; i < links.size(); i += (links.size() + max_links - 1) / max_links) used.push_back(&links[i]);
  const auto cost_of = [&](double aspect) {
    std::vector<LinkPoints> points;
    for (const PhotoLink* link : used) points.push_back(points_of(photos, *link, aspect));
    double lowest = std::numeric_limits<double>::infinity();
    for (double focal = 0.25; focal < 30.0; focal *= focal_step) {
      double cost = 0.0;
      for (const LinkPoints& each : points) cost += robust_turn(each, focal).cost;
      lowest = std::min(lowest, cost / static_cast<double>(points.size()));
    }
    return lowest;
  };
  double best = 1.0, lowest = std::numeric_limits<double>::infinity();
  for (double aspect = 1.0 / most; aspect < most; aspect *= step) {
    const double cost = cost_of(aspect);
    if (cost < lowest) std::tie(best, lowest) = std::pair(aspect, cost);
  }
  return lowest < better * cost_of(1.0) ? best : 1.0;
}

double zoom_of(const PhotoLink& link, double focal, double aspect) {
  const Eigen::Matrix3d scaled = link.b_from_a * Eigen::Vector3d(focal, aspect * focal, 1.0).asDiagonal();
  return 0.5 * (scaled.row(0).norm() + scaled.row(1).norm() / aspect) / (focal * scaled.row(2).norm());
}

}  // namespace alidade
