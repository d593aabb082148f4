#include "alidade/track/white_noise.h"

#include <Eigen/Core>
#include <Eigen/Geometry>
#include <algorithm>
#include <array>
#include <cmath>

#include "alidade/estimation/median.h"
#include "alidade/geometry/third_difference.h"

namespace alidade {
namespace {

constexpr std::size_t num_of_window = 4;

/// A third difference across the motion; the squares of its weights sum to one.
struct Difference {
  double size_px = 0.0;
  double variance_of_encoders_px2 = 0.0;
};

struct Ray {
  double t_s = 0.0, rad_per_px = 0.0;
  Eigen::Vector3d direction;
};

std::optional<Ray> ray_of(const RigHead& head, const TargetObservation& observation) {
  TargetObservation right = observation, below = observation;
  right.px.x() += 1.0;
  below.px.y() += 1.0;
  const auto ray = ray_in_world(head, observation), ray_right = ray_in_world(head, right),
             ray_below = ray_in_world(head, below);
  if (!ray || !ray_right || !ray_below) return std::nullopt;
  const Eigen::Vector3d direction = ray->direction_in_world.normalized();
  const double rad_per_px = 0.5 * ((ray_right->direction_in_world.normalized() - direction).norm() +
                                   (ray_below->direction_in_world.normalized() - direction).norm());
  return Ray{observation.t_capture_s, rad_per_px, direction};
}

/// The accepted observations of a head, in their order.
std::vector<Ray> rays_of(std::span<const TargetObservation> observations, const RigHead& head, std::size_t index,
                         std::span<const TrackStep> steps) {
  std::vector<Ray> rays;
  for (std::size_t i = 0; i < observations.size() && i < steps.size(); ++i) {
    if (observations[i].head != index || observations[i].sigma_px > 0.0 || !steps[i].accepted) continue;
    if (const auto ray = ray_of(head, observations[i])) rays.push_back(*ray);
  }
  return rays;
}

using Window = std::span<const Ray, num_of_window>;

Difference difference_of(Window rays, double sigma_encoder_rad) {
  const std::array<double, num_of_window> weights =
      third_difference({rays[0].t_s, rays[1].t_s, rays[2].t_s, rays[3].t_s});
  Eigen::Vector3d third = Eigen::Vector3d::Zero(), motion = Eigen::Vector3d::Zero(), middle = Eigen::Vector3d::Zero();
  double middle_s = 0.0, rad_per_px = 0.0;
  for (const Ray& ray : rays) middle_s += ray.t_s / num_of_window;
  for (std::size_t i = 0; i < num_of_window; ++i) {
    third += weights[i] * rays[i].direction;
    motion += (rays[i].t_s - middle_s) * rays[i].direction;  // the slope; its noise is independent of that of `third`
    middle += rays[i].direction;
    rad_per_px += rays[i].rad_per_px / num_of_window;
  }
  const Eigen::Vector3d across = middle.cross(motion).normalized();
  const double of_encoders_px = sigma_encoder_rad / rad_per_px;
  return {std::abs(across.dot(third)) / rad_per_px, of_encoders_px * of_encoders_px};
}

void add_differences(const std::vector<Ray>& rays, double sigma_encoder_rad, std::vector<Difference>& differences) {
  constexpr double longest = 1.6, shortest = 0.3;  // of the usual interval; beyond, curvature of the path matters
  std::vector<double> apart_s;
  for (std::size_t i = 1; i < rays.size(); ++i) apart_s.push_back(rays[i].t_s - rays[i - 1].t_s);
  const double usual_s = median_of(apart_s);
  for (std::size_t i = 0; i + num_of_window <= rays.size(); ++i) {
    const std::span<const double> between(apart_s.data() + i, num_of_window - 1);
    if (!std::ranges::all_of(between, [&](double s) { return s > shortest * usual_s && s < longest * usual_s; }))
      continue;
    const Difference one = difference_of(Window(rays.data() + i, num_of_window), sigma_encoder_rad);
    if (std::isfinite(one.size_px)) differences.push_back(one);
  }
}

/// σ of the differences over the expected one for pixels with `sigma_px`.
double ratio_at(const std::vector<Difference>& differences, double sigma_px) {
  std::vector<double> scaled;
  for (const Difference& one : differences)
    scaled.push_back(one.size_px / std::sqrt(sigma_px * sigma_px + one.variance_of_encoders_px2));
  return normal_from_mad * median_of(std::move(scaled));
}

/// σ of a pixel for which the differences are `ratio` times the expected ones; 0 if the encoders explain them.
double sigma_at(const std::vector<Difference>& differences, double ratio) {
  constexpr int num_halvings = 30;
  double low_px = 0.0, high_px = 100.0;
  for (int i = 0; i < num_halvings; ++i) {
    const double middle_px = 0.5 * (low_px + high_px);
    (ratio_at(differences, middle_px) > ratio ? low_px : high_px) = middle_px;
  }
  return 0.5 * (low_px + high_px);
}

}  // namespace

std::optional<WhiteNoise> white_noise(std::span<const TargetObservation> observations, std::span<const RigHead> heads,
                                      std::span<const TrackStep> steps, double sigma_px, double sigma_encoder_rad) {
  constexpr std::size_t min_differences = 40;
  std::vector<Difference> differences;
  for (std::size_t h = 0; h < heads.size(); ++h) {
    const double own = heads[h].head.encoder.sigma_rad;
    add_differences(rays_of(observations, heads[h], h, steps), own > 0.0 ? own : sigma_encoder_rad, differences);
  }
  if (differences.size() < min_differences) return std::nullopt;
  // σ from the median of n independent values has a relative σ of 1.17/√n; these overlap: 1.2 to 1.6, by simulation.
  const double relative = 1.6 / std::sqrt(static_cast<double>(differences.size()));
  return WhiteNoise{.sigma_px = sigma_at(differences, 1.0),
                    .low_px = sigma_at(differences, 1.0 + relative),
                    .high_px = sigma_at(differences, 1.0 - relative),
                    .off_in_sigma = (ratio_at(differences, sigma_px) - 1.0) / relative};
}

}  // namespace alidade
