#include <algorithm>
#include <array>
#include <cmath>

#include "alidade/geometry/degree.h"
#include "alidade/pantilt/head.h"
#include "alidade/reproduce/papers.h"
#include "alidade/reproduce/xiahou_experiments.h"

namespace alidade::reproduce {
namespace {

/// The angles that the paper begins with: pan and tilt of head 1, of head 2.
const std::array<Eigen::Vector2d, 2> printed_angles{Eigen::Vector2d(-15.3, 25.4) * degree,
                                                    Eigen::Vector2d(27.3, 23.7) * degree};

/// What depth and angles imply, with the sign of (2) reversed. [cm]
double baseline_cm() {
  return paper_target_cm.z() * (std::tan(printed_angles[1].x()) - std::tan(printed_angles[0].x()));
}

/// A point in a head's image at the printed angles.
Eigen::Vector2d pixel_of(std::size_t head, const Eigen::Vector3d& point_m) {
  std::array<RigHead, 2> rig = xiahou_rig();
  rig[1].head.world_from_base.translation.x() = baseline_cm() / 100.0;
  return (projection_matrix(rig[head], printed_angles[head]) * point_m.homogeneous()).hnormalized();
}

std::vector<Claim> angle_claims() {
  const double x_cm = paper_target_cm.z() * std::tan(printed_angles[0].x());
  Claim sign{"geometry-x", "x of the target by (2), from the angles as printed", "cm", 17.3, x_cm, -x_cm};
  sign.holds = near_to(sign.rerun, sign.printed, 0.02);
  sign.words = "(2) has the sign of head 1's pan against (8) to (10) and against head 2. Ours: tan(-alpha1).";
  Claim baseline{"geometry-baseline", "the angles and the depth imply a baseline of 50 cm, which is what we take", "cm",
                 not_a_number, baseline_cm()};
  baseline.holds = near_to(baseline.rerun, 50.0, 0.01);
  baseline.words = "With the sign of (2) turned; as printed it would be 15.4 cm.";
  return {sign, baseline};
}

std::vector<Claim> pixel_claims() {
  const Eigen::Vector2d centre(160.0, 120.0);
  const Eigen::Vector3d target_m = paper_target_cm / 100.0, step_m(baseline_cm() / 100.0, 0.0, 0.0);
  const double off_px = std::max((pixel_of(0, target_m) - centre).norm(), (pixel_of(1, target_m) - centre).norm());
  Claim centred{"geometry-middle",
                "both cameras look at the target at the start: distance from the centre of the image", "px",
                not_a_number, off_px};
  centred.holds = off_px <= 1.0 ? Holds::reproduced : Holds::not_reproducible;
  centred.words =
      "Pan > 0 turns left and tilt > 0 up on both heads, Y points down; angles are printed to 0.1°, 0.6 px.";
  Claim second{"geometry-second-image",
               "u of the target in the second image by (11) and (12), which should be the centre, 160",
               "px",
               not_a_number,
               pixel_of(1, target_m + 2.0 * step_m).x(),
               pixel_of(1, target_m).x()};
  second.holds = near_to(second.rerun, 160.0, 0.02);
  second.words =
      "(12) adds the baseline, X + T; the camera stands at T, so that it must be X - T. As printed the target is far "
      "outside an image of 320 px.";
  return {centred, second};
}

}  // namespace

Experiment xiahou_geometry() {
  std::vector<Claim> claims = angle_claims();
  for (Claim& claim : pixel_claims()) claims.push_back(std::move(claim));
  return {"geometry",
          "Initial geometry",
          "Two pan-tilt heads beside each other, the target at (17.3, -31.4, 63.6) cm, pan and tilt -15.3, 25.4 and "
          "27.3, 23.7°: the paper's equations with its own numbers.",
          "f = 337.84 px, 320×240, heads without offsets.",
          std::move(claims),
          {}};
}

PaperReport reproduce_xiahou2015(const ReproduceConfig& config) {
  PaperReport report{"xiahou2015",
                     "Xiahou et al., \"Modeling and Simulation for Target Tracking System Based on Dual-Pan-Tilt "
                     "Camera\", Journal of System Simulation 27(2), 362-368, 2015",
                     {}};
  report.experiments = {xiahou_geometry(), xiahou_tracking(config), xiahou_servo(config), xiahou_loop(config),
                        xiahou_realistic(config)};
  return report;
}

}  // namespace alidade::reproduce
