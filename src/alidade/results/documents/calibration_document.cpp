#include "alidade/results/documents/calibration_document.h"

#include <algorithm>
#include <array>
#include <cmath>

#include "alidade/calibrate/solve/port.h"
#include "alidade/formats/camera_json.h"
#include "alidade/geometry/so3.h"
#include "alidade/results/documents/number_columns.h"
#include "alidade/results/documents/sigma_values.h"

namespace alidade {
namespace {

using Numbers = std::vector<double>;

double rounded_to(double value, double step) { return std::isfinite(value) ? std::round(value / step) * step : value; }

Eigen::Vector3d centre_of(const std::vector<Eigen::Vector3d>& points) {
  Eigen::Vector3d sum = Eigen::Vector3d::Zero();
  for (const Eigen::Vector3d& point : points) sum += point;
  return sum / static_cast<double>(points.size());
}

/// Covariance of a board's centre in the camera's frame: the pose's, carried there.
Eigen::Matrix3d cov_of_centre(const ViewFit& fit, const Eigen::Vector3d& centre_in_board) {
  Eigen::Matrix<double, 3, 6> J;
  J << Eigen::Matrix3d::Identity(), -cross_matrix(centre_in_board);
  J = fit.cam_from_board.rotation.toRotationMatrix() * J;
  return J * fit.pose_cov * J.transpose();
}

DataTable photos_table(const Board& board, const Calibration& calibration) {
  const auto& views = calibration.board_views;
  const CalibrateReport& report = calibration;
  std::vector<std::string> names, why;
  std::vector<bool> used;
  std::vector<int> num_corners;
  Numbers rms, z2;
  std::size_t cluster = 0;
  NumberColumns poses{};
  poses.with_pose("cam_from_board").with_cov("cov_middle_");
  const Eigen::Vector3d centre_in_board = centre_of(points_in_board(board));
  for (std::size_t k = 0; k < views.size(); ++k) {
    const ViewFit& fit = report.views[k];
    names.push_back(views[k].photo);
    used.push_back(fit.used);
    why.push_back(fit.reason);
    num_corners.push_back(static_cast<int>(views[k].corners.size()));
    rms.push_back(fit.used ? fit.rms_px : std::nan(""));
    const bool has_score = fit.used && cluster < report.clusters.z2.size();
    z2.push_back(has_score ? report.clusters.z2[cluster++] : std::nan(""));
    poses.add_pose(fit.used ? &fit.cam_from_board : nullptr);
    if (fit.used)
      poses.add_cov(cov_of_centre(fit, centre_in_board));
    else
      poses.add_missing(6);
  }
  DataTable table{"photos",
                  {{"name", names},
                   {"used", used},
                   {"reason", why},
                   {"num_corners", num_corners},
                   {"rms_px", rms},
                   {"cluster_z2", z2}}};
  poses.append_to(table);
  return table;
}

DataTable corners_table(const Board& board, const Calibration& calibration) {
  const auto& views = calibration.board_views;
  const CalibrateReport& report = calibration;
  std::vector<int> photo, col, row;
  std::array<Numbers, 8> c;
  const int per_row = board.kind == BoardKind::aprilgrid ? 4 * board.cols : board.cols;
  for (std::size_t k = 0; k < views.size(); ++k) {
    for (std::size_t i = 0; i < views[k].corners.size(); ++i) {
      const Corner& corner = views[k].corners[i];
      const CornerResidual& fit = report.views[k].corners[i];
      const bool solved = report.views[k].used;
      const double sigma_u = std::sqrt(corner.cov(0, 0)), sigma_v = std::sqrt(corner.cov(1, 1));
      photo.push_back(static_cast<int>(k));
      col.push_back(corner.index % per_row);
      row.push_back(corner.index / per_row);
      c[0].push_back(rounded_to(corner.px.x(), 0.01));
      c[1].push_back(rounded_to(corner.px.y(), 0.01));
      c[2].push_back(rounded_to(sigma_u, 1e-4));
      c[3].push_back(rounded_to(sigma_v, 1e-4));
      c[4].push_back(rounded_to(corner.cov(0, 1) / (sigma_u * sigma_v), 1e-3));
      c[5].push_back(solved ? rounded_to(fit.residual_px.x(), 1e-4) : std::nan(""));
      c[6].push_back(solved ? rounded_to(fit.residual_px.y(), 1e-4) : std::nan(""));
      c[7].push_back(solved && fit.used ? 1.0 : 0.0);
    }
  }
  return {"corners",
          {{"photo", photo},
           {"col", col},
           {"row", row},
           {"u_px", c[0]},
           {"v_px", c[1]},
           {"sigma_u_px", c[2]},
           {"sigma_v_px", c[3]},
           {"corr_uv", c[4]},
           {"residual_u_px", c[5]},
           {"residual_v_px", c[6]},
           {"weight", c[7]}}};
}

DataTable cells_table(const CalibrationStudy& study) {
  Numbers u, v, mean_u, mean_v, z;
  std::vector<int> count;
  for (const ResidualCell& cell : study.cells) {
    u.push_back(cell.u_px);
    v.push_back(cell.v_px);
    count.push_back(cell.count);
    mean_u.push_back(cell.count > 0 ? cell.mean_px.x() : std::nan(""));
    mean_v.push_back(cell.count > 0 ? cell.mean_px.y() : std::nan(""));
    z.push_back(cell.count > 0 ? cell.z : std::nan(""));
  }
  return {"cells",
          {{"u_px", u}, {"v_px", v}, {"count", count}, {"mean_u_px", mean_u}, {"mean_v_px", mean_v}, {"z", z}}};
}

DataTable rings_table(const CalibrationStudy& study) {
  Numbers radius, radial, tangential, sigma;
  for (const ResidualRing& ring : study.rings) {
    if (ring.count == 0) continue;
    radius.push_back(ring.radius_px);
    radial.push_back(ring.mean_radial_px);
    tangential.push_back(ring.mean_tangential_px);
    sigma.push_back(ring.sigma_px);
  }
  return {"rings",
          {{"radius_px", radius}, {"mean_radial_px", radial}, {"mean_tangential_px", tangential}, {"sigma_px", sigma}}};
}

DataTable models_table(const CalibrationStudy& study) {
  std::vector<std::string> names;
  Numbers rms, sigma;
  for (const HeldOutModel& model : study.models) {
    names.push_back(model.name);
    rms.push_back(model.heldout_rms_px);
    sigma.push_back(model.sigma_px);
  }
  return {"models", {{"name", names}, {"heldout_rms_px", rms}, {"sigma_px", sigma}}};
}

DataTable board_points_table(const Board& board, const CalibrateReport& report) {
  const auto printed = points_in_board(board);
  const int per_row = board.kind == BoardKind::aprilgrid ? 4 * board.cols : board.cols;
  std::vector<int> col, row;
  Numbers dx, dy, dz, sigma;
  for (std::size_t i = 0; i < printed.size(); ++i) {
    col.push_back(static_cast<int>(i) % per_row);
    row.push_back(static_cast<int>(i) / per_row);
    const Eigen::Vector3d moved = report.board_points[i] - printed[i];
    dx.push_back(moved.x());
    dy.push_back(moved.y());
    dz.push_back(moved.z());
    sigma.push_back(i < report.board_sigma_z_m.size() ? report.board_sigma_z_m[i] : 0.0);
  }
  return {"board_points",
          {{"col", col}, {"row", row}, {"dx_m", dx}, {"dy_m", dy}, {"dz_m", dz}, {"sigma_dz_m", sigma}}};
}

DataGrid grid_of(const std::string& name, const PixelGrid& grid) {
  return {name, grid.cols, grid.rows, grid.u0_px, grid.v0_px, grid.du_px, grid.dv_px, {}};
}

void fill_grids(const CalibrationStudy& study, ResultDocument& document) {
  const auto sigma = [&](const std::string& name, const PixelGrid& grid) {
    DataGrid data = grid_of(name, grid);
    Numbers values;
    for (const double value : grid.values) values.push_back(rounded_to(value, 1e-5));
    data.values.emplace_back("sigma_px", values);
    document.grids.push_back(std::move(data));
  };
  sigma("sigma_infinity", study.sigma_infinity);
  sigma("sigma_working", study.sigma_working);
  if (!study.halves) return;
  const CameraDiff& diff = study.halves->diff;
  DataGrid halves = grid_of("halves", diff.delta_u);
  Numbers predicted;
  for (std::size_t i = 0; i < diff.sigma_a.values.size(); ++i) {
    predicted.push_back(std::hypot(diff.sigma_a.values[i], diff.sigma_b.values[i]));
  }
  halves.values = {
      {"delta_u_px", diff.delta_u.values}, {"delta_v_px", diff.delta_v.values}, {"predicted_sigma_px", predicted}};
  document.grids.push_back(std::move(halves));
}

JsonValue sigma_of_photos(const CalibrateReport& report) {
  std::vector<std::pair<std::string, Eigen::Index>> given;
  const auto names = param_names(report.camera.lens);
  for (std::size_t i = 0; i < names.size(); ++i) {
    const auto k = static_cast<Eigen::Index>(i);
    if (report.model_cov(k, k) > 0.0) given.emplace_back(names[i], k);
  }
  return sigma_values(given, report.clusters);
}

/// How a brown lens would do instead of a flat port.
JsonValue port_values(const PortResidual& residual) {
  JsonValue values = JsonValue::object();
  Numbers range, rms, worst;
  for (const PortRange& at : residual.at) {
    range.push_back(at.range_m);
    rms.push_back(at.rms_px);
    worst.push_back(at.max_px);
  }
  values["range_m"] = range;
  values["brown_rms_px"] = rms;
  values["brown_max_px"] = worst;
  values["viewpoint_shift_m"] = Numbers{residual.shift_m.x(), residual.shift_m.y(), residual.shift_m.z()};
  values["brown_is_enough"] = residual.brown_is_enough;
  values["brown"] = camera_values(residual.brown);
  values["sentence"] = port_sentence(residual);
  return values;
}

void fill_estimate(const Board& board, const Calibration& calibration, ResultDocument& document) {
  const CalibrateReport& report = calibration;
  const auto names = param_names(report.camera.lens);
  document.estimate["camera"] = camera_values(report.camera);
  document.stddev["camera"] = camera_stddev(report.camera);
  Camera by_single_corners = report.camera;
  by_single_corners.cov = report.model_cov;
  document.stddev_model["camera"] = camera_stddev(by_single_corners);
  document.estimate["sigma"] = sigma_of_photos(report);
  std::vector<Eigen::Index> free;
  for (std::size_t i = 0; i < names.size(); ++i) {
    const auto at = static_cast<Eigen::Index>(i);
    if (report.camera.cov(at, at) > 0.0) free.push_back(at);
  }
  for (std::size_t i = 0; i < free.size(); ++i) {
    document.covariance_names.push_back(names[static_cast<std::size_t>(free[i])]);
    for (std::size_t j = i; j < free.size(); ++j) {
      document.covariance_upper.push_back(report.camera.cov(free[i], free[j]));
    }
  }
  document.estimate["rms_px"] = report.rms_px;
  document.estimate["noise_px"] = report.noise_px;
  document.estimate["excess_px"] = report.excess_px;
  document.estimate["board_shape"] = shape_name(calibration.config.board_shape);
  document.estimate["transfer_rms_px"] =
      calibration.study.transfer ? calibration.study.transfer->transfer_rms_px : std::nan("");
  document.estimate["transfer_flat_rms_px"] =
      calibration.study.transfer ? calibration.study.transfer->flat_rms_px : std::nan("");
  document.estimate["working_distance_m"] = calibration.study.working_distance_m;
  if (calibration.port) document.estimate["port"] = port_values(*calibration.port);
  JsonValue& target = document.estimate["board"];
  target["kind"] = kind_name(board.kind);
  target["cols"] = board.cols;
  target["rows"] = board.rows;
  target["square_m"] = board.square_m;
  if (board.marker_m > 0.0) target["marker_m"] = board.marker_m;
}

JsonValue photos_of(const Calibration& calibration) {
  const CalibrateReport& report = calibration;
  JsonValue photos = JsonValue::list();
  for (std::size_t k = 0; k < calibration.board_views.size(); ++k) {
    const ViewFit& fit = report.views[k];
    JsonValue row;
    row["file"] = calibration.board_views[k].photo;
    row["used"] = fit.used;
    row["rms_px"] = fit.used ? fit.rms_px : std::nan("");
    row["reason"] = fit.reason;
    photos.push_back(std::move(row));
  }
  return photos;
}

JsonValue rejected_corners(const Calibration& calibration) {
  const auto& views = calibration.board_views;
  const CalibrateReport& report = calibration;
  JsonValue rejected = JsonValue::list();
  for (std::size_t k = 0; k < views.size(); ++k) {
    for (std::size_t i = 0; report.views[k].used && i < views[k].corners.size(); ++i) {
      const CornerResidual& fit = report.views[k].corners[i];
      if (fit.used) continue;
      JsonValue row;
      row["file"] = views[k].photo;
      row["corner"] = views[k].corners[i].index;
      row["residual_px"] = fit.residual_px.norm();
      rejected.push_back(std::move(row));
    }
  }
  return rejected;
}

}  // namespace

DataTable next_photos_table(const NextPhotoPlan& next) {
  NumberColumns poses{};
  poses.with_pose("cam_from_board");
  Numbers worst;
  for (const NextPhoto& photo : next.photos) {
    poses.add_pose(&photo.cam_from_board);
    worst.push_back(photo.worst_3sigma_px);
  }
  DataTable table{"next", {}};
  poses.append_to(table);
  table.columns.emplace_back("worst_3sigma_px", worst);
  return table;
}

DataTable points_in_board_table(const std::vector<Eigen::Vector3d>& points_in_board) {
  Numbers x, y, z;
  for (const Eigen::Vector3d& point : points_in_board) {
    x.push_back(point.x());
    y.push_back(point.y());
    z.push_back(point.z());
  }
  return {"points_in_board", {{"x_m", rounded(x, 6)}, {"y_m", rounded(y, 6)}, {"z_m", rounded(z, 6)}}};
}

void fill_calibration(const Board& board, const Calibration& calibration, ResultDocument& document) {
  const CalibrateReport& report = calibration;
  document.counts = calibration.counts;
  const bool solved = report.status == CalibrateReport::Status::converged;
  document.assumed = calibration.assumed;
  if (solved) {
    fill_estimate(board, calibration, document);
    document.estimate["corners_used"] = report.corners_used;
    document.estimate["corners_rejected"] = rejected_corners(calibration);
  } else {
    document.estimate["camera"]["width"] = calibration.size.width_px;
    document.estimate["camera"]["height"] = calibration.size.height_px;
  }
  document.estimate["photos"] = photos_of(calibration);
  document.data = {photos_table(board, calibration), corners_table(board, calibration)};
  if (!solved) return;
  for (DataTable& table : std::vector<DataTable>{cells_table(calibration.study), rings_table(calibration.study),
                                                 models_table(calibration.study), board_points_table(board, report),
                                                 next_photos_table(calibration.next)}) {
    document.data.push_back(std::move(table));
  }
  fill_grids(calibration.study, document);
}

}  // namespace alidade
