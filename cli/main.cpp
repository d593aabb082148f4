#include "cli/commands.h"
#include "cli/frame.h"

namespace {

void add_commands(alidade::cli::Frame& frame) {
  alidade::cli::add_calibrate(frame);
  alidade::cli::add_camera(frame);
  alidade::cli::add_corners(frame);
  alidade::cli::add_identify(frame);
  alidade::cli::add_localize(frame);
  alidade::cli::add_observe(frame);
  alidade::cli::add_plan(frame);
  alidade::cli::add_project(frame);
  alidade::cli::add_rangefinder(frame);
  alidade::cli::add_reproduce(frame);
  alidade::cli::add_rig(frame);
  alidade::cli::add_servo(frame);
  alidade::cli::add_simulate(frame);
  alidade::cli::add_track(frame);
  alidade::cli::add_view(frame);
}

}  // namespace

int main(int argc, char** argv) { return alidade::cli::run_cli(argc, argv, add_commands); }
