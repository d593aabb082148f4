#include "cli/project_rig.h"

#include <fmt/format.h>

#include <cmath>
#include <numbers>

#include "alidade/io/rig_file.h"

namespace alidade::cli {
namespace {

/// The value of head `h`: all heads' one, or its own.
double of_head(const std::vector<double>& values, std::size_t h) { return values[values.size() == 1 ? 0 : h]; }

void check_angles(const std::vector<double>& angles_rad, const char* option, std::size_t num_heads) {
  if (angles_rad.size() != 1 && angles_rad.size() != num_heads)
    throw UsageError(fmt::format("{}: {} angles for {} heads; give one, or one for each (0.1,0.2)", option,
                                 angles_rad.size(), num_heads));
  for (const double angle : angles_rad) {
    if (!(std::abs(angle) <= 2.0 * std::numbers::pi))
      throw UsageError(fmt::format("{}: {:g} is more than a turn; angles are radians", option, angle));
  }
}

JsonValue rows_of(const Eigen::Matrix<double, 3, 4>& M) {
  JsonValue rows = JsonValue::list();
  for (Eigen::Index i = 0; i < 3; ++i) rows.push_back(std::vector<double>{M(i, 0), M(i, 1), M(i, 2), M(i, 3)});
  return rows;
}

void say_matrix(const Eigen::Matrix<double, 3, 4>& M, int number, int id, const Eigen::Vector2d& readings, Run& run) {
  run.say(fmt::format("M{} (head {}, pan {:g} rad, tilt {:g} rad)", number, id, readings.x(), readings.y()));
  for (Eigen::Index i = 0; i < 3; ++i)
    run.say(fmt::format("  {:14.6f} {:14.6f} {:14.6f} {:14.6f}", M(i, 0), M(i, 1), M(i, 2), M(i, 3)));
}

/// Covariance of a pixel by the encoder's noise, the mounting's covariance and the lens'.
Eigen::Matrix2d pixel_covariance(const Rig& rig, std::size_t h, const HeadPixelOfParams& seen) {
  const RigHead& rig_head = rig.heads[h];
  const double sigma = rig_head.head.encoder.sigma_rad;
  Eigen::Matrix2d cov = sigma * sigma * seen.pixel.J_px_readings * seen.pixel.J_px_readings.transpose();
  if (rig.cov.size() > 0) {
    const Eigen::Index first = num_head_params * static_cast<Eigen::Index>(h);
    cov += seen.J_px_head * rig.cov.block<num_head_params, num_head_params>(first, first) * seen.J_px_head.transpose();
  }
  const auto lens = project_with_jacobians(rig_head.camera, seen.pixel.point_in_cam);
  if (lens && rig_head.camera.cov.rows() == lens->J_px_params.cols())
    cov += lens->J_px_params * rig_head.camera.cov * lens->J_px_params.transpose();
  return cov;
}

/// Where a head sees a point, with its σ; false: not in its sight.
bool add_pixel(const Rig& rig, std::size_t h, const Eigen::Vector2d& readings, const Eigen::Vector3d& point_in_world,
               JsonValue& head, Run& run) {
  const auto seen = project_with_head(rig.heads[h], readings, point_in_world);
  if (!seen) {
    run.say("  the point is not in the camera's sight");
    return false;
  }
  const Eigen::Matrix2d cov = pixel_covariance(rig, h, *seen);
  head["px"] = std::vector<double>{seen->pixel.px.x(), seen->pixel.px.y()};
  head["sigma_px"] = std::vector<double>{std::sqrt(cov(0, 0)), std::sqrt(cov(1, 1))};
  run.say(fmt::format("  u {:.3f} ± {:.2g}  v {:.3f} ± {:.2g} px   (3σ)", seen->pixel.px.x(),
                      3.0 * std::sqrt(cov(0, 0)), seen->pixel.px.y(), 3.0 * std::sqrt(cov(1, 1))));
  return true;
}

}  // namespace

ExitCode project_rig(const RigProjectionArgs& args, Run& run) {
  run.add_input("rig", args.rig);
  const Rig rig = read_rig(args.rig);
  check_angles(args.pans_rad, "--pan", rig.heads.size());
  check_angles(args.tilts_rad, "--tilt", rig.heads.size());
  JsonValue heads = JsonValue::list();
  std::size_t num_seen = 0;
  for (std::size_t h = 0; h < rig.heads.size(); ++h) {
    const RigHead& rig_head = rig.heads[h];
    const Eigen::Vector2d readings(of_head(args.pans_rad, h), of_head(args.tilts_rad, h));
    const Eigen::Matrix<double, 3, 4> M = projection_matrix(rig_head, readings);
    const int number = static_cast<int>(h) + 1;
    say_matrix(M, number, rig_head.head.id, readings, run);
    run.document.estimate[fmt::format("M{}", number)] = rows_of(M);
    JsonValue head;
    head["id"] = rig_head.head.id;
    head["M"] = rows_of(M);
    const Eigen::Vector3d centre = cam_centre_in_world(rig_head.head, readings);
    head["cam_centre_in_world_m"] = std::vector<double>{centre.x(), centre.y(), centre.z()};
    if (!args.point_m.empty() && add_pixel(rig, h, readings, Eigen::Vector3d(args.point_m.data()), head, run))
      ++num_seen;
    heads.push_back(std::move(head));
  }
  run.document.estimate["heads"] = std::move(heads);
  run.document.counts.given = run.document.counts.used = rig.heads.size();
  Verdict verdict;
  verdict.sentence = args.point_m.empty()
                         ? fmt::format("{} projection matrices", rig.heads.size())
                         : fmt::format("{} of {} heads have the point in their sight", num_seen, rig.heads.size());
  return run.finish(verdict);
}

}  // namespace alidade::cli
