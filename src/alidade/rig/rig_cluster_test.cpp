#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>

#include "alidade/geometry/decompositions.h"
#include "alidade/geometry/degree.h"
#include "alidade/rig/rig.h"
#include "alidade/simulate/draws.h"
#include "alidade/simulate/rig.h"

namespace alidade {
namespace {

std::map<int, Camera> cameras_in(const Rig& rig) {
  std::map<int, Camera> cameras;
  for (const RigHead& rig_head : rig.heads) cameras[rig_head.head.id] = rig_head.camera;
  return cameras;
}

/// Of the second camera in the first, at these readings.
Eigen::Matrix<double, 6, 1> error_between(const Rig& rig, const Rig& truth, const Eigen::Vector2d& first,
                                          const Eigen::Vector2d& second) {
  const auto cam_from_cam = [&](const Rig& of) {
    return cam_from_world(of.heads[0].head, first) * world_from_cam(of.heads[1].head, second);
  };
  const Rigid3 a = cam_from_cam(rig), b = cam_from_cam(truth);
  Eigen::Matrix<double, 6, 1> xi;
  xi << b.rotation.conjugate() * (a.translation - b.translation), log_so3(b.rotation.conjugate() * a.rotation);
  return xi;
}

/// Errors that all corners of a view share.
struct SharedErrors {
  double shift_px = 0.0;    ///< Blur: σ of a shift of the whole view.
  double jitter_rad = 0.0;  ///< σ of the encoders beyond what is told.
  double bow_m = 0.0;       ///< Of the board, in its middle.
};

std::vector<HeadView> views_with(const RigScene& scene, const SharedErrors& errors, std::uint64_t seed) {
  std::vector<HeadView> views = simulate_head_views(scene, {}, seed).views;
  Draws draws(seed + 77);
  const std::vector<Eigen::Vector3d> points = points_in_board(scene.board);
  const Eigen::Vector3d middle = 0.5 * (points.front() + points.back());
  const double reach2 = (points.front() - middle).squaredNorm();
  for (std::size_t v = 0; v < views.size(); ++v) {
    HeadView& view = views[v];
    const Eigen::Vector2d shift = errors.shift_px * draws.normal2();
    view.pan_tilt_rad += errors.jitter_rad * draws.normal2();
    const auto of_head = [&](const RigHead& one) { return one.head.id == view.head; };
    const RigHead& head = *std::ranges::find_if(scene.rig.heads, of_head);
    const Rigid3& world_from_board = scene.world_from_board[static_cast<std::size_t>(view.board)];
    for (Corner& corner : view.seen.corners) {
      const Eigen::Vector3d& flat = points[static_cast<std::size_t>(corner.index)];
      const Eigen::Vector3d bent =
          flat + errors.bow_m * (1.0 - (flat - middle).squaredNorm() / reach2) * Eigen::Vector3d::UnitZ();
      const Eigen::Vector2d true_rad = scene.views[v].pan_tilt_rad;
      const auto there = project(head, true_rad, world_from_board * bent);
      const auto here = project(head, true_rad, world_from_board * flat);
      corner.px += shift;
      if (there && here) corner.px += there->px - here->px;
    }
  }
  return views;
}

struct RigCoverage {
  double one = 0.0, two = 0.0, model_two = 0.0;  ///< Shares.
  double nees = 0.0;                             ///< Of six.
  int good = 0, runs = 0;
};

RigCoverage rig_coverage(const SharedErrors& errors, int runs) {
  RigCoverage coverage;
  double num = 0.0;
  for (int run = 1; run <= runs; ++run) {
    const auto seed = static_cast<std::uint64_t>(run);
    const RigScene scene = draw_rig_scene({}, seed);
    RigConfig config{.sigma_px = {}, .sigma_encoder_rad = 0.02 * degree};
    config.sigma_square_m = 1e-9;
    config.sigma_scale = 1e-9;
    std::map<int, Camera> cameras = cameras_in(scene.rig);
    for (auto& [id, camera] : cameras) camera.cov.setZero(5, 5);  // exact
    const RigReport report =
        calibrate_rig(views_with(scene, errors, seed), points_in_board(scene.board), cameras, config);
    if (report.status != RigReport::Status::converged) continue;
    ++coverage.runs;
    coverage.good += rig_verdict(report, config).state == State::good ? 1 : 0;
    Rig model = report.rig;
    model.cov = report.cov_model;
    for (const double side : {-1.0, 1.0}) {
      const Eigen::Vector2d first(0.3 * side, 0.2), second(-0.4 * side, 0.1);
      const auto xi = error_between(report.rig, scene.rig, first, second);
      const auto stated = relative_covariance(report.rig, 0, first, 1, second);
      const auto ideal = relative_covariance(model, 0, first, 1, second);
      coverage.nees += squared_mahalanobis(xi, stated) / 2.0;
      for (int k = 0; k < 6; ++k, num += 1.0) {
        coverage.one += std::abs(xi[k]) < std::sqrt(stated(k, k)) ? 1.0 : 0.0;
        coverage.two += std::abs(xi[k]) < 2.0 * std::sqrt(stated(k, k)) ? 1.0 : 0.0;
        coverage.model_two += std::abs(xi[k]) < 2.0 * std::sqrt(ideal(k, k)) ? 1.0 : 0.0;
      }
    }
  }
  coverage.one /= num;
  coverage.two /= num;
  coverage.model_two /= num;
  coverage.nees /= coverage.runs;
  return coverage;
}

TEST(RigClusters, SigmaHoldsWhereTheModelIsTrue) {
  const RigCoverage coverage = rig_coverage({}, 60);
  EXPECT_EQ(coverage.runs, 60);
  EXPECT_GE(coverage.good, 57);
  // Of 720, the twelve of a run vary together: three σ of a fifth as many.
  EXPECT_NEAR(coverage.one, 0.683, 0.115);
  EXPECT_NEAR(coverage.two, 0.954, 0.05);
}

TEST(RigClusters, SigmaHoldsWhereErrorsAreSharedWithinViews) {
  for (const SharedErrors& errors :
       {SharedErrors{.shift_px = 0.4}, SharedErrors{.jitter_rad = 0.06 * degree}, SharedErrors{.bow_m = 0.001}}) {
    const RigCoverage coverage = rig_coverage(errors, 40);
    EXPECT_GT(coverage.two, 0.90);  // by single corners alone: 0.64 and 0.68 for the first two
    EXPECT_LT(coverage.two, 0.995);
  }
}

}  // namespace
}  // namespace alidade
