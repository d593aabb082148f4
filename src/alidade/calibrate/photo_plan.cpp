#include "alidade/calibrate/photo_plan.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>

namespace alidade {
namespace {

std::string photo_fault(const CalibratedNow& now) {
  const Eigen::VectorXd values = params(now.camera.lens);
  const Eigen::MatrixXd& cov = now.camera.cov;
  if (now.camera.width_px < 1 || now.camera.height_px < 1 || !values.allFinite()) return "the camera is none";
  if (cov.size() > 0 && (cov.rows() != values.size() || cov.cols() != values.size() || !cov.allFinite()))
    return "the camera's covariance is not of its parameters";
  if (!(now.noise_px >= 0.0) || !std::isfinite(now.noise_px)) return "noise_px is not at least 0";
  if (!std::isfinite(now.design_effect)) return "design_effect is not finite";
  const auto is_finite = [](const Eigen::Vector3d& point) { return point.allFinite(); };
  return std::ranges::all_of(now.board_points, is_finite) ? "" : "a point of the board is not finite";
}

Verdict photos_verdict(const PhotoPlan& plan) {
  Verdict verdict;
  if (plan.photos.empty()) {
    verdict.state = State::refused;
    verdict.exit_code = ExitCode::undetermined;
    verdict.sentence = "no board pose can be proposed: this camera has no covariance, or the board fits nowhere";
    verdict.to_add = "calibrate again from photos";
    return verdict;
  }
  verdict.sentence =
      fmt::format("{} more photo{} lower the worst 3σ from {:.2g} to {:.2g} px", plan.photos.size(),
                  plan.photos.size() == 1 ? "" : "s", plan.worst_3sigma_px, plan.photos.back().worst_3sigma_px);
  heed_gain(plan.photos.back().worst_3sigma_px / plan.worst_3sigma_px, "more photos do not help: use this camera",
            verdict);
  return verdict;
}

}  // namespace

FieldList fields_of(PhotoConfig& config) {
  return {{.name = "photos", .value = &config.photos, .help = "Number of photos to propose", .limits = {1, 20}}};
}

PhotoPlan plan_photos(const CalibratedNow& now, const PhotoConfig& config, const Progress& progress) {
  PhotoConfig copy = config;
  std::vector<std::string> faults = faults_of(fields_of(copy));
  if (const std::string fault = photo_fault(now); !fault.empty()) faults.push_back(fault);
  if (!faults.empty()) throw ConfigError(fmt::format("{}", fmt::join(faults, "; ")));
  const double shared_noise_px = now.noise_px * std::sqrt(std::max(1.0, now.design_effect));
  PhotoPlan plan;
  static_cast<NextPhotoPlan&>(plan) =
      plan_next_photos(now.camera, shared_noise_px, now.board_points, config.photos, progress);
  plan.now = now;
  if (!plan.photos.empty()) plan.counts.given = plan.counts.used = 1;
  plan.verdict = photos_verdict(plan);
  return plan;
}

CalibratedNow calibrated_now(const Calibration& calibration) {
  if (calibration.status != CalibrateReport::Status::converged) throw ConfigError("this calibration has no camera");
  return {calibration.camera, calibration.board, calibration.board_points, calibration.noise_px,
          calibration.clusters.design_effect};
}

}  // namespace alidade
