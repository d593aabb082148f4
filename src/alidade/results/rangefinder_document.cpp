#include "alidade/results/rangefinder_document.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <limits>
#include <nlohmann/json.hpp>

#include "alidade/files/number_list.h"
#include "alidade/formats/beam_file.h"
#include "alidade/formats/camera_file.h"
#include "alidade/results/sigma_values.h"

namespace alidade {
namespace {

using Json = nlohmann::json;
using Numbers = std::vector<double>;

std::string_view method_name(RangefinderMethod method) {
  return method == RangefinderMethod::spot ? "spot" : method == RangefinderMethod::plane ? "plane" : "joint";
}

DataTable shots_table(std::span<const Shot> shots, const RangefinderReport& report) {
  std::vector<std::string> name, reason;
  std::vector<bool> used;
  std::vector<Numbers> column(14);
  for (std::size_t i = 0; i < shots.size(); ++i) {
    const ShotFit& fit = report.shots[i];
    name.push_back(shots[i].name);
    used.push_back(fit.used);
    reason.push_back(fit.reason);
    const bool has_spot = shots[i].spot.has_value() && fit.cov_px(0, 0) > 0.0;
    const std::array<double, 14> values{shots[i].range_m,
                                        fit.residual_range_m,
                                        fit.sigma_range_m,
                                        shots[i].spot ? shots[i].spot->px.x() : missing_value,
                                        shots[i].spot ? shots[i].spot->px.y() : missing_value,
                                        fit.residual_px.x(),
                                        fit.residual_px.y(),
                                        has_spot ? std::sqrt(fit.cov_px(0, 0)) : missing_value,
                                        has_spot ? std::sqrt(fit.cov_px(1, 1)) : missing_value,
                                        has_spot ? fit.cov_px(0, 1) : missing_value,
                                        fit.point_in_cam.x(),
                                        fit.point_in_cam.y(),
                                        fit.point_in_cam.z(),
                                        fit.cluster_z2};
    for (std::size_t k = 0; k < values.size(); ++k) column[k].push_back(values[k]);
  }
  static const std::array<const char*, 14> names{"range_m",
                                                 "residual_range_m",
                                                 "sigma_residual_range_m",
                                                 "u_px",
                                                 "v_px",
                                                 "residual_u_px",
                                                 "residual_v_px",
                                                 "sigma_residual_u_px",
                                                 "sigma_residual_v_px",
                                                 "cov_residual_uv_px2",
                                                 "point_in_cam_x_m",
                                                 "point_in_cam_y_m",
                                                 "point_in_cam_z_m",
                                                 "cluster_z2"};
  DataTable table{"shots", {{"name", name}, {"used", used}, {"reason", reason}}};
  for (std::size_t k = 0; k < names.size(); ++k)
    table.columns.emplace_back(names[k], rounded(column[k], k < 3 ? 6 : 5));
  return table;
}

/// Planes of the boards, and where a board's pose is known its corner 0 and axes: enough to draw it.
DataTable planes_table(std::span<const Shot> shots, const RangefinderReport& report) {
  std::vector<std::string> name;
  std::vector<Numbers> column(11);
  for (std::size_t i = 0; i < shots.size(); ++i) {
    const ShotFit& fit = report.shots[i];
    if (!fit.plane) continue;
    name.push_back(shots[i].name);
    const Eigen::Vector3d& n = fit.plane->normal_in_cam;
    std::array<double, 11> values{n.x(), n.y(), n.z(), fit.plane->d_m};
    std::fill(values.begin() + 4, values.end(), missing_value);
    if (fit.pose) {
      const Rigid3& pose = fit.pose->cam_from_board;
      const Eigen::Quaterniond& q = pose.rotation;
      const Eigen::Vector3d& t = pose.translation;
      const std::array<double, 7> posed{t.x(), t.y(), t.z(), q.x(), q.y(), q.z(), q.w()};
      std::copy(posed.begin(), posed.end(), values.begin() + 4);
    }
    for (std::size_t k = 0; k < values.size(); ++k) column[k].push_back(values[k]);
  }
  static const std::array<const char*, 11> names{"nx",
                                                 "ny",
                                                 "nz",
                                                 "d_m",
                                                 "cam_from_board_x_m",
                                                 "cam_from_board_y_m",
                                                 "cam_from_board_z_m",
                                                 "cam_from_board_qx",
                                                 "cam_from_board_qy",
                                                 "cam_from_board_qz",
                                                 "cam_from_board_qw"};
  DataTable table{"planes", {{"name", name}}};
  for (std::size_t k = 0; k < names.size(); ++k) table.columns.emplace_back(names[k], rounded(column[k], 8));
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
  static constexpr std::array<const char*, num_beam_params> names{"origin_x_m",  "origin_y_m",  "origin_z_m",
                                                                  "direction_u", "direction_v", "scale"};
  std::vector<std::pair<std::string, Eigen::Index>> told;
  for (std::size_t i = 0; i < names.size(); ++i) {
    const auto k = static_cast<Eigen::Index>(i);
    if (report.cov_model(k, k) > 0.0 && k < report.clusters.inflation.size()) told.emplace_back(names[i], k);
  }
  return sigma_values(told, report.clusters);
}

void fill_beam(const RangefinderReport& report, ResultDocument& document) {
  const Beam& beam = report.beam;
  const Eigen::Matrix<double, 7, 7> cov = embedded_covariance(beam);
  JsonValue& estimate = document.estimate;
  const Eigen::Vector2d theta = direction_angles_rad(beam);
  estimate["origin_m"] = list_of(beam.origin_in_cam);
  estimate["direction"] = list_of(beam.direction_in_cam);
  estimate["theta_x_rad"] = theta.x();
  estimate["theta_y_rad"] = theta.y();
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
  document.covariance_names = {"origin_x_m",  "origin_y_m",  "origin_z_m", "direction_x",
                               "direction_y", "direction_z", "scale"};
  for (Eigen::Index i = 0; i < 7; ++i)
    for (Eigen::Index j = i; j < 7; ++j) document.covariance_upper.push_back(cov(i, j));
}

}  // namespace

void fill_rangefinder(std::span<const Shot> shots, const RangefinderReport& report, const RangefinderConfig& config,
                      const RangefinderExtras& extras, ResultDocument& document) {
  document.counts.given += shots.size();
  document.counts.used = static_cast<std::size_t>(report.shots_used);
  document.counts.dropped = static_cast<std::size_t>(report.shots_dropped);
  JsonValue& estimate = document.estimate;
  estimate["method"] = method_name(config.method);
  estimate["refine"] = config.refine == Refine::all ? "all" : "beam";
  const bool has_beam = report.status == RangefinderReport::Status::converged;
  if (has_beam) fill_beam(report, document);
  estimate["spot_sigma_px"] = Numbers(report.bound.spot_sigma_px.begin(), report.bound.spot_sigma_px.end());
  estimate["spot_sigma_at_m"] = Numbers(bound_ranges_m.begin(), bound_ranges_m.end());
  estimate["condition"] = report.bound.condition;
  estimate["range_ratio"] = report.bound.range_ratio;
  estimate["normal_spread"] = report.bound.normal_spread;
  estimate["offset_m"] = report.bound.offset_m;
  if (has_beam) document.assumed = rangefinder_assumptions(report);
  if (has_beam) estimate["sigma"] = sigma_of_shots(report);
  estimate["noise"]["sigma_spot_px"] = report.sigma_spot_px;
  estimate["noise"]["sigma_corner_px"] = report.sigma_corner_px;
  estimate["noise"]["sigma_range_m"] = report.beam.noise.sigma_m;
  estimate["noise"]["spot_from"] = report.spot_sigma_is_told ? "residuals" : "given";
  estimate["noise"]["range_from"] = report.range_sigma_is_told ? "residuals" : "given";
  if (extras.board) {
    estimate["board"]["kind"] = kind_name(extras.board->kind);
    estimate["board"]["cols"] = extras.board->cols;
    estimate["board"]["rows"] = extras.board->rows;
    estimate["board"]["square_m"] = extras.board->square_m;
    estimate["board"]["marker_m"] = extras.board->marker_m;
  }
  if (report.shots.size() == shots.size()) {
    document.data.push_back(shots_table(shots, report));
    document.data.push_back(planes_table(shots, report));
  }
  add_counts(extras.by_count, document);
  add_left_out(extras.left_out, document);
  add_gains(extras.gains, document);
}

BeamNow read_rangefinder(const std::filesystem::path& result) {
  const std::filesystem::path file = std::filesystem::is_directory(result) ? result / "result.json" : result;
  BeamNow now;
  try {
    const Json json = Json::parse(read_file(file));
    if (json.at("command") != "rangefinder")
      throw InputError("is the result of '" + json.at("command").get<std::string>() + "', not of rangefinder");
    if (!tells_an_estimate(json.at("verdict").at("exit_code").get<int>()))
      throw InputError("this calibration was refused: " + json.at("verdict").value("to_add", ""));
    const Json& estimate = json.at("estimate");
    const std::string method = estimate.at("method");
    now.method = method == "spot"    ? RangefinderMethod::spot
                 : method == "plane" ? RangefinderMethod::plane
                                     : RangefinderMethod::joint;
    now.sigma_spot_px = std::max(0.02, estimate.at("noise").at("sigma_spot_px").get<double>());
    now.sigma_corner_px = std::max(0.01, estimate.at("noise").at("sigma_corner_px").get<double>());
    now.estimate_scale = json.at("stddev").at("scale").get<double>() > 0.0;
    Board board{.cols = 9, .rows = 6, .square_m = 0.04};
    if (estimate.contains("board")) {
      const Json& b = estimate.at("board");
      board.kind = board_kind(b.at("kind").get<std::string>()).value_or(BoardKind::chessboard);
      board.cols = b.at("cols").get<int>();
      board.rows = b.at("rows").get<int>();
      board.square_m = b.at("square_m").get<double>();
      board.marker_m = b.at("marker_m").get<double>();
    }
    now.points_in_board = points_in_board(board);
  } catch (const Json::exception&) {
    throw InputError(file.string() + ": not a result.json of alidade rangefinder");
  } catch (const InputError& error) {
    const std::string what = error.what();
    throw InputError(what.starts_with(file.string()) ? what : file.string() + ": " + what);
  }
  now.beam = read_beam(file.parent_path() / "rangefinder.yaml").beam;
  now.camera = read_camera(file.parent_path() / "camera.yaml");
  return now;
}

}  // namespace alidade
