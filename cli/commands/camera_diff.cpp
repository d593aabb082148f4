#include "alidade/camera/camera_diff.h"

#include <fmt/format.h>

#include <CLI/CLI.hpp>
#include <algorithm>
#include <cmath>
#include <numbers>

#include "cli/app/app.h"
#include "cli/app/option_checks.h"
#include "cli/commands/camera.h"
#include "cli/commands/camera_values.h"

namespace alidade::cli {
namespace {

struct DiffArgs {
  std::string a, b;
  double distance_m = std::numeric_limits<double>::infinity();
};

// Two calibrations of one camera differ by 1σ RMS over the image. At no pixel can δᵀC⁻¹δ exceed the χ² of the lens' 7
// free directions, which is 24.5 once in a thousand times: 3.5σ by our measure. Twice these limits is not chance at
// all.
constexpr double agree_rms_sigmas = 2.0, agree_max_sigmas = 3.5;

State agreement(const CameraDiff& diff) {
  const double excess = std::max(diff.rms_in_sigmas / agree_rms_sigmas, diff.max_in_sigmas / agree_max_sigmas);
  return excess < 1.0 ? State::good : excess < 2.0 ? State::care : State::bad;
}

Verdict verdict_of(const CameraDiff& diff) {
  Verdict verdict;
  verdict.sentence = fmt::format("{:.2g} px RMS apart over the image (centre {:.2g}, worst {:.2g} px)", diff.rms_px,
                                 diff.central_rms_px, diff.max_px);
  if (std::isnan(diff.rms_in_sigmas)) {
    verdict.state = State::care;
    verdict.sentence += "; neither file has a covariance, so this cannot be judged";
    verdict.to_add = "compare camera.yaml files of alidade calibrate, which carry their covariance";
    return verdict;
  }
  const State agree = agreement(diff);
  verdict.state = std::min(agree, State::care);  // that two cameras differ is a valid answer
  verdict.sentence += fmt::format(", {:.1f}σ RMS, {:.1f}σ at worst: {}", diff.rms_in_sigmas, diff.max_in_sigmas,
                                  agree == State::good   ? "no more than their σ predicts"
                                  : agree == State::care ? "more than their σ predicts"
                                                         : "they are not the same camera, or a σ is too small");
  verdict.checks.push_back(
      {"same camera", agree,
       fmt::format("{:.1f}σ RMS (1 is expected), worst {:.1f}σ", diff.rms_in_sigmas, diff.max_in_sigmas),
       diff.max_in_sigmas, agree_max_sigmas, "σ", "diff"});
  return verdict;
}

void fill_document(const CameraDiff& diff, ResultDocument& document) {
  JsonValue& estimate = document.estimate;
  estimate["rms_px"] = diff.rms_px;
  estimate["max_px"] = diff.max_px;
  estimate["central_rms_px"] = diff.central_rms_px;
  estimate["rms_in_sigmas"] = diff.rms_in_sigmas;
  estimate["max_in_sigmas"] = diff.max_in_sigmas;
  estimate["compared_share"] = static_cast<double>(diff.num_compared) / static_cast<double>(diff.delta_u.values.size());
  const Eigen::Quaterniond& q = diff.b_from_a.rotation;
  const Eigen::Vector3d& t = diff.b_from_a.translation;
  estimate["b_from_a"]["translation_m"] = std::vector<double>{t.x(), t.y(), t.z()};
  estimate["b_from_a"]["quaternion_wxyz"] = std::vector<double>{q.w(), q.x(), q.y(), q.z()};

  const PixelGrid& grid = diff.delta_u;
  document.grids.push_back({"diff",
                            grid.cols,
                            grid.rows,
                            grid.u0_px,
                            grid.v0_px,
                            grid.du_px,
                            grid.dv_px,
                            {{"delta_u_px", rounded(diff.delta_u.values, 4)},
                             {"delta_v_px", rounded(diff.delta_v.values, 4)},
                             {"sigma_a_px", rounded(diff.sigma_a.values, 4)},
                             {"sigma_b_px", rounded(diff.sigma_b.values, 4)},
                             {"in_sigmas", rounded(diff.in_sigmas.values, 2)}}});
  if (diff.parameters.empty()) return;
  std::vector<std::string> names;
  std::vector<double> a, b, sigma_a, sigma_b;
  for (const ParameterDiff& parameter : diff.parameters) {
    names.push_back(parameter.name);
    a.push_back(parameter.a), b.push_back(parameter.b);
    sigma_a.push_back(parameter.sigma_a), sigma_b.push_back(parameter.sigma_b);
  }
  document.data.push_back(
      {"parameters", {{"name", names}, {"a", a}, {"b", b}, {"sigma_a", sigma_a}, {"sigma_b", sigma_b}}});
}

void say_parameters(const CameraDiff& diff, Run& run) {
  for (const ParameterDiff& parameter : diff.parameters) {
    const double sigma = std::hypot(std::isnan(parameter.sigma_a) ? 0.0 : parameter.sigma_a,
                                    std::isnan(parameter.sigma_b) ? 0.0 : parameter.sigma_b);
    const double difference = parameter.b - parameter.a;
    run.say(fmt::format("  {:<5}{:>14.6g} {:>14.6g}  difference {:.3g}{}", parameter.name, parameter.a, parameter.b,
                        difference, sigma > 0.0 ? fmt::format(" ({:.1f}σ)", std::abs(difference) / sigma) : ""));
  }
  const double angle_deg = log_so3(diff.b_from_a.rotation).norm() * 180.0 / std::numbers::pi;
  const double shift_mm = 1e3 * diff.b_from_a.translation.norm();
  run.say(fmt::format("taken out: a rotation of {:.3g}°{}", angle_deg,
                      shift_mm > 0.0 ? fmt::format(" and a shift of {:.3g} mm", shift_mm) : ""));
}

ExitCode compare(const DiffArgs& args, Run& run) {
  const Camera a = read_camera_input(run, args.a), b = read_camera_input(run, args.b);
  if (a.width_px != b.width_px || a.height_px != b.height_px) {
    throw InputError(fmt::format("{} is {} × {} px, but {} is {} × {} px; compare cameras of one image size", args.a,
                                 a.width_px, a.height_px, args.b, b.width_px, b.height_px));
  }
  run.document.counts.given = run.document.counts.used = 2;
  const std::optional<CameraDiff> diff = diff_cameras(a, b, {.distance_m = args.distance_m});
  run.lap("compare");
  if (!diff) {
    return run.finish({State::refused,
                       ExitCode::undetermined,
                       "the two cameras see nothing in common",
                       "check that both are of the same lens",
                       {}});
  }
  fill_document(*diff, run.document);
  run.say(fmt::format("A {} ({}), B {} ({})", args.a, model_name(a.lens), args.b, model_name(b.lens)));
  say_parameters(*diff, run);
  return run.finish(verdict_of(*diff));
}

}  // namespace

void add_camera_diff(App& app) {
  auto args = std::make_shared<DiffArgs>();
  CLI::App& command = app.add_command(
      {.name = "camera diff",
       .summary = "Difference of two cameras over the image, after the best-fitting motion",
       .examples =
           "  alidade camera diff monday.yaml friday.yaml\n  alidade camera diff a.yaml b.cameramodel --distance 2"},
      [args](Run& run) { return compare(*args, run); });
  command.add_option("a", args->a, "Camera file")->required();
  command.add_option("b", args->b, "Camera file")->required();
  command
      .add_option(
          "--distance", args->distance_m,
          "Distance of the scene [m]: a rotation and a translation are removed; default: infinity, a rotation only")
      ->check(positive_number());
}

}  // namespace alidade::cli
