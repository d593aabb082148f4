#pragma once

#include <cstdint>
#include <functional>
#include <string>

#include "alidade/fleet/fleet_camera.h"
#include "alidade/simulate/fleet.h"
#include "cli/app/run.h"

namespace alidade::cli {

struct FleetBroker {
  std::string url = "nats://127.0.0.1:4222";
  std::string credentials, ca, certificate, key;
};

struct FleetWorkerOptions {
  FleetBroker broker;
  FleetConfig config;
};

struct FleetWatchOptions {
  FleetBroker broker;
  int port = 8766;
};

struct FleetSimulation {
  FleetBroker broker;
  FleetSceneConfig scene;
  std::uint64_t seed = 1;
  int cameras = 100, rows = 600;
  bool is_real_time = true;
};

/// What talks to the broker: `alidade-fleet`, which alone loads its library. In `alidade` these are empty, and the
/// command is handed over to that program.
struct FleetEngine {
  std::function<ExitCode(const FleetWorkerOptions&, Run&)> work = {};
  std::function<ExitCode(const FleetWatchOptions&, Run&)> watch = {};
  /// Publishes a simulated fleet.
  std::function<ExitCode(const FleetSimulation&, Run&)> publish = {};
};
[[nodiscard]] FleetEngine& fleet_engine();

}  // namespace alidade::cli
