#pragma once

namespace alidade::cli {

class App;

/// All of those below, or the one that the command line starts with.
void add_commands(App& app);

void add_batch(App& app);
void add_calibrate(App& app);
void add_camera(App& app);
void add_corners(App& app);
void add_fleet(App& app);
void add_fleet_scenario(App& app);  ///< Of `simulate`.
void add_head(App& app);
void add_head_scenario(App& app);  ///< Of `simulate`.
void add_identify(App& app);
void add_localize(App& app);
void add_observe(App& app);
void add_plan(App& app);
void add_plan_observe(App& app);      ///< Of `plan`.
void add_plan_rangefinder(App& app);  ///< Of `plan`.
void add_project(App& app);
void add_rangefinder(App& app);
void add_reproduce(App& app);
void add_rig(App& app);
void add_rig_scenario(App& app);          ///< Of `simulate`.
void add_rangefinder_scenario(App& app);  ///< Of `simulate`.
void add_rotation_scenario(App& app);     ///< Of `simulate`.
void add_schema(App& app);
void add_servo(App& app);
void add_servo_scenario(App& app);  ///< Of `simulate`.
void add_simulate(App& app);
void add_study(App& app);
void add_track(App& app);
void add_track_scenario(App& app);       ///< Of `simulate`.
void add_underwater_scenario(App& app);  ///< Of `simulate`.
void add_view(App& app);

// How to write a command: cli/commands/NAME.cpp with one function `add_NAME(App&)`, declared here and called in
// commands.cpp.
//
//   ExitCode calibrate(const CalibrateArgs& args, Run& run) {
//     const std::string text = read_file(args.file);            // reading throws InputError → exit 3
//     run.add_input("photo", args.file, text);                  // names, sizes, checksums
//     const Report report = alidade::calibrate(…, run.progress);  // one library call; Progress brings Ctrl-C
//     run.lap("solve");                                         // seconds by name
//     run.document.counts = …;  run.document.estimate["camera"]["fx"] = …;  // also for a refusal
//     run.add_file("camera.yaml", …);                           // written at the end, all or none
//     run.say("fx 532.8 ± 1.3 px");                             // for a user; not with --json or --quiet
//     return run.finish(report.verdict);                        // writes DIR, prints, gives the exit code
//   }
//
//   void add_calibrate(App& app) {
//     auto args = std::make_shared<CalibrateArgs>();
//     CLI::App& command = app.add_command({"calibrate", "A camera from photos of a board", "alidade calibrate …"},
//                                           [args](Run& run) { return calibrate(*args, run); });
//     command.add_option("photos", args->photos, "Photos of the board")->required();
//   }
//
// Several files are compiled as one: names in unnamed namespaces differ between commands (CalibrateArgs, not Args).
//
// --out, --json, --quiet, --no-report, --threads (and --seed where chance is) are there already. A verdict with exit
// code cannot_tell or no_convergence becomes the line `alidade: error: calibrate: SENTENCE; TO_ADD`. Do not print, do
// not catch, do not use CLI::ExistingFile (a missing file is exit 3, not 2); numbers: see app/option_checks.h; wrong
// combinations of options: throw UsageError("--fix: 'k9' is not a parameter of brown"). nlohmann-json is at hand in the
// .cpp.

}  // namespace alidade::cli
