#include "cli/commands/camera.h"

#include <fmt/format.h>

#include <CLI/CLI.hpp>
#include <algorithm>
#include <cmath>

#include "alidade/camera/projection_sigma.h"
#include "alidade/camera/undistort.h"
#include "alidade/formats/camera_file.h"
#include "alidade/geometry/degree.h"
#include "cli/app/app.h"
#include "cli/commands/camera_values.h"
#include "cli/commands/commands.h"

namespace alidade::cli {
namespace {

/// How far off its axis the lens is valid [deg]; 90 or 180 where nothing limits it.
double limit_deg(const Camera& camera) {
  if (const auto* brown = std::get_if<Calibrated<Brown>>(&camera.lens)) {
    return std::atan(Brown::max_radius(brown->params)) / degree;
  }
  if (const auto* fisheye = std::get_if<Calibrated<KannalaBrandt>>(&camera.lens)) {
    return KannalaBrandt::max_angle(fisheye->params) / degree;
  }
  if (const auto* port = std::get_if<Calibrated<FlatPort>>(&camera.lens)) {  // of the axis of lens and port, in water
    const double in_air_rad = std::atan(Brown::max_radius(FlatPort::air_lens(port->params)));
    return std::asin(std::sin(in_air_rad) / port->params[13]) / degree;
  }
  return 90.0;
}

/// Share of the image's pixels that see something, on a grid of them.
double seeing_share(const Camera& camera) {
  const PixelGrid grid = make_grid(camera.width_px, camera.height_px, 60, 40);
  int seeing = 0;
  for (int row = 0; row < grid.rows; ++row) {
    for (int col = 0; col < grid.cols; ++col) seeing += unproject(camera, grid.px(col, row)).has_value();
  }
  return seeing / (60.0 * 40.0);
}

/// Median and worst 3σ over the image [px], at infinity.
struct SigmaSummary {
  double median_px = 0.0, worst_px = 0.0;
};

SigmaSummary three_sigma(const Camera& camera) {
  std::vector<double> values = projection_sigma(camera, 60, 40, std::numeric_limits<double>::infinity()).values;
  std::erase_if(values, [](double sigma_px) { return std::isnan(sigma_px); });
  if (values.empty()) return {std::nan(""), std::nan("")};
  std::sort(values.begin(), values.end());
  return {3.0 * values[values.size() / 2], 3.0 * values.back()};
}

std::string degrees_text(double rad) { return std::isnan(rad) ? "–" : fmt::format("{:.1f}°", rad / degree); }

struct ShowArgs {
  std::string file;
};

ExitCode show(const ShowArgs& args, Run& run) {
  const Camera camera = read_camera_input(run, args.file);
  const FieldOfView view = field_of_view(camera);
  const double share = seeing_share(camera);
  run.document.counts.given = run.document.counts.used = 1;
  JsonValue& estimate = run.document.estimate;
  estimate["camera"] = camera_values(camera);
  estimate["rms_px"] = camera.rms_px > 0.0 ? camera.rms_px : std::nan("");
  estimate["source"] = camera.source;
  estimate["horizontal_view_deg"] = view.horizontal_rad / degree;
  estimate["vertical_view_deg"] = view.vertical_rad / degree;
  estimate["diagonal_view_deg"] = view.diagonal_rad / degree;
  estimate["valid_off_axis_deg"] = limit_deg(camera);
  estimate["seeing_share"] = share;
  run.document.stddev["camera"] = camera_stddev(camera);

  run.say(fmt::format("{}, {} × {} px{}", model_name(camera.lens), camera.width_px, camera.height_px,
                      camera.source.empty() ? "" : " (" + camera.source + ")"));
  for (const std::string& line : camera_lines(camera)) run.say(line);
  run.say(fmt::format("view {} × {}, diagonal {}; valid to {:.1f}° off the axis", degrees_text(view.horizontal_rad),
                      degrees_text(view.vertical_rad), degrees_text(view.diagonal_rad), limit_deg(camera)));
  if (camera.rms_px > 0.0) run.say(fmt::format("RMS {:.3f} px per point", camera.rms_px));
  if (has_covariance(camera)) {
    const SigmaSummary sigma = three_sigma(camera);
    estimate["median_3sigma_px"] = sigma.median_px;
    estimate["worst_3sigma_px"] = sigma.worst_px;
    run.say(
        fmt::format("3σ of projection {:.2g} px (median), {:.2g} px (worst pixel)", sigma.median_px, sigma.worst_px));
  }
  Verdict verdict;
  verdict.sentence = "Every pixel sees something";
  if (share < 1.0) {
    verdict.state = State::care;
    verdict.sentence = fmt::format("{:.0f} % of the image sees nothing by this lens: its radial map folds inside",
                                   100.0 * (1.0 - share));
    verdict.to_add = "calibrate with boards that reach the corners, or use kannala_brandt for a wide lens";
  }
  return run.finish(verdict);
}

std::string misfit_text(const FittedLens& fitted) {
  if (!std::isfinite(fitted.max_px)) return "and do not see all of the image";
  return fmt::format("{:.2g} px off at worst over the image ({:.2g} px RMS)", fitted.max_px, fitted.rms_px);
}

struct ConvertArgs {
  std::string source, destination, format = "alidade";
  bool lossy = false;
};

ExitCode convert(const ConvertArgs& args, Run& run) {
  const CameraFormat format = camera_format(args.format);
  Camera camera = read_camera_input(run, args.source);
  const std::vector<std::string> unread = unread_parts(args.source);
  std::error_code ignored;
  if (std::filesystem::is_directory(args.destination, ignored)) {
    throw InputError(args.destination + ": is a folder; name the file to write");
  }
  if (std::filesystem::equivalent(args.source, args.destination, ignored)) {
    throw InputError(args.destination + ": is the source itself; give another DESTINATION");
  }
  if (camera.source.empty()) camera.source = "converted from " + std::filesystem::path(args.source).filename().string();
  std::string text;
  try {
    text = camera_text(camera, format, args.lossy);
  } catch (const InputError& error) {
    throw InputError(args.source + ": " + error.what());
  }
  run.add_file_elsewhere(args.destination, text);

  run.document.counts.given = run.document.counts.used = 1;
  run.document.estimate["camera"] = camera_values(camera);
  run.document.estimate["format"] = args.format;
  const std::vector<std::string> lens = lens_losses(camera, format);
  std::vector<std::string> other = other_losses(camera, format);
  std::erase(other, "where it came from");
  Verdict verdict;
  verdict.sentence = fmt::format("{} written as {}", args.destination, args.format);
  if (!lens.empty()) {
    const FittedLens fitted = fitted_lens(camera, format);
    verdict.state = State::care;
    verdict.sentence +=
        fmt::format(", without {}: the other terms are fitted anew, {}", fmt::join(lens, " and "), misfit_text(fitted));
    run.document.estimate["left_out_rms_px"] = fitted.rms_px;
    run.document.estimate["left_out_max_px"] = fitted.max_px;
  }
  if (!other.empty()) run.say(fmt::format("the format {} cannot hold {}", args.format, fmt::join(other, " and ")));
  if (!unread.empty()) run.say(fmt::format("not carried over from {}: {}", args.source, fmt::join(unread, " and ")));
  std::vector<std::string> all = lens;
  all.insert(all.end(), other.begin(), other.end());
  all.insert(all.end(), unread.begin(), unread.end());
  run.document.estimate["left_out"] = JsonValue(all);
  return run.finish(verdict);
}

void add_show(App& app) {
  auto args = std::make_shared<ShowArgs>();
  CLI::App& command =
      app.add_command({.name = "camera show",
                       .summary = "Parameters of a camera file, its field of view and valid range",
                       .examples = "  alidade camera show camera.yaml\n  alidade camera show camchain.yaml:cam1",
                       .leaves_results = false},
                      [args](Run& run) { return show(*args, run); });
  command
      .add_option("file", args->file,
                  "Camera file of alidade, OpenCV, ROS, Kalibr, mrcal, COLMAP, SceneLib, Civera's initialize_cam.m, "
                  "Heikkilä's toolbox or Bouguet's (Calib_Results.m); FILE:NAME selects one of several, FILE:fisheye "
                  "reads four coefficients as cv::fisheye")
      ->required();
}

void add_convert(App& app) {
  auto args = std::make_shared<ConvertArgs>();
  CLI::App& command =
      app.add_command({.name = "camera convert",
                       .summary = "Convert a camera file to another format",
                       .examples = "  alidade camera convert camera.yaml camera.cameramodel --to mrcal\n"
                                   "  alidade camera convert calibration.xml camera.yaml",
                       .leaves_results = false},
                      [args](Run& run) { return convert(*args, run); });
  command
      .add_option("source", args->source, "Camera file, format recognised by content; FILE:NAME selects one of several")
      ->required();
  command.add_option("destination", args->destination, "File to write, at exactly this path")->required();
  command.add_option("--to", args->format, "Format to write")
      ->check(CLI::IsMember({"alidade", "opencv", "ros", "kalibr", "mrcal", "colmap"}))
      ->capture_default_str();
  command.add_flag("--lossy", args->lossy,
                   "Write the nearest lens model if the format cannot represent this one exactly");
}

}  // namespace

/// `alidade camera show|convert|diff|undistort`
void add_camera(App& app) {
  app.add_group("camera", "Show, convert and compare camera files; undistort photos");
  add_show(app);
  add_convert(app);
  add_camera_diff(app);
  add_camera_undistort(app);
}

}  // namespace alidade::cli
