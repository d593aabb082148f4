#include "alidade/track/track.h"

#include <Eigen/Cholesky>
#include <algorithm>
#include <cmath>
#include <limits>
#include <optional>

namespace alidade {
namespace {

struct Sums {
  HeadInnovations given;
  Eigen::Vector2d slope = Eigen::Vector2d::Zero(), slope2 = Eigen::Vector2d::Zero();
  double lagged = 0.0, power = 0.0, nis = 0.0, num_along = 0.0;
  std::optional<Eigen::Vector2d> last;
};

/// Direction in the image in which the target moves.
Eigen::Vector2d direction_in_image(const RigHead& head, const TargetObservation& observation, const Belief<6>& belief) {
  const TurnedHead turned(head.head, observation.pan_tilt_rad);
  const auto seen = project(turned, head.camera, belief.x.head<3>());
  if (!seen) return Eigen::Vector2d::Zero();
  const Eigen::Vector2d goes = seen->J_px_point * belief.x.segment<3>(3);
  return goes.norm() > 1.0 ? Eigen::Vector2d(goes.normalized()) : Eigen::Vector2d::Zero();
}

void add(const TargetObservation& observation, const RigHead& head, const TrackStep& step, double gate, Sums& sums) {
  const Innovation& innovation = step.innovation;
  Eigen::Vector2d w = innovation.S.llt().matrixL().solve(innovation.nu);
  if (innovation.nis > gate) w *= std::sqrt(gate / innovation.nis);
  if (!w.allFinite()) return;
  HeadInnovations& given = sums.given;
  ++given.num;
  given.mean += w;
  sums.nis += w.squaredNorm();
  const Eigen::Vector2d goes = direction_in_image(head, observation, step.belief);
  given.along += w.dot(goes);
  sums.num_along += goes.squaredNorm();
  const Eigen::Vector2d size(head.camera.width_px, head.camera.height_px);
  const Eigen::Vector2d place = (4.0 * (observation.px - 0.5 * size)).cwiseQuotient(size);
  sums.slope += w.cwiseProduct(place);
  sums.slope2 += place.cwiseAbs2();
  if (sums.last) sums.lagged += w.dot(*sums.last);
  sums.power += w.squaredNorm();
  sums.last = w;
}

HeadInnovations finished(const Sums& sums) {
  HeadInnovations given = sums.given;
  const auto num = static_cast<double>(given.num);
  if (given.num == 0) return given;
  given.mean /= num;
  given.along = sums.num_along > 0.0 ? given.along / sums.num_along : 0.0;
  given.position_slope = sums.slope.cwiseQuotient(sums.slope2.cwiseMax(1e-9));
  given.position_squares = sums.slope2.minCoeff();
  given.autocorrelation = sums.power > 0.0 ? sums.lagged / sums.power : 0.0;
  given.nis_per_dof = sums.nis / (2.0 * num);
  return given;
}

}  // namespace

std::vector<HeadInnovations> test_innovations(std::span<const TargetObservation> observations,
                                              std::span<const RigHead> heads, std::span<const TrackStep> steps,
                                              const FollowConfig& config) {
  std::vector<Sums> sums(heads.size());
  double began_s = std::numeric_limits<double>::infinity();
  for (std::size_t i = 0; i < steps.size() && i < observations.size(); ++i) {
    const TrackStep& step = steps[i];
    if (step.event == TrackEvent::start || step.event == TrackEvent::restart) began_s = step.t_s;
    if (!step.has_innovation || !(step.t_s >= began_s + config.warm_up_s)) continue;
    add(observations[i], heads[observations[i].head], step, config.tracker.gate, sums[observations[i].head]);
  }
  std::vector<HeadInnovations> given;
  for (const Sums& each : sums) given.push_back(finished(each));
  return given;
}

}  // namespace alidade
