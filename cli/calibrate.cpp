#include <fmt/format.h>

#include <CLI/CLI.hpp>
#include <algorithm>
#include <cmath>
#include <memory>

#include "alidade/calibrate/calibration.h"
#include "alidade/calibrate/setup.h"
#include "alidade/io/calibration_document.h"
#include "alidade/io/camera_file.h"
#include "alidade/io/corner_file.h"
#include "cli/board_options.h"
#include "cli/calibration_summary.h"
#include "cli/commands.h"
#include "cli/frame.h"
#include "cli/option_checks.h"
#include "cli/photo_shelf.h"

namespace alidade::cli {
namespace {

struct CalibrateArgs {
  std::vector<std::filesystem::path> photos;
  BoardOptions board;
  std::filesystem::path corners;
  std::string size;
  std::string board_shape = "auto";
  std::string outliers = "auto";
  std::vector<std::string> fixed;
  std::vector<std::string> free;
  std::vector<std::string> priors;
  CalibrateConfig config;
  std::filesystem::path air;
  PortKnowledge port;
  bool has_glass = false, skip_bad = false;
};

/// "fx=650±5" or "fx=650:5": name, value, σ.
Prior parse_prior(const std::string& text) {
  const auto equals = text.find('='), colon = text.find(':');
  const auto fail = [&] { return UsageError("--prior: '" + text + "' is not NAME=VALUE:SIGMA, for example fx=650:5"); };
  if (equals == std::string::npos || colon == std::string::npos || colon < equals) throw fail();
  const auto number = [&](const std::string& digits) {
    if (!finite_number()(digits).empty()) throw fail();
    return std::stod(digits);
  };
  return {text.substr(0, equals), number(text.substr(equals + 1, colon - equals - 1)), number(text.substr(colon + 1))};
}

ImageSize parse_size(const std::string& text) {
  ImageSize size;
  char rest = 0;
  const bool ok = std::sscanf(text.c_str(), "%dx%d%c", &size.width_px, &size.height_px, &rest) == 2;
  if (!ok || size.width_px < 1 || size.height_px < 1 || size.width_px > 200000 || size.height_px > 200000) {
    throw UsageError("--size: '" + text + "' is not WIDTHxHEIGHT, for example 640x480");
  }
  return size;
}

/// A word that is neither a shape nor a file was no attempt at a file; "points.csv" was, and is not found in reading.
void require_shape_file(const std::filesystem::path& shape) {
  std::error_code ignored;
  if (shape.extension() == ".csv" || std::filesystem::exists(shape, ignored)) return;
  throw UsageError(
      fmt::format("--board-shape is flat, bow, free, auto or a file of points; there is no file '{}'", shape.string()));
}

/// The config that the flags describe; throws UsageError with every fault of it.
CalibrateConfig config_from(const CalibrateArgs& args) {
  CalibrateConfig config = args.config;
  config.fixed = {"skew"};
  for (const std::string& name : args.fixed) {
    if (std::find(config.fixed.begin(), config.fixed.end(), name) == config.fixed.end()) config.fixed.push_back(name);
  }
  for (const std::string& text : args.priors) config.priors.push_back(parse_prior(text));
  if (config.model == FlatPort::name) config = with_port(std::move(config), args.port);
  for (const std::string& name : args.free) std::erase(config.fixed, name);
  if (args.board_shape == "bow") {
    config.board_shape = BoardShape::bow;
  } else if (args.board_shape == "free") {
    config.board_shape = BoardShape::free;
  } else if (args.board_shape == "auto") {
    config.board_shape = BoardShape::automatic;
  } else if (args.board_shape != "flat") {
    require_shape_file(args.board_shape);
    config.board_shape = BoardShape::given;
  }
  std::string sentence;
  for (const std::string& fault : faults(config)) sentence += (sentence.empty() ? "" : "; ") + fault;
  if (!sentence.empty()) throw UsageError(sentence);
  return config;
}

/// The lens in air of --air.
Camera read_air_lens(const std::filesystem::path& file) {
  Camera air = read_central_camera(file);
  if (!std::holds_alternative<Calibrated<Pinhole>>(air.lens) && !std::holds_alternative<Calibrated<Brown>>(air.lens)) {
    throw InputError(fmt::format("{}: model: a lens behind a port must be pinhole or brown, not {}", file.string(),
                                 model_name(air.lens)));
  }
  return air;
}

/// Reads what --model flat_port needs; refuses its options with another model.
void take_port(CalibrateArgs& args, Run& run) {
  if (args.config.model != FlatPort::name) {
    if (!args.air.empty() || args.has_glass) throw UsageError("--air and --glass are of --model flat_port");
    return;
  }
  if (!args.has_glass) throw UsageError("--model flat_port: give the port's thickness in metres, --glass 0.01");
  if (args.air.empty()) return;
  run.add_input("air", args.air);
  args.port.air = read_air_lens(args.air);
}

/// Photos have their size; one that is told besides must be the same.
void require_told_size(const CalibrateArgs& args, const ImageSize& size) {
  if (args.size.empty()) return;
  const ImageSize told = parse_size(args.size);
  if (told.width_px == size.width_px && told.height_px == size.height_px) return;
  throw InputError(
      fmt::format("the photos are {}x{}, not {} as --size says", size.width_px, size.height_px, args.size));
}

/// A lens held must be of these pictures.
void require_size_of_air(const CalibrateArgs& args, const ImageSize& size) {
  const std::optional<Camera>& air = args.port.air;
  if (!air || (air->width_px == size.width_px && air->height_px == size.height_px)) return;
  throw InputError(fmt::format("{}: is of {}x{} px, but the photos are {}x{}", args.air.string(), air->width_px,
                               air->height_px, size.width_px, size.height_px));
}

/// Size of the pictures where only corners are given: as asked, else the smallest that holds them all.
ImageSize size_of(const CalibrateArgs& args, const std::vector<BoardView>& views) {
  if (!args.size.empty()) return parse_size(args.size);
  if (args.port.air) return {args.port.air->width_px, args.port.air->height_px};
  double width = 1.0, height = 1.0;
  for (const BoardView& view : views) {
    for (const Corner& corner : view.corners) {
      width = std::max(width, corner.px.x());
      height = std::max(height, corner.px.y());
    }
  }
  return {static_cast<int>(std::ceil(std::min(width, 2e5))) + 1,
          static_cast<int>(std::ceil(std::min(height, 2e5))) + 1};
}

/// A size that does not hold the corners is of other pictures. A few outside may be wrong corners.
void require_corners_inside(const ImageSize& size, const CalibrateArgs& args, const std::vector<BoardView>& views) {
  std::size_t outside = 0, all = 0;
  for (const BoardView& view : views) {
    for (const Corner& corner : view.corners) {
      const bool is_inside =
          corner.px.minCoeff() > -1.0 && corner.px.x() < size.width_px && corner.px.y() < size.height_px;
      outside += is_inside ? 0 : 1;
      ++all;
    }
  }
  if (10 * outside <= all) return;
  throw InputError(fmt::format("{}: {} of {} corners lie outside a picture of {}x{} px: check --size",
                               args.corners.string(), outside, all, size.width_px, size.height_px));
}

PhotoCalibration from_corners(const CalibrateArgs& args, const Board& board, CalibrateConfig& config,
                              std::span<const Eigen::Vector3d> given, std::vector<SkippedInput>& skipped, Run& run) {
  PhotoCalibration result;
  run.add_input("corners", args.corners);
  result.views = read_corners(args.corners, num_points(board), args.skip_bad ? &skipped : nullptr);
  result.reasons.resize(result.views.size());
  result.size = size_of(args, result.views);
  require_corners_inside(result.size, args, result.views);
  if (args.size.empty() && !args.port.air) {
    run.say(fmt::format("picture size {}x{} is the least that holds the corners: give --size WIDTHxHEIGHT",
                        result.size.width_px, result.size.height_px));
  }
  const bool have_sigma = std::any_of(result.views.begin(), result.views.end(), [](const BoardView& view) {
    return std::any_of(view.corners.begin(), view.corners.end(),
                       [](const Corner& corner) { return corner.cov != Eigen::Matrix2d::Identity(); });
  });
  // Corners without σ are somebody's measurements to be judged as they are: the same corners, the same optimum.
  config.reject_outliers = args.outliers == "drop" || (args.outliers == "auto" && have_sigma);
  if (config.board_shape == BoardShape::automatic && !have_sigma) config.board_shape = BoardShape::flat;
  result.report = calibrate(board, result.views, result.size, config, given);
  run.lap("solve");
  return result;
}

ExitCode calibrate(CalibrateArgs args, Run& run) {
  take_port(args, run);
  const Board board = board_from(args.board);
  CalibrateConfig config = config_from(args);
  if (args.corners.empty() == args.photos.empty()) {
    throw UsageError(args.photos.empty() ? "give photos, or --corners FILE" : "--corners takes the place of photos");
  }
  std::vector<Eigen::Vector3d> given;
  if (config.board_shape == BoardShape::given) {
    run.add_input("board_points", args.board_shape);
    given = read_board_points(args.board_shape, num_points(board));
  }
  config.reject_outliers = args.outliers != "keep";
  PhotoShelf shelf(args.photos, run);
  std::vector<SkippedInput> skipped;
  PhotoCalibration solved = args.corners.empty() ? calibrate_shelf(shelf, board, config, given, run)
                                                 : from_corners(args, board, config, given, skipped, run);
  require_told_size(args, solved.size);
  require_size_of_air(args, solved.size);
  Calibration result = judge_calibration(board, std::move(solved), config, args.port.air, run.progress);
  run.lap("study");
  fill_calibration(board, result, run.document);
  // Rows of the table stand before photos: counts are of photos.
  run.document.counts.skipped.insert(run.document.counts.skipped.begin(), skipped.begin(), skipped.end());
  if (!skipped.empty()) {
    run.say(fmt::format("{} wrong row{} left out, the first: {}:{}: {}", skipped.size(), skipped.size() > 1 ? "s" : "",
                        skipped.front().file, skipped.front().line, skipped.front().reason));
  }
  shelf.tell_skipped();
  shelf.tell_turned(result.verdict);
  if (!run.options.no_report && args.corners.empty()) {
    add_pictures(result, shelf.loader(), run);
    run.lap("pictures");
  }
  summarize(result, run);
  add_result_files(result, run);
  return run.finish(result.verdict);
}

}  // namespace

void add_calibrate(Frame& frame) {
  auto args = std::make_shared<CalibrateArgs>();
  CLI::App& command = frame.add_command(
      {.name = "calibrate",
       .summary = "A camera with its distortion and covariance, from photos of a board",
       .examples = "alidade calibrate photos/*.jpg --board 9x6 --square 0.025\n"
                   "alidade calibrate photos/ --board 9x6 --square 0.025 --board-shape free --fix k3\n"
                   "alidade calibrate --corners corners.csv --size 640x480 --board 9x6 --square 0.025\n"
                   "alidade calibrate water/*.png --board 9x6 --square 0.025 --model flat_port --air camera_air.yaml "
                   "--glass 0.01\n"},
      [args](Run& run) { return calibrate(*args, run); });
  command.add_option("photos", args->photos, "Photos of the board, or folders of them (8- or 16-bit JPEG, PNG, TIFF)");
  add_board_options(command, args->board);
  command.add_option("--corners", args->corners,
                     "Corners instead of photos: CSV photo,corner,u_px,v_px[,sigma_u_px,sigma_v_px]");
  command.add_flag("--skip-bad", args->skip_bad, "Leave out rows of --corners that are wrong, by name");
  command.add_option("--size", args->size, "Picture size of --corners, WIDTHxHEIGHT (default: what holds the corners)");
  command.add_option("--model", args->config.model, "Lens: pinhole, brown, kannala_brandt or flat_port")
      ->capture_default_str();
  command
      .add_option("--fix", args->fixed,
                  "Parameters held at zero (cx, cy: the picture's centre; with --prior: its value), as k3,p1,p2")
      ->delimiter(',');
  command.add_option("--free", args->free, "Parameters estimated that are held otherwise: skew")->delimiter(',');
  command.add_option("--prior", args->priors, "What is known of a parameter, NAME=VALUE:SIGMA, as fx=650:5")
      ->delimiter(',');
  command.add_option("--air", args->air,
                     "flat_port: the lens' camera file from a calibration in air, held; without it the lens is "
                     "estimated as well, if the photos tell");
  const auto of_port = [&](const char* name, double& value, const char* help, double low, double high) {
    return command.add_option(name, value, help)->check(finite_number() & CLI::Range(low, high));
  };
  of_port("--gap", args->port.gap_m, "flat_port: air between lens and glass, a start [m]", 0.0, 10.0)
      ->capture_default_str();
  of_port("--glass", args->port.glass_m, "flat_port: thickness of the port, held [m]; must be given", 0.0, 10.0)
      ->each([args](const std::string&) { args->has_glass = true; });
  of_port("--n-glass", args->port.n_glass, "flat_port: refractive index of the port, held", 1.0, 4.0)
      ->capture_default_str();
  of_port("--n-water", args->port.n_water, "flat_port: of the water, held (fresh 1.333, sea 1.34)", 1.0, 4.0)
      ->capture_default_str();
  command
      .add_option("--board-shape", args->board_shape,
                  "flat, bow (2 parameters), free (every point), auto (bow or free if the photos prove it), or a "
                  "board_points.csv of an earlier run, held")
      ->capture_default_str();
  command
      .add_option("--outliers", args->outliers,
                  "drop: leave out corners that no noise explains, by name; keep; auto: drop, but keep corners given "
                  "without sigma")
      ->check(CLI::IsMember({"auto", "drop", "keep"}))
      ->capture_default_str();
}

}  // namespace alidade::cli
