#include "alidade/localize/filter/filter_bank.h"

#include <algorithm>
#include <cmath>

namespace alidade {

FilterBank::FilterBank(const Camera& camera, std::span<const StartHypothesis> starts,
                       const LocalizationFilterConfig& filter, const FilterBankConfig& config)
    : config_(config) {
  for (const StartHypothesis& start : split(starts))
    parts_.push_back({LocalizationFilter(camera, start.motion, start.cov, filter), start.cost});
}

/// Splits along the camera's x and y; the speed along the optical axis is observable at once, from the change of scale.
std::vector<StartHypothesis> FilterBank::split(std::span<const StartHypothesis> starts) const {
  std::vector<StartHypothesis> parts;
  const double half = 0.5 * (config_.splits - 1);
  for (const StartHypothesis& start : starts) {
    if (config_.splits < 2) {
      parts.push_back(start);
      continue;
    }
    const Eigen::Matrix3d world_from_cam = start.motion.world_from_cam.rotation.toRotationMatrix();
    const Eigen::Matrix3d whole = start.cov.block<3, 3>(6, 6);
    for (int a = 0; a < config_.splits; ++a) {
      for (int b = 0; b < config_.splits; ++b) {
        StartHypothesis part = start;
        const Eigen::Vector2d share = config_.spread / half * Eigen::Vector2d(a - half, b - half);
        for (int axis = 0; axis < 2; ++axis) {
          const Eigen::Vector3d side = world_from_cam.col(axis);
          const double variance = side.dot(whole * side);
          part.motion.velocity_in_world += share[axis] * std::sqrt(variance) * side;
          part.cov.block<3, 3>(6, 6) -=
              (1.0 - config_.narrowed * config_.narrowed) * variance * side * side.transpose();
        }
        part.cost += share.squaredNorm();
        parts.push_back(part);
      }
    }
  }
  return parts;
}

void FilterBank::predict(double dt_s) {
  for (Part& part : parts_) part.filter.predict(dt_s);
}

ObservationsReport FilterBank::update(std::span<const FeatureObservation> observations) {
  ObservationsReport of_best;
  double least = std::numeric_limits<double>::infinity();
  for (std::size_t i = 0; i < parts_.size(); ++i) {
    const ObservationsReport report = parts_[i].filter.update(observations);
    parts_[i].cost += report.cost;
    const bool is_better = parts_[i].cost < least || i == 0;
    if (!is_better) continue;
    least = parts_[i].cost;
    best_ = i;
    of_best = report;
  }
  if (parts_.size() > 1 && !observations.empty()) {
    ++num_updates_;
    prune();
  }
  return of_best;
}

void FilterBank::prune() {
  const double least = parts_[best_].cost;
  std::size_t kept = 0;
  for (std::size_t i = 0; i < parts_.size(); ++i) {
    const bool stays = i == best_ || (num_updates_ < config_.max_frames && parts_[i].cost < least + config_.min_weight);
    if (!stays) continue;
    if (i == best_) best_ = kept;
    if (i != kept) std::swap(parts_[kept], parts_[i]);
    ++kept;
  }
  parts_.erase(parts_.begin() + static_cast<std::ptrdiff_t>(kept), parts_.end());
}

void FilterBank::add_known(long id, const Eigen::Vector3d& point_in_world, double sigma_m) {
  for (Part& part : parts_) part.filter.add_known(id, point_in_world, sigma_m);
}

bool FilterBank::add(long id, const Eigen::Vector2d& px, const RangePrior& prior, FeatureKind kind) {
  for (Part& part : parts_) part.filter.add(id, px, prior, kind);
  return best().has(id);
}

void FilterBank::remove(long id) {
  for (Part& part : parts_) part.filter.remove(id);
}

int FilterBank::convert_linear() {
  int num_converted = 0;
  for (std::size_t i = 0; i < parts_.size(); ++i) {
    const int converted = parts_[i].filter.convert_linear();
    if (i == best_) num_converted = converted;
  }
  return num_converted;
}

void FilterBank::fit_frame() {
  for (Part& part : parts_) part.filter.fit_frame();
}

void FilterBank::restart(std::span<const StartHypothesis> starts) {
  const LocalizationFilter map = best();
  parts_.clear();
  for (const StartHypothesis& start : split(starts)) {
    parts_.push_back({map, start.cost});
    parts_.back().filter.place_camera(start.motion, start.cov);
  }
  best_ = 0;
  num_updates_ = 0;
}

}  // namespace alidade
