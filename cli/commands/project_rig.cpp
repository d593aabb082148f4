#include "cli/commands/project_rig.h"

#include <fmt/format.h>

#include <cmath>
#include <numbers>

#include "alidade/formats/rig_file.h"
#include "alidade/pantilt/rig_uncertainty.h"
#include "alidade/track/track_assumed.h"

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

/// Where a head sees a point, with its σ; none: not in its observation. `errors`: of the rig, heads and lenses.
std::optional<Eigen::Matrix2d> add_pixel(const RigHead& rig_head, const Eigen::MatrixXd* factor,
                                         const Eigen::Vector2d& readings, const Eigen::Vector3d& point_in_world,
                                         JsonValue& head, Run& run) {
  const auto seen = project(rig_head, readings, point_in_world);
  if (!seen) {
    run.say("  the point is not in the camera's sight");
    return std::nullopt;
  }
  const double sigma = rig_head.head.encoder.sigma_rad;
  Eigen::Matrix2d cov = sigma * sigma * seen->J_px_readings * seen->J_px_readings.transpose();
  if (factor != nullptr) {
    const auto effect = rig_error_effect(*factor, TurnedHead(rig_head.head, readings), rig_head.camera, point_in_world,
                                         Eigen::Vector3d::Zero());
    if (effect) cov += *effect * effect->transpose();
  }
  head["px"] = std::vector<double>{seen->px.x(), seen->px.y()};
  head["sigma_px"] = std::vector<double>{std::sqrt(cov(0, 0)), std::sqrt(cov(1, 1))};
  head["cov_px2"] = std::vector<double>{cov(0, 0), cov(0, 1), cov(1, 1)};
  run.say(fmt::format("  u {:.3f} ± {:.2g}  v {:.3f} ± {:.2g} px   (3σ)", seen->px.x(), 3.0 * std::sqrt(cov(0, 0)),
                      seen->px.y(), 3.0 * std::sqrt(cov(1, 1))));
  return cov;
}

/// How well the heads that see a point tell where it is: by their encoders' noise and the errors of rig and lenses, a
/// pixel being exact. Nothing where fewer than two see it.
void add_point(const Rig& rig, const RigUncertainty& errors, std::span<const HeadReading> readings,
               const Eigen::Vector3d& point_in_world, Run& run) {
  const auto by = meeting_sensitivity(rig.heads, readings, point_in_world, Eigen::Vector3d::Zero());
  if (by.empty()) return;
  Eigen::Matrix3d cov = Eigen::Matrix3d::Zero();
  Eigen::Matrix<double, 3, Eigen::Dynamic> by_errors = Eigen::MatrixXd::Zero(3, errors.num());
  for (std::size_t h = 0; h < by.size(); ++h) {
    if (by[h].size() == 0) continue;
    const Encoder& encoder = rig.heads[h].head.encoder;  // a reading errs as the other way the zero does
    cov += encoder.sigma_rad * encoder.sigma_rad * by[h].middleCols<2>(15) * by[h].middleCols<2>(15).transpose();
    if (errors.num() > 0) by_errors += by[h] * errors.factor[h];
  }
  cov += by_errors * by_errors.transpose();
  run.document.estimate["point_in_world_m"] =
      std::vector<double>{point_in_world.x(), point_in_world.y(), point_in_world.z()};
  run.document.stddev["point_in_world_m"] =
      std::vector<double>{std::sqrt(cov(0, 0)), std::sqrt(cov(1, 1)), std::sqrt(cov(2, 2))};
  JsonValue rows = JsonValue::list();
  for (int i = 0; i < 3; ++i) rows.push_back(std::vector<double>{cov(i, 0), cov(i, 1), cov(i, 2)});
  run.document.estimate["point_cov_m2"] = std::move(rows);
  run.say(fmt::format("the heads tell this point to ± ({:.2g}, {:.2g}, {:.2g}) mm   (3σ)", 3e3 * std::sqrt(cov(0, 0)),
                      3e3 * std::sqrt(cov(1, 1)), 3e3 * std::sqrt(cov(2, 2))));
}

/// What the files do not say of their own errors.
Check files_check(const Rig& rig) {
  Check check{.name = "covariance", .text = "heads and lenses come with their covariance"};
  std::string without = rig.cov.size() > 0 ? "" : "the rig";
  for (const RigHead& head : rig.heads) {
    if (head.camera.cov.rows() == params(head.camera.lens).size()) continue;
    without += (without.empty() ? "" : ", ") + fmt::format("the camera of head {}", head.head.id);
  }
  if (without.empty()) return check;
  check.state = State::care;
  check.text = without + ": given without covariance, whose errors are not in this σ";
  return check;
}

}  // namespace

ExitCode project_rig(const RigProjectionArgs& args, Run& run) {
  run.add_input("rig", args.rig);
  const Rig rig = read_rig(args.rig);
  if (!rig.lens_courses.empty())
    throw InputError(args.rig.string() + ": intrinsics: change with time, which `project` is not told; give a camera");
  check_angles(args.pans_rad, "--pan", rig.heads.size());
  check_angles(args.tilts_rad, "--tilt", rig.heads.size());
  const RigUncertainty errors = rig_uncertainty(rig);
  JsonValue heads = JsonValue::list();
  std::vector<HeadReading> seen_by;
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
    if (!args.point_m.empty() && add_pixel(rig_head, errors.num() > 0 ? &errors.factor[h] : nullptr, readings,
                                           Eigen::Vector3d(args.point_m.data()), head, run))
      seen_by.push_back({h, readings});
    heads.push_back(std::move(head));
  }
  run.document.estimate["heads"] = std::move(heads);
  run.document.counts.given = run.document.counts.used = rig.heads.size();
  Verdict verdict;
  verdict.sentence = args.point_m.empty() ? fmt::format("{} projection matrices", rig.heads.size())
                                          : fmt::format("{} of {} heads have the point in their sight", seen_by.size(),
                                                        rig.heads.size());
  if (!args.point_m.empty()) {
    add_point(rig, errors, seen_by, Eigen::Vector3d(args.point_m.data()), run);
    heed(files_check(rig), "use files with their covariance: alidade calibrate and alidade rig write it", verdict);
  }
  return run.finish(verdict);
}

}  // namespace alidade::cli
