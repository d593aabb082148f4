#include "cli/commands/commands.h"

namespace alidade::cli {

void add_commands(App& app) {
  add_batch(app);
  add_calibrate(app);
  add_camera(app);
  add_corners(app);
  add_fleet(app);
  add_head(app);
  add_identify(app);
  add_localize(app);
  add_observe(app);
  add_plan(app);
  add_project(app);
  add_rangefinder(app);
  add_reproduce(app);
  add_rig(app);
  add_schema(app);
  add_servo(app);
  add_simulate(app);
  add_study(app);
  add_track(app);
  add_view(app);
}

}  // namespace alidade::cli
