#include "cli/app/app.h"
#include "cli/commands/commands.h"

namespace {

void add_commands(alidade::cli::App& app) {
  alidade::cli::add_calibrate(app);
  alidade::cli::add_camera(app);
  alidade::cli::add_corners(app);
  alidade::cli::add_identify(app);
  alidade::cli::add_localize(app);
  alidade::cli::add_observe(app);
  alidade::cli::add_plan(app);
  alidade::cli::add_project(app);
  alidade::cli::add_rangefinder(app);
  alidade::cli::add_reproduce(app);
  alidade::cli::add_rig(app);
  alidade::cli::add_schema(app);
  alidade::cli::add_servo(app);
  alidade::cli::add_simulate(app);
  alidade::cli::add_track(app);
  alidade::cli::add_view(app);
}

}  // namespace

int main(int argc, char** argv) { return alidade::cli::run_cli(argc, argv, add_commands); }
