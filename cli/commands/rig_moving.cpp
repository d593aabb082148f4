#include "cli/commands/rig_moving.h"

#include <fmt/format.h>

#include <CLI/CLI.hpp>
#include <charconv>
#include <optional>

#include "alidade/formats/camera_file.h"
#include "alidade/formats/rig_file.h"
#include "alidade/geometry/degree.h"
#include "alidade/network/moving_target.h"
#include "alidade/results/moving_document.h"
#include "alidade/tables/events_file.h"
#include "cli/app/option_checks.h"

namespace alidade::cli {
namespace {

/// "1:2:12.5" or "1:2:12.5:0.05".
std::optional<KnownDistance> distance_from(const std::string& text) {
  std::vector<double> numbers;
  const char *at = text.data(), *end = at + text.size();
  while (at <= end) {
    double value = 0.0;
    const auto [next, error] = std::from_chars(at, end, value);
    if (error != std::errc{} || (next != end && *next != ':')) return std::nullopt;
    numbers.push_back(value);
    at = next + 1;
  }
  if (numbers.size() < 3 || numbers.size() > 4 || !(numbers[2] > 0.0) || numbers[0] == numbers[1]) return std::nullopt;
  if (numbers.size() == 4 && !(numbers[3] > 0.0)) return std::nullopt;
  return KnownDistance{static_cast<int>(numbers[0]), static_cast<int>(numbers[1]), numbers[2],
                       numbers.size() == 4 ? numbers[3] : 0.0};
}

std::vector<RigHead> heads_of(const std::filesystem::path& events, const std::vector<std::filesystem::path>& cameras) {
  const std::vector<int> ids = heads_in_events(events);
  if (cameras.size() != 1 && cameras.size() != ids.size())
    throw InputError(fmt::format("{}: has {} heads ({}), but there are {} cameras; give one, or one for each head",
                                 events.string(), ids.size(), fmt::join(ids, ", "), cameras.size()));
  std::vector<RigHead> heads;
  for (std::size_t i = 0; i < ids.size(); ++i) {
    RigHead head;
    head.head.id = ids[i];
    head.camera = read_central_camera(cameras[cameras.size() == 1 ? 0 : i]);
    heads.push_back(std::move(head));
  }
  return heads;
}

void summarize(const MovingTargetReport& report, Run& run) {
  for (std::size_t h = 0; h < report.cameras.size(); ++h) {
    const PlacedCamera& camera = report.cameras[h];
    if (!camera.placed) {
      if (!camera.reason.empty()) run.say(fmt::format("head {}: not placed: {}", camera.id, camera.reason));
      continue;
    }
    if (report.status != MovingTargetReport::Status::placed) continue;
    const Eigen::Index at = num_head_params * static_cast<Eigen::Index>(h);
    const Eigen::Vector3d& place = report.rig.heads[h].head.world_from_base.translation;
    const HeadVector sigma = 3.0 * report.rig.cov.diagonal().segment<num_head_params>(at).cwiseMax(0.0).cwiseSqrt();
    run.say(
        fmt::format("head {}: at ({:.2f}, {:.2f}, {:.2f}) m ± {:.2g} m, ± {:.2g}°   (3σ), {} of {} sights, σ {:.2g} px",
                    camera.id, place.x(), place.y(), place.z(), sigma.head<3>().norm(),
                    sigma.segment<3>(3).norm() / degree, camera.num_used, camera.num_observations, camera.sigma_px));
    run.say(fmt::format("  its clock: time of the rig = {:.4f} s + {:.6f} · its own, ± {:.2g} s (3σ)",
                        camera.clock.offset_s, camera.clock.rate, 3.0 * camera.sigma_clock_s));
  }
  if (report.truth_covered > 0.0)
    run.say(fmt::format(
        "against the true path, after a similarity: median {:.3f} m, RMS {:.3f} m, over {:.0f} % of the path",
        report.truth_median_m, report.truth_rms_m, 100.0 * report.truth_covered));
}

/// The placed heads alone, with their part of the covariance.
Rig placed_rig(const MovingTargetReport& report) {
  Rig rig;
  std::vector<Eigen::Index> from;
  for (std::size_t h = 0; h < report.cameras.size(); ++h) {
    if (!report.cameras[h].placed) continue;
    rig.heads.push_back(report.rig.heads[h]);
    for (Eigen::Index k = 0; k < num_head_params; ++k)
      from.push_back(num_head_params * static_cast<Eigen::Index>(h) + k);
  }
  rig.cov = report.rig.cov(from, from);
  return rig;
}

void add_files(std::span<const TargetObservation> observations, const MovingTargetReport& report, Run& run) {
  const Rig rig = placed_rig(report);
  std::vector<std::string> camera_files;
  for (const RigHead& rig_head : rig.heads) {
    camera_files.push_back(fmt::format("camera_{}.yaml", rig_head.head.id));
    run.add_file(camera_files.back(), camera_text(rig_head.camera, CameraFormat::alidade));
  }
  run.add_file("rig.yaml", rig_text(rig, camera_files));
  run.add_file("events.csv", events_csv(observations_on_one_clock(observations, report), report.rig.heads));
  run.add_file("path.csv", moving_path_csv(report));
}

}  // namespace

void add_moving_target_options(CLI::App& command, MovingTargetArgs& args) {
  const std::string group = "Cameras that do not turn";
  CLI::Option* moving =
      command
          .add_flag("--moving-target", args.is_asked,
                    "The table has sights of one target that moves, t_capture_s,head,u_px,v_px, by cameras that do not "
                    "turn: their places, attitudes and clocks; no board")
          ->group(group);
  command.add_option("--clocks", args.clocks_s, "Each camera has its own clock, up to so far from another's [s]")
      ->type_name("SECONDS")
      ->check(positive_number() & CLI::Range(0.0, 3600.0))
      ->needs(moving)
      ->group(group);
  command
      .add_option("--distance", args.distance, "How far two heads' cameras are apart [m], and its σ: 1:2:12.5[:0.05]")
      ->type_name("HEAD:HEAD:M[:M]")
      ->check([](const std::string& text) -> std::string {
        return distance_from(text) ? "" : "'" + text + "' is not HEAD:HEAD:METRES[:SIGMA], for example 1:2:12.5";
      })
      ->needs(moving)
      ->group(group);
  command
      .add_option("--truth", args.truth,
                  "The target's path by other means (GNSS), CSV: t_s,x_m,y_m,z_m: gives scale, frame and clock")
      ->type_name("FILE")
      ->needs(moving)
      ->group(group);
}

ExitCode rig_by_moving_target(const std::filesystem::path& events, const std::vector<std::filesystem::path>& cameras,
                              const MovingTargetArgs& args, double sigma_px, bool skip_bad, Run& run) {
  MovingTargetConfig config;
  config.clock_search_s = args.clocks_s;
  if (!args.distance.empty()) config.distance = distance_from(args.distance);
  if (!args.distance.empty() && !args.truth.empty()) throw UsageError("--distance: --truth gives the scale already");
  if (sigma_px > 0.0) config.sigma_px = sigma_px;
  run.add_input("events", events);
  for (const std::filesystem::path& camera : cameras) run.add_input("camera", camera);
  const std::vector<RigHead> heads = heads_of(events, cameras);
  if (config.distance) {
    for (const int id : {config.distance->first, config.distance->second})
      if (std::ranges::none_of(heads, [id](const RigHead& head) { return head.head.id == id; }))
        throw UsageError(fmt::format("--distance: {} is not a head of the table", id));
  }
  const EventsFile read = read_events(events, heads, {.skip_bad = skip_bad, .stands_still = true});
  run.document.counts.skipped = read.skipped;
  run.document.counts.given = read.skipped.size();
  TrueTrack truth;
  if (!args.truth.empty()) {
    run.add_input("truth", args.truth);
    truth = read_true_track(args.truth);
  }
  run.lap("read");
  const MovingTargetReport report = place_cameras(read.observations, heads, config, truth, run.progress);
  run.lap("solve");
  const Verdict verdict = moving_target_verdict(report, config);
  summarize(report, run);
  fill_moving_target(read.observations, report, run.document);
  if (has_estimate(verdict)) add_files(read.observations, report, run);
  return run.finish(verdict);
}

}  // namespace alidade::cli
