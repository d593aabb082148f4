#include <fmt/format.h>

#include <CLI/CLI.hpp>
#include <algorithm>
#include <cmath>
#include <memory>

#include "alidade/calibrate/calibration.h"
#include "alidade/io/calibration_document.h"
#include "alidade/io/corner_file.h"
#include "cli/board_options.h"
#include "cli/commands.h"
#include "cli/frame.h"
#include "cli/photo_shelf.h"

namespace alidade::cli {
namespace {

struct CornersArgs {
  std::vector<std::filesystem::path> photos;
  BoardOptions board;
  std::string model = "brown";
  std::string outliers = "drop";
  bool csv = false;
};

/// The corners of all photos with the covariance to be stated.
struct StatedCorners {
  std::vector<BoardView> views;
  std::size_t corners = 0, photos = 0, left_out = 0;
  double sigma_px = 0.0;   ///< Of one coordinate, the middle one of all.
  double excess_px = 0.0;  ///< The part that is added to each corner's own.
  bool has_excess = false;
};

double median_of(std::vector<double> values) {
  if (values.empty()) return 0.0;
  const auto middle = values.begin() + static_cast<std::ptrdiff_t>(values.size() / 2);
  std::nth_element(values.begin(), middle, values.end());
  return *middle;
}

/// Whether a view's corners are the calibration's outliers, all of them: most of them fit no board.
bool is_misfit(const ViewFit& fit) { return !fit.used && fit.reason.ends_with("do not fit the other photos"); }

/// What is found, less the outliers; where there is a calibration, with what it finds in the residuals beyond the
/// corners' own covariances.
StatedCorners state_corners(const PhotoCalibration& photos, bool drop, Run& run) {
  StatedCorners stated;
  stated.has_excess = photos.report.status == CalibrateReport::Status::converged;
  stated.excess_px = stated.has_excess ? photos.report.excess_px : 0.0;
  const Eigen::Matrix2d excess = stated.excess_px * stated.excess_px * Eigen::Matrix2d::Identity();
  std::vector<double> sigmas;
  for (std::size_t k = 0; k < photos.views.size(); ++k) {
    const ViewFit& fit = photos.report.views[k];
    BoardView view{photos.views[k].photo, {}};
    for (std::size_t i = 0; i < photos.views[k].corners.size(); ++i) {
      Corner corner = photos.views[k].corners[i];
      if (drop && stated.has_excess && (is_misfit(fit) || (fit.used && !fit.corners[i].used))) {
        ++stated.left_out;
        if (fit.used) run.say(fmt::format("left out: {}: corner {} fits no noise", view.photo, corner.index));
        continue;
      }
      corner.cov += excess;
      sigmas.push_back(std::sqrt(0.5 * corner.cov.trace()));
      view.corners.push_back(corner);
    }
    stated.corners += view.corners.size();
    stated.photos += view.corners.empty() ? 0 : 1;
    stated.views.push_back(std::move(view));
  }
  stated.sigma_px = median_of(std::move(sigmas));
  return stated;
}

Verdict corners_verdict(const StatedCorners& stated, const Calibration& calibration) {
  const CalibrateReport& report = calibration.photos.report;
  Verdict verdict;
  if (stated.corners == 0) {
    const bool is_told = report.to_add.starts_with("use ");
    verdict.state = State::refused;
    verdict.exit_code = ExitCode::cannot_tell;
    verdict.sentence = is_told ? report.reason : "no photo shows the board";
    verdict.to_add = is_told ? report.to_add : "check --board and --target, and that the whole board is in the photos";
    return verdict;
  }
  const std::string found = fmt::format("{} corners in {} photo{}, σ {} px", stated.corners, stated.photos,
                                        stated.photos == 1 ? "" : "s", text_of(stated.sigma_px));
  if (!stated.has_excess) {
    verdict.state = State::care;
    verdict.sentence = found + ", each corner's own alone: " + report.reason;
    verdict.to_add = report.to_add;
    return verdict;
  }
  const bool lens_fits = calibration.verdict.state != State::bad;
  verdict.state = lens_fits ? State::good : State::care;
  verdict.sentence =
      found + fmt::format(", {} px of it found by calibration in the residuals", text_of(stated.excess_px));
  if (!lens_fits) {
    verdict.sentence += ", where that calibration is not to be trusted";
    verdict.to_add = calibration.verdict.to_add;
  }
  return verdict;
}

void fill_corners(const Board& board, const Calibration& calibration, const StatedCorners& stated,
                  ResultDocument& document) {
  ResultDocument whole;
  fill_calibration(board, calibration, whole);
  document.counts = whole.counts;
  document.counts.used = stated.photos;
  document.counts.dropped = document.counts.given - stated.photos;
  std::erase_if(document.counts.skipped, [&](const SkippedInput& skipped) {  // too few for a camera, but corners
    return std::any_of(stated.views.begin(), stated.views.end(),
                       [&](const BoardView& view) { return view.photo == skipped.file && !view.corners.empty(); });
  });
  whole.data.resize(std::min<std::size_t>(2, whole.data.size()));  // photos and corners
  document.data = std::move(whole.data);
  JsonValue photos = JsonValue::list();
  for (std::size_t k = 0; k < stated.views.size(); ++k) {
    JsonValue row;
    row["file"] = stated.views[k].photo;
    row["corners"] = static_cast<int>(stated.views[k].corners.size());
    row["reason"] = stated.views[k].corners.empty() ? calibration.photos.report.views[k].reason : "";
    photos.push_back(std::move(row));
  }
  document.estimate["corners"] = static_cast<int>(stated.corners);
  document.estimate["corners_left_out"] = static_cast<int>(stated.left_out);
  document.estimate["sigma_px"] = stated.sigma_px;
  document.estimate["excess_px"] = stated.excess_px;
  document.estimate["covariance"] = stated.has_excess ? "corner and residuals" : "corner";
  document.estimate["model"] = stated.has_excess ? calibration.config.model : "";
  document.estimate["photos"] = std::move(photos);
}

ExitCode find_corners_of(const CornersArgs& args, Run& run) {
  const Board board = board_from(args.board);
  CalibrateConfig config;
  config.model = args.model;
  config.board_shape = BoardShape::automatic;
  PhotoShelf shelf(args.photos, run);
  PhotoCalibration found = calibrate_shelf(shelf, board, config, {}, run);
  Calibration calibration = judge_calibration(board, std::move(found), config, {}, run.progress);
  run.lap("residuals");
  const StatedCorners stated = state_corners(calibration.photos, args.outliers == "drop", run);
  Verdict verdict = corners_verdict(stated, calibration);
  for (BoardView& view : calibration.photos.views) {
    for (Corner& corner : view.corners) corner.cov += stated.excess_px * stated.excess_px * Eigen::Matrix2d::Identity();
  }
  fill_corners(board, calibration, stated, run.document);
  shelf.tell_skipped();
  shelf.tell_turned(verdict);
  for (std::size_t k = 0; k < stated.views.size(); ++k) {
    const std::string& reason = calibration.photos.report.views[k].reason;
    if (stated.views[k].corners.empty()) run.say(fmt::format("no corners: {}: {}", stated.views[k].photo, reason));
  }
  if (stated.corners > 0) {
    const ImageSize& size = calibration.photos.size;
    run.add_file("corners.csv", corners_csv(stated.views));
    run.say(fmt::format("the table has no picture size: calibrate --corners takes --size {}x{} with it", size.width_px,
                        size.height_px));
  }
  return run.finish(std::move(verdict));
}

/// With --csv the table is all that stdout gets; the folder gets the rest as always.
ExitCode run_corners(const CornersArgs& args, Run& run) {
  if (args.csv && run.options.json) throw UsageError("--csv and --json both want stdout");
  if (args.csv) run.print_file("corners.csv");
  return find_corners_of(args, run);
}

}  // namespace

void add_corners(Frame& frame) {
  auto args = std::make_shared<CornersArgs>();
  CLI::App& command = frame.add_command(
      {.name = "corners",
       .summary = "The corners of a board in photos, each with its full covariance",
       .examples = "alidade corners photos/ --board 9x6 --square 0.025 --out corners\n"
                   "alidade corners photos/*.jpg --board 9x6 --square 0.025 --csv > corners.csv\n"
                   "alidade calibrate --corners corners/corners.csv --size 640x480 --board 9x6 --square 0.025\n"},
      [args](Run& run) { return run_corners(*args, run); });
  command.add_option("photos", args->photos, "Photos of the board, or folders of them (8- or 16-bit JPEG, PNG, TIFF)")
      ->required();
  add_board_options(command, args->board);
  command
      .add_option("--model", args->model,
                  "Lens of the calibration that tells what the residuals hold beyond the corners' own noise: pinhole, "
                  "brown or kannala_brandt")
      ->check(CLI::IsMember({"pinhole", "brown", "kannala_brandt"}))
      ->capture_default_str();
  command.add_option("--outliers", args->outliers, "drop: leave out corners that no noise explains, by name; keep")
      ->check(CLI::IsMember({"drop", "keep"}))
      ->capture_default_str();
  command.add_flag("--csv", args->csv, "Print corners.csv on stdout, and nothing else");
}

}  // namespace alidade::cli
