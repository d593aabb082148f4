#include "alidade/track/checks/lens_over_time.h"

#include <cmath>

namespace alidade {
namespace {

bool has_course(std::span<const LensCourse> courses, std::size_t head) {
  return head < courses.size() && !courses[head].lens.empty();
}

/// σ of fx, fy, cx, cy as the camera's own intrinsics would have it: what moves its pixels as far in the image.
Eigen::Vector4d sigma_in_own(const Camera& camera, const LensNow& now) {
  const Eigen::Vector2d ratio = Zoomed(camera, now.k).ratio;
  return now.sigma.cwiseQuotient(Eigen::Vector4d(ratio.x(), ratio.y(), ratio.x(), ratio.y()));
}

/// Covariance with these four first parameters from `first` on alone, and nothing shared with the others.
void replace_lens(Eigen::MatrixXd& cov, Eigen::Index first, const Eigen::Vector4d& sigma) {
  cov.middleRows<4>(first).setZero();
  cov.middleCols<4>(first).setZero();
  cov.diagonal().segment<4>(first) = sigma.cwiseAbs2();
}

}  // namespace

std::optional<OutsideCourse> outside_course(std::span<const TargetObservation> observations,
                                            std::span<const LensCourse> courses, double beyond_s) {
  for (const TargetObservation& observation : observations) {
    if (!has_course(courses, observation.head)) continue;
    const LensCourse& course = courses[observation.head];
    if (observation.t_capture_s < course.from_s - beyond_s || observation.t_capture_s > course.until_s + beyond_s)
      return OutsideCourse{observation.head, observation.t_capture_s};
  }
  return std::nullopt;
}

void use_courses(std::span<const LensCourse> courses, std::vector<TargetObservation>& observations, Rig& rig) {
  Eigen::Index first = num_head_params * static_cast<Eigen::Index>(rig.heads.size());
  for (std::size_t h = 0; h < rig.heads.size(); ++h) {
    Camera& camera = rig.heads[h].camera;
    const Eigen::Index num = params(camera.lens).size();
    if (has_course(courses, h)) {
      Eigen::Vector4d sum2 = Eigen::Vector4d::Zero();
      double count = 0.0;
      for (TargetObservation& observation : observations) {
        if (observation.head != h) continue;
        const LensNow now = courses[h].at(observation.t_capture_s);
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
