#include "alidade/calibrate.h"

#include <fmt/format.h>

#include <CLI/CLI.hpp>
#include <algorithm>
#include <cmath>
#include <memory>

#include "alidade/board/board_fields.h"
#include "alidade/calibrate/setup.h"
#include "alidade/formats/camera_file.h"
#include "alidade/results/calibration_outcome.h"
#include "alidade/tables/corner_file.h"
#include "cli/app/app.h"
#include "cli/app/board_options.h"
#include "cli/app/photo_options.h"
#include "cli/commands/calibrate_live.h"
#include "cli/commands/commands.h"

namespace alidade::cli {
namespace {

struct CalibrateArgs {
  std::vector<std::filesystem::path> photos;
  Board board = no_board();
  CalibrateConfig config;
  std::string corners, air;  // files
  std::string points;        // of the board: a file
  ImageSize size;            // 0x0: not given
  bool skip_bad = false;
  CaptureArgs capture;
};

/// A shape's word, or a file of points: "points.csv" was an attempt at a file, and is not found in reading.
TextCode shape_code(CalibrateArgs& args) {
  TextCode word = words_code(args.config.board_shape, shape_words());
  TextCode code = word;
  code.read = [&args, word](const std::string& text) -> std::string {
    args.points.clear();
    if (word.read(text).empty()) return "";
    std::error_code ignored;
    if (!text.ends_with(".csv") && !std::filesystem::exists(text, ignored)) {
      return fmt::format("'{}' is not flat, bow, free or auto, nor a file of points that is there", text);
    }
    args.points = text;
    args.config.board_shape = BoardShape::given;
    return "";
  };
  return code;
}

FieldList fields_of(CalibrateArgs& args) {
  FieldList fields = alidade::fields_of(args.board);
  const FieldList inputs = {
      {.name = "corners",
       .value = &args.corners,
       .help = "Corners instead of photos: CSV photo,corner,u_px,v_px[,sigma_u_px,sigma_v_px]",
       .form = "FILE"},
      {.name = "skip_bad", .value = &args.skip_bad, .help = "Skip invalid rows of --corners, naming each"},
      {.name = "size",
       .value = pair_code(args.size.width_px, args.size.height_px, 200000, "WIDTHxHEIGHT, for example 640x480"),
       .help = "Image size for --corners (default: smallest that contains the corners)",
       .form = "WIDTHxHEIGHT"},
      {.name = "air",
       .value = &args.air,
       .help = "flat_port: camera file of the lens calibrated in air, fixed; without it the lens is estimated as well, "
               "if the photos determine it",
       .form = "FILE"}};
  fields.insert(fields.end(), inputs.begin(), inputs.end());
  for (Field& field : alidade::fields_of(args.config)) {
    if (field.name == "board_shape") {
      field.value = shape_code(args);
      field.help += ", or a board_points.csv of an earlier run, fixed";
    }
    fields.push_back(std::move(field));
  }
  for (Field& field : fields_of(args.capture)) fields.push_back(std::move(field));
  return fields;
}

/// Reads the files that the config takes values from.
void read_values(CalibrateArgs& args, Run& run) {
  if (!args.air.empty()) {
    run.add_input("air", args.air);
    args.config.port.air = read_central_camera(args.air);
  }
  if (!args.points.empty()) {
    run.add_input("board_points", args.points);
    args.config.board_points = read_board_points(args.points, num_points(args.board));
  }
}

/// Photos have their size; one that is given besides, and that of a fixed lens, must be the same.
void require_size(const CalibrateArgs& args, const ImageSize& size) {
  const auto differs = [&](int width_px, int height_px) {
    return width_px != size.width_px || height_px != size.height_px;
  };
  if (args.size.width_px > 0 && differs(args.size.width_px, args.size.height_px)) {
    throw InputError(fmt::format("the photos are {}x{}, not {}x{} as --size says", size.width_px, size.height_px,
                                 args.size.width_px, args.size.height_px));
  }
  const std::optional<Camera>& air = args.config.port.air;
  if (air && differs(air->width_px, air->height_px)) {
    throw InputError(fmt::format("{}: is of {}x{} px, but the photos are {}x{}", args.air, air->width_px,
                                 air->height_px, size.width_px, size.height_px));
  }
}

ExitCode calibrate_corners(const CalibrateArgs& args, Run& run) {
  std::vector<SkippedInput>& skipped = run.document.counts.skipped;
  run.add_input("corners", args.corners);
  std::vector<BoardView> views = read_corners(args.corners, num_points(args.board), args.skip_bad ? &skipped : nullptr);
  if (views.empty() && skipped.empty()) throw InputError(args.corners + ": has no corners");
  ImageSize size = args.size;
  if (size.width_px == 0 && args.config.port.air) {
    size = {args.config.port.air->width_px, args.config.port.air->height_px};
  } else if (size.width_px == 0) {
    size = min_size(views);
    run.say(fmt::format("image size {}x{} is the least that holds the corners: give --size WIDTHxHEIGHT", size.width_px,
                        size.height_px));
  }
  if (const std::string fault = outside_fault(views, size); !fault.empty())
    throw InputError(args.corners + ": " + fault);
  const Calibration result = alidade::calibrate(std::move(views), size, args.board, args.config, run.progress);
  run.lap("solve");
  require_size(args, size);
  if (!skipped.empty()) {
    run.say(fmt::format("{} wrong row{} rejected, the first: {}:{}: {}", skipped.size(), skipped.size() > 1 ? "s" : "",
                        skipped.front().file, skipped.front().line, skipped.front().reason));
  }
  return run.finish(outcome_of(result));
}

/// Photos that a capture drew or decoded: what they are goes with the result.
void say_inexact(std::size_t num_inexact, std::size_t num_photos, Verdict& verdict) {
  if (num_inexact == 0) return;
  verdict.checks.push_back(
      {.name = "exact pixels",
       .text = fmt::format("{} of {} photos are as a canvas or a decoder gave them, not the camera's "
                           "own values: grey levels may be some off",
                           num_inexact, num_photos),
       .value = static_cast<double>(num_inexact)});
}

ExitCode calibrate_photos_of(const CalibrateArgs& args, Run& run, std::size_t num_inexact = 0) {
  const PhotoSet set(args.photos);
  const Photos photos = set.photos();
  const Calibration result = alidade::calibrate(photos, args.board, args.config, run.progress);
  run.lap("solve");
  require_readable(set, result);
  require_size(args, result.size);
  JobOutcome outcome = outcome_of(result);
  say_inexact(num_inexact, outcome.document.counts.given, outcome.document.verdict);
  if (!run.options.no_report) {
    add_images(result, photos, outcome);
    run.lap("pictures");
  }
  add_photos(set, outcome);
  return run.finish(std::move(outcome));
}

/// Photos that are taken while they are looked at; what they give is what they give afterwards.
ExitCode capture_and_calibrate(CalibrateArgs args, Run& run) {
  if (!args.corners.empty() || !args.photos.empty())
    throw UsageError(args.corners.empty() ? "--live takes the photos itself: give none"
                                          : "--live takes photos: not with --corners");
  read_values(args, run);
  args.capture.config.calibrate = args.config;
  return calibrate_live(args.board, args.capture, run,
                        [&](const std::filesystem::path& photos, std::size_t num_inexact) {
                          args.photos = {photos};
                          return calibrate_photos_of(args, run, num_inexact);
                        });
}

ExitCode run_calibrate(CalibrateArgs args, Run& run) {
  require_board(args.board);
  if (args.capture.live.is_on) return capture_and_calibrate(std::move(args), run);
  require_no_capture(args.capture);
  if (args.corners.empty() == args.photos.empty()) {
    throw UsageError(args.photos.empty() ? "give photos, or --corners FILE" : "--corners replaces photos");
  }
  read_values(args, run);
  return args.corners.empty() ? calibrate_photos_of(args, run) : calibrate_corners(args, run);
}

}  // namespace

void add_calibrate(App& app) {
  auto args = std::make_shared<CalibrateArgs>();
  CLI::App& command = app.add_command(
      {.name = "calibrate",
       .summary = "Intrinsics, distortion and their covariance from photos of a calibration board",
       .examples = "alidade calibrate photos/*.jpg --board 9x6 --square 0.025\n"
                   "alidade calibrate photos/ --board 9x6 --square 0.025 --board-shape free --fix k3\n"
                   "alidade calibrate photos/ --config calibrate.yaml\n"
                   "alidade calibrate --corners corners.csv --size 640x480 --board 9x6 --square 0.025\n"
                   "alidade calibrate water/*.png --board 9x6 --square 0.025 --model flat_port --air camera_air.yaml "
                   "--glass 0.01\n"
                   "alidade calibrate --live --board 9x6 --square 0.025 --until 0.2px --out mycamera\n",
       .writes_at_end = true},
      [args](Run& run) { return run_calibrate(*args, run); });
  add_photos(command, args->photos);
  add_capture_options(command, args->capture);
  app.add_fields(command, fields_of(*args));
}

}  // namespace alidade::cli
