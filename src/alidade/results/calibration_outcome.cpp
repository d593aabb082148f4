#include "alidade/results/calibration_outcome.h"

#include <fmt/format.h>
#include <tbb/parallel_for.h>

#include <algorithm>
#include <cmath>
#include <opencv2/core.hpp>
#include <opencv2/imgproc.hpp>

#include "alidade/calibrate/solve/port.h"
#include "alidade/camera/undistort.h"
#include "alidade/formats/camera_file.h"
#include "alidade/images/photos.h"
#include "alidade/results/documents/calibration_document.h"
#include "alidade/tables/corner_file.h"

namespace alidade {
namespace {

/// "532.8 ± 1.3": both to two digits of the 3σ.
std::string value_and_3sigma(double value, double sigma) {
  const double bound = 3.0 * sigma;
  if (!(bound > 0.0)) return fmt::format("{:.6g} (fixed)", value);
  const int decimals = std::clamp(1 - static_cast<int>(std::floor(std::log10(bound))), 0, 9);
  return fmt::format("{:.{}f} ± {:.{}f}", value, decimals, bound, decimals);
}

std::vector<std::size_t> worst_first(const CalibrateReport& report) {
  std::vector<std::size_t> order;
  for (std::size_t k = 0; k < report.views.size(); ++k) order.push_back(k);
  std::stable_sort(order.begin(), order.end(), [&](std::size_t a, std::size_t b) {
    return report.views[a].used > report.views[b].used ||
           (report.views[a].used == report.views[b].used && report.views[a].rms_px > report.views[b].rms_px);
  });
  return order;
}

constexpr std::size_t num_large = 20;  // the worst photos, whose corners people look at

int preview_width_px(std::size_t num_photos) { return num_photos <= 40 ? 640 : num_photos <= 200 ? 320 : 160; }

/// The photos that the page shows, the most wanted first: the worst, and of a large set a sample of the others.
std::vector<std::size_t> shown_photos(const CalibrateReport& report) {
  constexpr std::size_t most = 1000;
  const std::vector<std::size_t> order = worst_first(report);
  const std::size_t num_worst = std::min(num_large, order.size()), rest = order.size() - num_worst;
  std::vector<std::size_t> shown(order.begin(), order.begin() + static_cast<std::ptrdiff_t>(num_worst));
  const std::size_t sample = std::min(most - num_large, rest);
  for (std::size_t i = 0; i < sample; ++i) shown.push_back(order[num_worst + i * rest / sample]);
  return shown;
}

/// The worst photo without its distortion, as the report shows it beside the original.
std::string undistorted_preview(const Camera& camera, const cv::Mat& photo) {
  PixelMap map = undistortion_map(camera, undistorted_camera(camera));
  const cv::Mat u_px(map.height_px, map.width_px, CV_32F, map.u_px.data());
  const cv::Mat v_px(map.height_px, map.width_px, CV_32F, map.v_px.data());
  cv::Mat straight;
  cv::remap(photo, straight, u_px, v_px, cv::INTER_LINEAR);
  return jpeg_preview(straight, 640, 75);
}

/// Empty where it fails: an image of the report never fails the run, and what is no image is named as such already.
template <typename Make>
std::string image_or_none(const Make& make) {
  try {
    return make();
  } catch (const std::exception&) {
    return "";
  }
}

/// The corners that no noise explains, each with its photo.
std::vector<std::string> rejected_corners(const Calibration& calibration) {
  std::vector<std::string> rejected;
  for (std::size_t k = 0; k < calibration.board_views.size(); ++k) {
    const BoardView& view = calibration.board_views[k];
    for (std::size_t i = 0; calibration.views[k].used && i < view.corners.size(); ++i) {
      const CornerResidual& fit = calibration.views[k].corners[i];
      if (fit.used) continue;
      const std::string what = fit.residual_px.allFinite() ? fmt::format("is {:.2f} px off", fit.residual_px.norm())
                                                           : "lies where this lens sees nothing";
      rejected.push_back(fmt::format("{}: corner {} {}", view.photo, view.corners[i].index, what));
    }
  }
  return rejected;
}

void summarize(const Calibration& calibration, std::vector<std::string>& lines) {
  const std::vector<BoardView>& views = calibration.board_views;
  const CalibrateReport& report = calibration;
  std::vector<std::string> not_used;
  for (std::size_t k = 0; k < views.size(); ++k) {
    if (!report.views[k].used) not_used.push_back(views[k].photo + ": " + report.views[k].reason);
  }
  add_each("not used", not_used, lines);
  if (report.status != CalibrateReport::Status::converged) return;
  add_each("rejected", rejected_corners(calibration), lines);
  const auto names = param_names(report.camera.lens);
  const Eigen::VectorXd values = params(report.camera.lens);
  for (std::size_t i = 0; i < names.size(); ++i) {
    const auto at = static_cast<Eigen::Index>(i);
    const double sigma = std::sqrt(report.camera.cov(at, at));
    if (names[i] == "skew" && sigma == 0.0 && values[at] == 0.0) continue;
    const char* unit = i < 5 ? " px" : names[i].ends_with("_m") ? " m" : "";
    lines.push_back(fmt::format("{:5} {}{}", names[i], value_and_3sigma(values[at], sigma), unit));
  }
  const auto used =
      std::count_if(report.views.begin(), report.views.end(), [](const ViewFit& fit) { return fit.used; });
  lines.push_back(fmt::format("{} of {} photos, {} corners ({} rejected), RMS {:.4f} px, board {}", used, views.size(),
                              report.corners_used, report.corners_dropped, report.rms_px,
                              shape_name(calibration.config.board_shape)));
  const BoardShape asked = calibration.asked_shape;
  if ((asked == BoardShape::bow || asked == BoardShape::free) && asked != calibration.config.board_shape) {
    lines.push_back(fmt::format("--board-shape {} was not used: it does not help on unseen photos", shape_name(asked)));
  }
  if (calibration.port) lines.push_back(port_sentence(*calibration.port));
}

void add_result_files(const Calibration& calibration, std::vector<NamedBytes>& files) {
  const CalibrateReport& report = calibration;
  if (report.status != CalibrateReport::Status::converged) return;
  Camera camera = report.camera;
  camera.source = "alidade calibrate";
  std::vector<std::string> photos;
  std::vector<Rigid3> poses;
  for (std::size_t k = 0; k < report.views.size(); ++k) {
    if (!report.views[k].used) continue;
    photos.push_back(calibration.board_views[k].photo);
    poses.push_back(report.views[k].cam_from_board);
  }
  files.push_back({"camera.yaml", camera_text(camera, CameraFormat::alidade)});
  files.push_back({"corners.csv", corners_csv(calibration.board_views)});
  files.push_back({"poses.csv", poses_csv(photos, poses)});
  files.push_back({"board_points.csv", board_points_csv(report.board_points)});
}

}  // namespace

JobOutcome outcome_of(const Calibration& calibration) {
  JobOutcome outcome;
  outcome.document.command = "calibrate";
  fill_calibration(calibration.board, calibration, outcome.document);
  outcome.document.verdict = calibration.verdict;
  summarize(calibration, outcome.lines);
  add_result_files(calibration, outcome.files);
  note_verdict({"camera.yaml"}, outcome);
  return outcome;
}

JobOutcome outcome_of(const FoundCorners& found) {
  JobOutcome outcome;
  ResultDocument whole;
  fill_calibration(found.calibration.board, found.calibration, whole);
  whole.data.resize(std::min<std::size_t>(2, whole.data.size()));  // photos and corners
  ResultDocument& document = outcome.document;
  document.counts = found.counts;
  document.data = std::move(whole.data);
  document.verdict = found.verdict;
  JsonValue photos = JsonValue::list();
  std::vector<std::string> rejected;
  for (const std::string& corner : found.rejected) rejected.push_back(corner + " fits no noise");
  add_each("rejected", rejected, outcome.lines);
  std::vector<std::string> no_corners;
  for (std::size_t k = 0; k < found.board_views.size(); ++k) {
    const BoardView& view = found.board_views[k];
    const std::string& reason = found.calibration.views[k].reason;
    JsonValue row;
    row["file"] = view.photo;
    row["corners"] = static_cast<int>(view.corners.size());
    row["reason"] = view.corners.empty() ? reason : "";
    photos.push_back(std::move(row));
    if (view.corners.empty()) no_corners.push_back(view.photo + ": " + reason);
  }
  add_each("no corners", no_corners, outcome.lines);
  document.estimate["corners"] = static_cast<int>(found.num_corners);
  document.estimate["corners_left_out"] = static_cast<int>(found.num_rejected);
  document.estimate["sigma_px"] = found.sigma_px;
  document.estimate["excess_px"] = found.excess_px;
  document.estimate["covariance"] = found.has_excess ? "corner and residuals" : "corner";
  document.estimate["model"] = found.has_excess ? found.calibration.config.model : "";
  document.estimate["photos"] = std::move(photos);
  if (found.num_corners == 0) return outcome;
  outcome.files.push_back({"corners.csv", corners_csv(found.board_views)});
  outcome.lines.push_back(fmt::format("the table has no image size: calibrate --corners takes --size {}x{} with it",
                                      found.size.width_px, found.size.height_px));
  return outcome;
}

void add_photos(const PhotoSet& set, JobOutcome& outcome) {
  ResultDocument& document = outcome.document;
  const std::vector<InputFile> inputs = set.inputs();
  document.inputs.insert(document.inputs.end(), inputs.begin(), inputs.end());
  document.counts.skipped.insert(document.counts.skipped.end(), set.skipped().begin(), set.skipped().end());
  std::vector<std::string> lines;
  if (const std::string line = set.skipped_line(); !line.empty()) lines.push_back(line);
  if (const auto turned = set.turned()) {
    lines.push_back(turned->text);
    document.verdict.checks.push_back(*turned);
  }
  outcome.lines.insert(outcome.lines.begin(), lines.begin(), lines.end());
}

void add_images(const Calibration& calibration, const Photos& photos, JobOutcome& outcome) {
  const CalibrateReport& report = calibration;
  const std::vector<BoardView>& views = calibration.board_views;
  const std::vector<std::size_t> chosen = shown_photos(report);
  if (chosen.empty()) return;
  const int width_px = preview_width_px(chosen.size());
  std::vector<std::string> jpegs(chosen.size());
  tbb::parallel_for(std::size_t{0}, chosen.size(), [&](std::size_t i) {
    jpegs[i] = image_or_none([&] { return jpeg_preview(photos.load(chosen[i]), i < num_large ? 640 : width_px, 75); });
  });
  const std::string worst = views[chosen.front()].photo;
  if (report.status == CalibrateReport::Status::converged) {
    const std::string straight =
        image_or_none([&] { return undistorted_preview(report.camera, photos.load(chosen.front())); });
    if (!straight.empty()) outcome.images.push_back({"undistorted:" + worst, straight});
  }
  for (std::size_t i = 0; i < chosen.size(); ++i) {
    if (!jpegs[i].empty()) outcome.images.push_back({views[chosen[i]].photo, std::move(jpegs[i])});
  }
}

}  // namespace alidade
