#include "alidade/network/observation_series.h"
#include "alidade/estimation/median.h"

#include <algorithm>
#include <cmath>
#include <utility>

#include "alidade/geometry/decompositions.h"

namespace alidade {

std::optional<Eigen::Vector2d> ObservationSeries::seen_at(double time_s) const {
  constexpr double max_spacings = 3.5, max_jump = 0.05;
  const auto after = std::ranges::lower_bound(t_s, time_s);
  if (after == t_s.begin() || after == t_s.end()) return std::nullopt;
  const auto i = static_cast<std::size_t>(after - t_s.begin());
  const double step_s = t_s[i] - t_s[i - 1];
  if (!(step_s > 0.0) || step_s > max_spacings * spacing_s || (at[i] - at[i - 1]).norm() > max_jump)
    return std::nullopt;
  const double share = (time_s - t_s[i - 1]) / step_s;
  return Eigen::Vector2d((1.0 - share) * at[i - 1] + share * at[i]);
}

ObservationSeries observation_series(std::span<const TargetObservation> observations, std::size_t head,
                                     const RigHead& rig_head) {
  ObservationSeries series;
  std::vector<Eigen::Vector2d> pixels;
  std::vector<std::size_t> own;
  for (std::size_t i = 0; i < observations.size(); ++i) {
    if (observations[i].head != head) continue;
    own.push_back(i);
    pixels.push_back(observations[i].px);
  }
  const auto rays = unproject(rig_head.camera, pixels);
  std::vector<double> steps;
  for (std::size_t k = 0; k < own.size(); ++k) {
    if (!rays[k] || !(rays[k]->z() > 0.1)) continue;
    if (!series.t_s.empty()) steps.push_back(observations[own[k]].t_capture_s - series.t_s.back());
    series.t_s.push_back(observations[own[k]].t_capture_s);
    series.at.push_back(rays[k]->head<2>() / rays[k]->z());
    series.observation.push_back(own[k]);
  }
  if (!steps.empty()) series.spacing_s = median_of(std::move(steps));
  series.px = params(rig_head.camera.lens)[0];
  return series;
}

double knot_of(std::span<const ObservationSeries> series) {
  constexpr double images = 6.0;
  std::vector<double> spacings;
  for (const ObservationSeries& one : series)
    if (one.spacing_s > 0.0) spacings.push_back(one.spacing_s);
  if (spacings.empty()) return 0.0;
  std::ranges::sort(spacings);
  return images * spacings[spacings.size() / 2];
}

bool is_line(std::span<const ObservationSeries> series, std::size_t min_observations) {
  constexpr double max_px = 4.0;
  return std::ranges::none_of(series, [min_observations](const ObservationSeries& one) {
    Eigen::Matrix3d sum = Eigen::Matrix3d::Zero();
    for (const Eigen::Vector2d& at : one.at) {
      const Eigen::Vector3d ray = at.homogeneous();
      sum += ray * ray.transpose() / static_cast<double>(one.at.size());
    }
    return one.at.size() >= min_observations && std::sqrt(std::abs(symmetric_eigen3(sum).values[0])) * one.px > max_px;
  });
}

}  // namespace alidade
