#include <fmt/format.h>

#include <CLI/CLI.hpp>
#include <cstdlib>
#include <memory>

#include "alidade/heads/head_server.h"
#include "cli/app/app.h"
#include "cli/app/option_checks.h"
#include "cli/app/terminal.h"
#include "cli/commands/commands.h"

namespace alidade::cli {
namespace {

struct SimulateHeadArgs {
  int rotctl_port = -1, stream_port = -1, onvif_port = -1;
  std::string head, camera, truth, user, address = "127.0.0.1";
  double watchdog_s = 0.5, seconds = 1e9;
};

ExitCode simulate_head(const SimulateHeadArgs& args, Run& run) {
  if (args.rotctl_port < 0 && args.stream_port < 0 && args.onvif_port < 0)
    throw UsageError("give --rotctl PORT, --onvif PORT, --stream PORT or more of them");
  HeadServerConfig config;
  config.head = simulated_head_config(args.head, "--head");
  if (args.head.find("watchdog") == std::string::npos) config.head.watchdog_s = args.watchdog_s;
  config.camera = simulated_camera(args.camera, "--camera");
  config.address = args.address;
  config.rotctl_port = args.rotctl_port;
  config.stream_port = args.stream_port;
  config.onvif_port = args.onvif_port;
  config.user = args.user;
  if (const char* given = std::getenv("ALIDADE_PASSWORD"); given != nullptr) config.password = given;
  if (!args.user.empty() && config.password.empty())
    throw UsageError("--user has a password: give it in the environment, ALIDADE_PASSWORD");
  config.truth_csv = args.truth;
  const HeadServer server(config);
  if (args.rotctl_port >= 0) tell_person(fmt::format("head   rotctl://{}:{}", args.address, server.rotctl_port()));
  if (args.onvif_port >= 0) tell_person(fmt::format("onvif  onvif://{}:{}", args.address, server.onvif_port()));
  if (args.stream_port >= 0)
    tell_person(fmt::format("stream http://{}:{}/stream.mjpg", args.address, server.stream_port()));
  const std::shared_ptr<HeadClock> clock = machine_clock();
  for (const double until = clock->now_s() + args.seconds; clock->now_s() < until;) {
    if (!args.truth.empty() && run.progress && !run.progress("serving: frames", server.num_frames(), 0))
      throw Interrupted(fmt::format("ended after {} frames; {} has their truth", server.num_frames(), args.truth));
    report_progress(run.progress, "serving: frames", server.num_frames(), 0);
    clock->wait_until(clock->now_s() + 0.05);
  }
  run.document.counts.given = run.document.counts.used = server.num_frames();
  Verdict verdict;
  verdict.sentence = fmt::format("served {} frames", server.num_frames());
  return run.finish(verdict);
}

}  // namespace

void add_head_scenario(App& app) {
  auto args = std::make_shared<SimulateHeadArgs>();
  CLI::App& command = app.add_command(
      {"simulate head", "Pan-tilt head and its camera as servers: rotctl, ONVIF, and motion JPEG over HTTP",
       "  alidade simulate head --rotctl 4533 --stream 8090 --truth truth.csv\n"
       "  alidade simulate head --rotctl 4533 --stream 8090 --head 'rate=40&backlash=0.1' --camera "
       "'size=640x480&mount=1:-2:3&delay=0.04'\n",
       false, false},
      [args](Run& run) { return simulate_head(*args, run); });
  command.add_option("--rotctl", args->rotctl_port, "Port of the head as Hamlib's rotctld; 0: any free port")
      ->check(CLI::Range(0, 65535));
  command.add_option("--onvif", args->onvif_port, "Port of the head as a network camera; 0: any free port")
      ->check(CLI::Range(0, 65535));
  command.add_option("--user", args->user, "The only user accepted by ONVIF; password in ALIDADE_PASSWORD");
  command.add_option("--stream", args->stream_port, "Port of its camera (motion JPEG); 0: any free port")
      ->check(CLI::Range(0, 65535));
  command.add_option("--address", args->address, "Address to listen on")->capture_default_str();
  command.add_option("--head", args->head,
                     "Parameters of the head, KEY=VALUE&…: seed, rate, accel, tau, latency, backlash, dead_band, step, "
                     "update_hz, zoom, lie, …");
  command.add_option("--camera", args->camera,
                     "Parameters of the camera, KEY=VALUE&…: size, fx, fy, cx, cy, k1, mount (x:y:z, degrees), fps, "
                     "delay, noise, jump, target, board (columns:rows:square:distance:pan:tilt, m and degrees), seed");
  command.add_option("--truth", args->truth, "File to write each frame's time and true angles to, CSV")
      ->type_name("FILE");
  command.add_option("--watchdog", args->watchdog_s, "The head stops after this time without a command [s]; 0: never")
      ->check(number_within(0.0, 3600.0))
      ->capture_default_str();
  command.add_option("--seconds", args->seconds, "Exit after this time [s] (default: at Ctrl-C)")
      ->check(number_within(0.0, 1e9));
}

}  // namespace alidade::cli
