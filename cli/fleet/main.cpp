// alidade-fleet: what of `alidade fleet` and `alidade simulate fleet` talks to NATS. A program of its own, as the
// client's library costs every start.
#include "cli/app/app.h"
#include "cli/commands/commands.h"
#include "cli/commands/fleet_engine.h"
#include "cli/fleet/worker.h"

namespace {

void add_fleet_commands(alidade::cli::App& app) {
  app.add_group("simulate", "A fleet that is published");
  alidade::cli::add_fleet_scenario(app);
  alidade::cli::add_fleet(app);
}

}  // namespace

int main(int argc, char** argv) {
  alidade::cli::FleetEngine& engine = alidade::cli::fleet_engine();
  engine.work = alidade::fleet::run_worker;
  engine.watch = alidade::fleet::run_watch;
  engine.publish = alidade::fleet::run_publisher;
  return alidade::cli::run_cli(argc, argv, add_fleet_commands);
}
