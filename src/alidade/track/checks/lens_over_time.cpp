#include "alidade/track/checks/lens_over_time.h"

#include <cmath>

namespace alidade {
namespace {

bool has_history(std::span<const IntrinsicsHistory> histories, std::size_t head) {
  return head < histories.size() && !histories[head].lens.empty();
}

/// σ of fx, fy, cx, cy converted to the camera's own intrinsics: the one with the same effect on pixels.
Eigen::Vector4d sigma_in_own(const Camera& camera, const IntrinsicsSample& now) {
  const Eigen::Vector2d ratio = Zoomed(camera, now.k).ratio;
  return now.sigma.cwiseQuotient(Eigen::Vector4d(ratio.x(), ratio.y(), ratio.x(), ratio.y()));
}

/// Replaces the four parameters from index `first` by independent ones with the given σ.
void replace_lens(Eigen::MatrixXd& cov, Eigen::Index first, const Eigen::Vector4d& sigma) {
  cov.middleRows<4>(first).setZero();
  cov.middleCols<4>(first).setZero();
  cov.diagonal().segment<4>(first) = sigma.cwiseAbs2();
}

}  // namespace

std::optional<OutsideHistory> outside_history(std::span<const TargetObservation> observations,
                                              std::span<const IntrinsicsHistory> histories, double beyond_s) {
  for (const TargetObservation& observation : observations) {
    if (!has_history(histories, observation.head)) continue;
    const IntrinsicsHistory& history = histories[observation.head];
    if (observation.t_capture_s < history.from_s - beyond_s || observation.t_capture_s > history.until_s + beyond_s)
      return OutsideHistory{observation.head, observation.t_capture_s};
  }
  return std::nullopt;
}

void use_intrinsics_histories(std::span<const IntrinsicsHistory> histories,
                              std::vector<TargetObservation>& observations, Rig& rig) {
  Eigen::Index first = num_head_params * static_cast<Eigen::Index>(rig.heads.size());
  for (std::size_t h = 0; h < rig.heads.size(); ++h) {
    Camera& camera = rig.heads[h].camera;
    const Eigen::Index num = params(camera.lens).size();
    if (has_history(histories, h)) {
      Eigen::Vector4d sum2 = Eigen::Vector4d::Zero();
      double count = 0.0;
      for (TargetObservation& observation : observations) {
        if (observation.head != h) continue;
        const IntrinsicsSample now = histories[h].at(observation.t_capture_s);
        const Eigen::Vector4d sigma = sigma_in_own(camera, now);
        observation.lens = ObservationLens{now.k, sigma};
        sum2 += sigma.cwiseAbs2();
        count += 1.0;
      }
      const Eigen::Vector4d usual = (sum2 / std::max(1.0, count)).cwiseSqrt();
      for (TargetObservation& observation : observations)
        for (Eigen::Index k = 0; observation.head == h && k < 4; ++k)
          observation.lens->error_scale[k] = usual[k] > 0.0 ? observation.lens->error_scale[k] / usual[k] : 1.0;
      if (camera.cov.rows() != num) camera.cov.setZero(num, num);
      replace_lens(camera.cov, 0, usual);
      if (rig.cov_with_lenses.rows() >= first + num) replace_lens(rig.cov_with_lenses, first, usual);
    }
    first += num;
  }
}

}  // namespace alidade
