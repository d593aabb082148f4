#pragma once

#include "cli/commands/fleet_engine.h"
#include "cli/fleet/broker.h"

namespace alidade::fleet {

[[nodiscard]] BrokerOptions broker_options(const cli::FleetBroker& broker);

/// Takes cameras' observations until it is asked to stop; then its state is stored, and its partitions are free.
[[nodiscard]] ExitCode run_worker(const cli::FleetWorkerOptions& options, cli::Run& run);
/// Serves the page of the fleet until it is asked to stop.
[[nodiscard]] ExitCode run_watch(const cli::FleetWatchOptions& options, cli::Run& run);
[[nodiscard]] ExitCode run_publisher(const cli::FleetSimulation& simulation, cli::Run& run);

}  // namespace alidade::fleet
