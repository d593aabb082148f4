#include "alidade/localize/frames/still_frames.h"

#include <algorithm>
#include <cmath>
#include <map>
#include <utility>

namespace alidade {
namespace {

struct Look {
  std::size_t frame = 0;
  Eigen::Vector2d px;
  double weight = 4.0;  ///< 1/σ² [px⁻²].
};

struct StillPoint {
  std::vector<Look> looks;  ///< Without mismatches.
  Eigen::Vector2d mean_px = Eigen::Vector2d::Zero();
};

Eigen::Vector2d median_px(std::span<const Look> looks) {
  Eigen::Vector2d median;
  std::vector<double> values(looks.size());
  const auto middle = values.begin() + static_cast<std::ptrdiff_t>(values.size() / 2);
  for (int i = 0; i < 2; ++i) {
    std::ranges::transform(looks, values.begin(), [i](const Look& look) { return look.px[i]; });
    std::ranges::nth_element(values, middle);
    median[i] = *middle;
  }
  return median;
}

void leave_out_mismatches(StillPoint& point) {
  constexpr double mismatch = 20.0;  // χ² of two degrees of freedom: 5·10⁻⁵
  const Eigen::Vector2d median = median_px(point.looks);
  std::erase_if(point.looks,
                [&](const Look& look) { return !((look.px - median).squaredNorm() * look.weight < mismatch); });
  double sum = 0.0;
  for (const Look& look : point.looks) {
    point.mean_px += look.weight * look.px;
    sum += look.weight;
  }
  point.mean_px /= sum;
}

/// Observations by a camera that may stand still.
class StillPoints {
 public:
  StillPoints(std::span<const ObservationFrame> frames, double sigma_px) {
    for (std::size_t k = 0; k < frames.size(); ++k)
      for (const FeatureObservation& each : frames[k].observations)
        points_[each.id].looks.push_back({k, each.px, std::pow(each.sigma_px > 0.0 ? each.sigma_px : sigma_px, -2)});
    for (auto& [id, point] : points_) {
      num_ += point.looks.size();
      leave_out_mismatches(point);
      num_kept_ += point.looks.size();
      for (const Look& look : point.looks) squares_ += look.weight * (look.px - point.mean_px).squaredNorm();
    }
  }

  /// Whether the scatter of all is that of noise, within 3σ.
  [[nodiscard]] bool is_still() const {
    constexpr double nearly_all = 0.95, sigmas = 3.0;
    return static_cast<double>(num_kept_) >= nearly_all * static_cast<double>(num_) && num_kept_ > 2 * points_.size() &&
           excess() < sigmas * sigma_excess();
  }

  /// Means of the known points over intervals of `num` frames. Their σ: from the scatter of the means, if larger than
  /// for independent errors; plus motion hidden by noise.
  [[nodiscard]] std::vector<ObservationFrame> means(std::span<const ObservationFrame> frames,
                                                    std::span<const KnownPoint> known, std::size_t num) const {
    std::vector<ObservationFrame> out;
    for (std::size_t k = 0; k < frames.size(); k += num) out.push_back({frames[k].frame, frames[k].t_s, {}});
    double squares = 0.0, dof = 0.0;
    for (const KnownPoint& given : known) {
      const auto point = points_.find(given.id);
      if (point == points_.end()) continue;
      for (const auto& [stretch, sum] : sums_of(point->second, num)) {
        const Eigen::Vector2d mean_px = sum.hnormalized();
        squares += sum.z() * (mean_px - point->second.mean_px).squaredNorm();
        dof += 2.0;
        out[stretch].observations.push_back({given.id, mean_px, 1.0 / std::sqrt(sum.z())});
      }
      dof -= 2.0;
    }
    const double together = std::max(1.0, squares / std::max(dof, 1.0));
    const double unseen_px2 = (std::max(excess(), 0.0) + sigma_excess()) * variance_px2();
    for (ObservationFrame& frame : out)
      for (FeatureObservation& each : frame.observations)
        each.sigma_px = std::sqrt(together * each.sigma_px * each.sigma_px + unseen_px2);
    return out;
  }

 private:
  /// Weighted sums of u, v and 1, by interval.
  [[nodiscard]] static std::map<std::size_t, Eigen::Vector3d> sums_of(const StillPoint& point, std::size_t num) {
    std::map<std::size_t, Eigen::Vector3d> sums;
    for (const Look& look : point.looks)
      sums.try_emplace(look.frame / num, Eigen::Vector3d::Zero()).first->second += look.weight * look.px.homogeneous();
    return sums;
  }

  [[nodiscard]] double dof() const { return 2.0 * static_cast<double>(num_kept_ - points_.size()); }
  [[nodiscard]] double excess() const { return squares_ / dof() - 1.0; }
  [[nodiscard]] double sigma_excess() const { return std::sqrt(2.0 / dof()); }
  /// Mean variance of an observation.
  [[nodiscard]] double variance_px2() const {
    double sum = 0.0;
    for (const auto& [id, point] : points_)
      for (const Look& look : point.looks) sum += 1.0 / look.weight;
    return sum / static_cast<double>(num_kept_);
  }

  std::map<long, StillPoint> points_;
  std::size_t num_ = 0, num_kept_ = 0;
  double squares_ = 0.0;  ///< About the points' means, over σ².
};

}  // namespace

std::optional<KeptFrames> averaged_still(const KeptFrames& frames, std::span<const KnownPoint> known, double sigma_px) {
  constexpr std::size_t num_stretches = 30, least = 4;  // frames of each
  const std::size_t num_each = (frames.frames().size() + num_stretches - 1) / num_stretches;
  if (num_each < least) return std::nullopt;
  const StillPoints points(frames.frames(), sigma_px);
  if (!points.is_still()) return std::nullopt;
  return frames.averaged(points.means(frames.frames(), known, num_each), num_each);
}

}  // namespace alidade
