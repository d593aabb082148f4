#include "alidade/results/rangefinder_outcome.h"

#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <limits>
#include <opencv2/core.hpp>

#include "alidade/files/number_list.h"
#include "alidade/formats/beam_file.h"
#include "alidade/formats/camera_file.h"
#include "alidade/formats/camera_json.h"
#include "alidade/images/photos.h"
#include "alidade/results/documents/number_columns.h"
#include "alidade/results/documents/sigma_values.h"

namespace alidade {
namespace {

using Numbers = std::vector<double>;

DataTable shots_table(const RangefinderCalibration& report) {
  const std::vector<Shot>& shots = report.measured;
  std::vector<std::string> name, reason;
  std::vector<bool> used;
  NumberColumns columns{{"range_m", 6},
                        {"residual_range_m", 6},
                        {"sigma_residual_range_m", 6},
                        {"u_px", 5},
                        {"v_px", 5},
                        {"residual_u_px", 5},
                        {"residual_v_px", 5},
                        {"sigma_residual_u_px", 5},
                        {"sigma_residual_v_px", 5},
                        {"cov_residual_uv_px2", 5},
                        {"point_in_cam_x_m", 5},
                        {"point_in_cam_y_m", 5},
                        {"point_in_cam_z_m", 5},
                        {"cluster_z2", 5}};
  for (std::size_t i = 0; i < shots.size(); ++i) {
    const ShotFit& fit = report.shots[i];
    name.push_back(shots[i].name);
    used.push_back(fit.used);
    reason.push_back(fit.reason);
    columns.add({shots[i].range_m, fit.residual_range_m, fit.sigma_range_m});
    if (shots[i].spot)
      columns.add({shots[i].spot->px.x(), shots[i].spot->px.y()});
    else
      columns.add_missing(2);
    columns.add({fit.residual_px.x(), fit.residual_px.y()});
    if (shots[i].spot.has_value() && fit.cov_px(0, 0) > 0.0)
      columns.add({std::sqrt(fit.cov_px(0, 0)), std::sqrt(fit.cov_px(1, 1)), fit.cov_px(0, 1)});
    else
      columns.add_missing(3);
    columns.add(fit.point_in_cam);
    columns.add({fit.cluster_z2});
  }
  DataTable table{"shots", {{"name", name}, {"used", used}, {"reason", reason}}};
  columns.append_to(table);
  return table;
}

/// Planes of the boards, and where a board's pose is known its corner 0 and axes: enough to draw it.
DataTable planes_table(const RangefinderCalibration& report) {
  constexpr int digits = 8;
  std::vector<std::string> name;
  NumberColumns columns{{"nx", digits}, {"ny", digits}, {"nz", digits}, {"d_m", digits}};
  columns.with_pose("cam_from_board", digits);
  for (std::size_t i = 0; i < report.measured.size(); ++i) {
    const ShotFit& fit = report.shots[i];
    if (!fit.plane) continue;
    name.push_back(report.measured[i].name);
    columns.add(fit.plane->normal_in_cam);
    columns.add({fit.plane->d_m});
    columns.add_pose(fit.pose ? &fit.pose->cam_from_board : nullptr);
  }
  DataTable table{"planes", {{"name", name}}};
  columns.append_to(table);
  return table;
}

void add_counts(const std::vector<CountedSigma>& counted, ResultDocument& document) {
  if (counted.empty()) return;
  std::vector<int> num;
  std::vector<Numbers> column(4);
  for (const CountedSigma& c : counted) {
    num.push_back(c.num_shots);
    column[0].push_back(c.sigma_origin_m);
    column[1].push_back(c.sigma_direction_rad);
    column[2].push_back(c.bound_origin_m);
    column[3].push_back(c.bound_direction_rad);
  }
  document.data.push_back({"by_count",
                           {{"num_shots", num},
                            {"sigma_origin_m", column[0]},
                            {"sigma_direction_rad", column[1]},
                            {"bound_origin_m", column[2]},
                            {"bound_direction_rad", column[3]}}});
}

void add_left_out(const std::vector<LeftOutShot>& left_out, ResultDocument& document) {
  if (left_out.empty()) return;
  std::vector<std::size_t> shot;
  Numbers range, u, v;
  double squares_m2 = 0.0, squares_px2 = 0.0;
  int num_ranges = 0, num_spots = 0;
  for (const LeftOutShot& left : left_out) {
    shot.push_back(left.index);
    range.push_back(left.residual_range_m);
    u.push_back(left.residual_px.x());
    v.push_back(left.residual_px.y());
    if (std::isfinite(left.residual_range_m)) squares_m2 += left.residual_range_m * left.residual_range_m, ++num_ranges;
    if (left.residual_px.allFinite()) squares_px2 += left.residual_px.squaredNorm(), ++num_spots;
  }
  document.data.push_back({"left_out",
                           {{"shot", shot},
                            {"residual_range_m", rounded(range, 6)},
                            {"residual_u_px", rounded(u, 4)},
                            {"residual_v_px", rounded(v, 4)}}});
  JsonValue& rms = document.estimate["left_out"];
  rms["rms_range_m"] = num_ranges > 0 ? std::sqrt(squares_m2 / num_ranges) : missing_value;
  rms["rms_px"] = num_spots > 0 ? std::sqrt(squares_px2 / num_spots) : missing_value;
}

Numbers sorted_unique(Numbers values) {
  std::sort(values.begin(), values.end());
  values.erase(std::unique(values.begin(), values.end()), values.end());
  return values;
}

/// Distances by rows, tilts by columns; a pose that does not fit into the image is null.
void add_gains(const std::vector<ShotGain>& gains, ResultDocument& document) {
  if (gains.empty()) return;
  Numbers distances, tilts;
  for (const ShotGain& gain : gains) {
    distances.push_back(gain.distance_m);
    tilts.push_back(gain.tilt_rad);
  }
  distances = sorted_unique(std::move(distances));
  tilts = sorted_unique(std::move(tilts));
  DataGrid grid;
  grid.name = "next_shot";
  grid.cols = static_cast<int>(tilts.size());
  grid.rows = static_cast<int>(distances.size());
  Numbers distance, tilt, sigma(distances.size() * tilts.size(), missing_value);
  for (const double d : distances) {
    for (const double angle : tilts) {
      distance.push_back(d);
      tilt.push_back(angle);
    }
  }
  for (const ShotGain& gain : gains) {
    const auto row = std::lower_bound(distances.begin(), distances.end(), gain.distance_m) - distances.begin();
    const auto col = std::lower_bound(tilts.begin(), tilts.end(), gain.tilt_rad) - tilts.begin();
    sigma[static_cast<std::size_t>(row) * tilts.size() + static_cast<std::size_t>(col)] = gain.sigma_point_m;
  }
  grid.values = {{"distance_m", distance}, {"tilt_rad", tilt}, {"sigma_point_m", sigma}};
  document.grids.push_back(std::move(grid));
}

Numbers root_of_diagonal(const Eigen::MatrixXd& cov, Eigen::Index first, Eigen::Index count) {
  Numbers sigma;
  for (Eigen::Index i = first; i < first + count; ++i) sigma.push_back(std::sqrt(cov(i, i)));
  return sigma;
}

/// σ of the angles to the camera's axes, cos θ = A: dθ = −dA / sin θ.
std::array<double, 2> angle_sigmas(const Beam& beam, const Eigen::Matrix<double, 7, 7>& cov) {
  const Eigen::Vector2d theta = direction_angles_rad(beam);
  return {std::sqrt(cov(3, 3)) / std::sin(theta.x()), std::sqrt(cov(4, 4)) / std::sin(theta.y())};
}

void put_sigmas(const Beam& beam, JsonValue& stddev) {
  const Eigen::Matrix<double, 7, 7> cov = embedded_covariance(beam);
  const auto sigma_theta = angle_sigmas(beam, cov);
  stddev["origin_m"] = root_of_diagonal(cov, 0, 3);
  stddev["direction"] = root_of_diagonal(cov, 3, 3);
  stddev["theta_x_rad"] = sigma_theta[0];
  stddev["theta_y_rad"] = sigma_theta[1];
  stddev["scale"] = std::sqrt(cov(6, 6));
}

JsonValue sigma_of_shots(const RangefinderReport& report) {
  std::vector<std::pair<std::string, Eigen::Index>> given;
  for (std::size_t i = 0; i < beam_param_names.size(); ++i) {
    const auto k = static_cast<Eigen::Index>(i);
    if (report.cov_model(k, k) > 0.0 && k < report.clusters.inflation.size())
      given.emplace_back(beam_param_names[i], k);
  }
  return sigma_values(given, report.clusters);
}

void put_beam(const Beam& beam, JsonValue& estimate) {
  const Eigen::Vector2d theta = direction_angles_rad(beam);
  estimate["origin_m"] = list_of(beam.origin_in_cam);
  estimate["direction"] = list_of(beam.direction_in_cam);
  estimate["theta_x_rad"] = theta.x();
  estimate["theta_y_rad"] = theta.y();
}

void put_covariance(const std::vector<std::string>& names, const Eigen::MatrixXd& cov, ResultDocument& document) {
  document.covariance_names = names;
  for (Eigen::Index i = 0; i < cov.rows(); ++i)
    for (Eigen::Index j = i; j < cov.cols(); ++j) document.covariance_upper.push_back(cov(i, j));
}

void fill_beam(const RangefinderCalibration& report, ResultDocument& document) {
  const Beam& beam = report.beam;
  JsonValue& estimate = document.estimate;
  put_beam(beam, estimate);
  estimate["scale"] = beam.scale;
  estimate["rms_px"] = report.rms_px;
  estimate["rms_range_m"] = report.rms_range_m;
  put_sigmas(beam, document.stddev);
  Beam by_model = beam;
  by_model.cov = report.cov_model;
  put_sigmas(by_model, document.stddev_model);
  Beam at_bound = beam;
  at_bound.cov = report.bound.cov;
  const Eigen::Matrix<double, 7, 7> bound = embedded_covariance(at_bound);
  estimate["bound"]["origin_m"] = root_of_diagonal(bound, 0, 3);
  estimate["bound"]["direction"] = root_of_diagonal(bound, 3, 3);
  estimate["bound"]["scale"] = std::sqrt(bound(6, 6));
  put_covariance(report.parameter_names, report.covariance, document);
}

/// What the next shots are planned with: of a sheet that was told, what the shots leave open.
void put_sheet(const CountedSheet& sheet, JsonValue& estimate) {
  if (!(sheet.left_m > 0.0)) return;
  estimate["sheet"]["sigma_m"] = sheet.sigma_m;
  estimate["sheet"]["left_m"] = sheet.left_m;
  estimate["sheet"]["moves"] = Numbers(sheet.moves.begin(), sheet.moves.end());
}

void fill_geometry_and_noise(const RangefinderCalibration& result, JsonValue& estimate) {
  const BeamBound& bound = result.bound;
  estimate["spot_sigma_px"] = Numbers(bound.spot_sigma_px.begin(), bound.spot_sigma_px.end());
  estimate["spot_sigma_at_m"] = Numbers(bound_ranges_m.begin(), bound_ranges_m.end());
  estimate["condition"] = bound.condition;
  estimate["range_ratio"] = bound.range_ratio;
  estimate["normal_spread"] = bound.normal_spread;
  estimate["offset_m"] = bound.offset_m;
  if (result.status == RangefinderReport::Status::converged) estimate["sigma"] = sigma_of_shots(result);
  put_sheet(result.sheet, estimate);
  estimate["noise"]["sigma_spot_px"] = result.sigma_spot_px;
  estimate["noise"]["sigma_corner_px"] = result.sigma_corner_px;
  estimate["noise"]["sigma_range_m"] = result.beam.noise.sigma_m;
  estimate["noise"]["spot_from"] = result.spot_sigma_is_estimated ? "residuals" : "given";
  estimate["noise"]["range_from"] = result.range_sigma_is_estimated ? "residuals" : "given";
}

void fill_document(const RangefinderCalibration& result, ResultDocument& document) {
  document.command = "rangefinder";
  document.counts = result.counts;
  document.assumed = result.assumed;
  document.verdict = result.verdict;
  JsonValue& estimate = document.estimate;
  estimate["camera"] = camera_values(result.camera);  // that the beam belongs to
  RangefinderConfig config = result.config;
  for (const Field& field : fields_of(config))
    if (field.name == "method" || field.name == "refine") estimate[field.name] = value_text(field);
  if (result.status == RangefinderReport::Status::converged) fill_beam(result, document);
  fill_geometry_and_noise(result, estimate);
  if (const std::optional<Board>& board = result.config.board) {
    estimate["board"]["kind"] = kind_name(board->kind);
    estimate["board"]["cols"] = board->cols;
    estimate["board"]["rows"] = board->rows;
    estimate["board"]["square_m"] = board->square_m;
    estimate["board"]["marker_m"] = board->marker_m;
  }
  if (result.shots.size() == result.measured.size()) {
    document.data.push_back(shots_table(result));
    document.data.push_back(planes_table(result));
  }
  add_counts(result.by_count, document);
  add_left_out(result.left_out, document);
  add_gains(result.gains, document);
}

/// What the photos did not give, and which shots were not used.
std::vector<std::string> lines_of_shots(const RangefinderCalibration& result) {
  std::vector<std::string> no_boards;
  std::vector<std::string> no_spots;
  std::vector<std::string> not_used;
  for (std::size_t i = 0; i < result.measured.size(); ++i) {
    const Shot& shot = result.measured[i];
    if (!shot.no_board.empty()) no_boards.push_back(shot.photo + ": " + shot.no_board);
    if (i >= result.photos.size()) continue;
    const ShotPhoto& photo = result.photos[i];
    const std::string& no_spot = photo.false_spot.empty() ? photo.no_spot : photo.false_spot;
    if (!no_spot.empty()) no_spots.push_back(shot.photo + ": " + no_spot);
  }
  for (std::size_t i = 0; i < result.shots.size() && i < result.measured.size(); ++i) {
    const ShotFit& fit = result.shots[i];
    if (!fit.used && !fit.reason.empty()) not_used.push_back(result.measured[i].name + ": " + fit.reason);
  }
  std::vector<std::string> lines;
  add_each("no board", no_boards, lines);
  add_each("no spot", no_spots, lines);
  add_each("not used", not_used, lines);
  if (!result.repeated.empty())
    lines.push_back(fmt::format("averaged: {} of {} shots are of the placement of the shot before",
                                result.repeated.size(), result.counts.given));
  return lines;
}

void add_lines_of_beam(const RangefinderCalibration& result, std::vector<std::string>& lines) {
  const Beam& beam = result.beam;
  const auto sigma3 = [&](Eigen::Index i) { return 3.0 * std::sqrt(result.covariance(i, i)); };
  for (int i = 0; i < 3; ++i)
    lines.push_back(
        fmt::format("origin {}    {:9.2f} ± {:.2g} mm   (3σ)", "xyz"[i], 1e3 * beam.origin_in_cam[i], 1e3 * sigma3(i)));
  for (int i = 0; i < 3; ++i)
    lines.push_back(fmt::format("direction {} {:9.6f} ± {:.2g}", "xyz"[i], beam.direction_in_cam[i], sigma3(3 + i)));
  const bool has_scale = beam.cov(beam_scale_param, beam_scale_param) > 0.0;
  if (has_scale && result.config.scale_by_need)
    lines.emplace_back("the readings' scale is estimated, as it is not given (--sigma-scale)");
  if (has_scale) lines.push_back(fmt::format("scale       {:9.6f} ± {:.2g}", beam.scale, sigma3(6)));
  lines.push_back(fmt::format("{} of {} shots; σ of a range {:.2g} mm ({})", result.shots_used, result.measured.size(),
                              1e3 * beam.noise.sigma_m,
                              result.range_sigma_is_estimated ? "estimated from the residuals" : "as given"));
  const auto& spot_px = result.bound.spot_sigma_px;
  lines.push_back(fmt::format("where the spot is, 3σ: {:.2g} px at 0.5 m, {:.2g} at 1 m, {:.2g} at 2 m, {:.2g} at 4 m",
                              3.0 * spot_px[0], 3.0 * spot_px[1], 3.0 * spot_px[2], 3.0 * spot_px[3]));
}

void add_beam_files(const Beam& beam, const Camera& camera, JobOutcome& outcome) {
  if (!is_estimate(static_cast<int>(outcome.document.verdict.exit_code))) return;
  outcome.files.push_back({"rangefinder.yaml", beam_text(beam, camera, "camera.yaml")});
  outcome.files.push_back({"camera.yaml", camera_text(camera, CameraFormat::alidade)});
  note_verdict({"rangefinder.yaml"}, outcome);
}

}  // namespace

JobOutcome outcome_of(const RangefinderCalibration& calibration, const std::string& camera_file) {
  JobOutcome outcome;
  fill_document(calibration, outcome.document);
  outcome.lines = lines_of_shots(calibration);
  if (calibration.status == RangefinderReport::Status::converged) add_lines_of_beam(calibration, outcome.lines);
  Camera camera = calibration.camera;
  if (calibration.config.refine == Refine::all)
    camera.source = "alidade rangefinder" + (camera_file.empty() ? "" : ", refined from " + camera_file);
  add_beam_files(calibration.beam, camera, outcome);
  return outcome;
}

JobOutcome outcome_of(const EdgesCalibration& calibration) {
  JobOutcome outcome;
  ResultDocument& document = outcome.document;
  const Beam& beam = calibration.beam;
  document.command = "rangefinder";
  document.counts = calibration.counts;
  document.verdict = calibration.verdict;
  JsonValue& estimate = document.estimate;
  estimate["method"] = "edges";
  put_beam(beam, estimate);
  const Eigen::Matrix<double, 7, 7> cov = calibration.covariance;
  document.stddev["origin_m"] = root_of_diagonal(cov, 0, 3);
  document.stddev["direction"] = root_of_diagonal(cov, 3, 3);
  if (is_estimate(static_cast<int>(calibration.verdict.exit_code)))
    put_covariance(calibration.parameter_names, calibration.covariance, document);
  estimate["gain"] = calibration.gain;
  estimate["halves_differ_rad"] = calibration.halves_differ_rad;
  if (is_estimate(static_cast<int>(calibration.verdict.exit_code))) {
    const auto part = [&](int i) {
      return fmt::format("{:.5f} ± {:.2g}", beam.direction_in_cam[i], 3.0 * std::sqrt(cov(3 + i, 3 + i)));
    };
    outcome.lines.push_back(fmt::format("direction {}  {}  {} (3σ); the halves of the scan differ by {:.2g} mrad",
                                        part(0), part(1), part(2), 1e3 * calibration.halves_differ_rad));
  }
  add_beam_files(beam, calibration.camera, outcome);
  return outcome;
}

void add_images(const RangefinderCalibration& calibration, const PhotoByName& load_photo, JobOutcome& outcome) {
  constexpr std::size_t max_images = 40;  // of the page
  const std::size_t num = std::min(max_images, calibration.photos.size());
  for (std::size_t i = 0; i < num; ++i) {
    if (!calibration.photos[i].has_photo) continue;
    const Shot& shot = calibration.measured[i];
    outcome.images.push_back({shot.name, jpeg_preview(load_photo(shot.photo), 640, 75)});
  }
}

}  // namespace alidade
