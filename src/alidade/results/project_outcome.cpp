#include "alidade/results/project_outcome.h"

#include <fmt/format.h>

#include <array>
#include <cmath>
#include <opencv2/core.hpp>
#include <opencv2/imgproc.hpp>

#include "alidade/estimation/config_error.h"
#include "alidade/geometry/decompositions.h"
#include "alidade/imaging/image_codecs.h"
#include "alidade/results/documents/number_columns.h"

namespace alidade {
namespace {

/// Half axes and angle of the 3σ ellipse.
cv::RotatedRect ellipse_3sigma(const BeamPixel& pixel) {
  const SymmetricEigen axes = symmetric_eigen(pixel.cov);
  const Eigen::Vector2d sigma = axes.values.cwiseMax(0.0).cwiseSqrt();
  const Eigen::Vector2d along = axes.vectors.col(1);
  return {cv::Point2f(static_cast<float>(pixel.px.x()), static_cast<float>(pixel.px.y())),
          cv::Size2f(static_cast<float>(6.0 * sigma[1]), static_cast<float>(6.0 * sigma[0])),
          static_cast<float>(std::atan2(along.y(), along.x()) * 180.0 / CV_PI)};
}

/// The photo with the beam's line from 0.1 m to beyond the farthest range, and each spot with its 3σ ellipse.
std::string overlay_png(const cv::Mat& photo, const Beam& beam, const Camera& camera,
                        const std::vector<ProjectedReading>& projected) {
  cv::Mat image;
  photo.convertTo(image, CV_8U, photo.depth() == CV_16U ? 1.0 / 257.0 : 1.0);
  if (image.channels() == 1) cv::cvtColor(image, image, cv::COLOR_GRAY2BGR);
  constexpr int shift = 4;
  const auto fixed = [](const Eigen::Vector2d& px) {
    return cv::Point(static_cast<int>(std::lround(px.x() * (1 << shift))),
                     static_cast<int>(std::lround(px.y() * (1 << shift))));
  };
  double farthest_m = 1.0;
  for (const ProjectedReading& one : projected) farthest_m = std::max(farthest_m, one.range_m);
  std::optional<Eigen::Vector2d> last;
  for (double range_m = 0.1; range_m < 3.0 * farthest_m; range_m *= 1.02) {
    const auto px = project(camera, point_at(beam, range_m));
    const bool is_near = px && (px->array().abs() < 1e5).all();
    if (is_near && last) cv::line(image, fixed(*last), fixed(*px), {0, 200, 255}, 1, cv::LINE_AA, shift);
    last = is_near ? px : std::nullopt;
  }
  for (const ProjectedReading& one : projected) {
    if (!one.pixel) continue;
    cv::ellipse(image, ellipse_3sigma(*one.pixel), {80, 255, 80}, 1, cv::LINE_AA);
    cv::drawMarker(image,
                   {static_cast<int>(std::lround(one.pixel->px.x())), static_cast<int>(std::lround(one.pixel->px.y()))},
                   {80, 255, 80}, cv::MARKER_CROSS, 9, 1, cv::LINE_AA);
  }
  return png_bytes(image);
}

DataTable points_table(const std::vector<ProjectedReading>& projected) {
  NumberColumns columns{{"range_m"},
                        {"u_px"},
                        {"v_px"},
                        {"cov_uu_px2"},
                        {"cov_uv_px2"},
                        {"cov_vv_px2"},
                        {"point_in_cam_x_m"},
                        {"point_in_cam_y_m"},
                        {"point_in_cam_z_m"}};
  columns.with_cov();
  for (const ProjectedReading& one : projected) {
    columns.add({one.range_m});
    if (one.pixel)
      columns.add(
          {one.pixel->px.x(), one.pixel->px.y(), one.pixel->cov(0, 0), one.pixel->cov(0, 1), one.pixel->cov(1, 1)});
    else
      columns.add_missing(5);
    columns.add(one.point.point_in_cam);
    columns.add_cov(one.point.cov);
  }
  DataTable table{"points", {}};
  columns.append_to(table);
  return table;
}

std::string points_csv(const DataTable& table, std::size_t rows) {
  std::string text;
  for (const auto& [name, values] : table.columns) text += (text.empty() ? "" : ",") + name;
  text += "\n";
  for (std::size_t row = 0; row < rows; ++row) {
    for (std::size_t k = 0; k < table.columns.size(); ++k) {
      const double value = std::get<std::vector<double>>(table.columns[k].second.content())[row];
      text += k == 0 ? "" : ",";
      if (std::isfinite(value)) text += fmt::format("{:.9g}", value);
    }
    text += "\n";
  }
  return text;
}

void append_readings_lines(const std::vector<ProjectedReading>& projected, std::vector<std::string>& lines) {
  for (const ProjectedReading& one : projected) {
    const Eigen::Vector3d& p = one.point.point_in_cam;
    const Eigen::Vector3d sigma = 3.0 * one.point.cov.diagonal().cwiseSqrt();
    const std::string pixel = one.pixel ? fmt::format("u {:.2f} ± {:.2g}  v {:.2f} ± {:.2g} px", one.pixel->px.x(),
                                                      3.0 * std::sqrt(one.pixel->cov(0, 0)), one.pixel->px.y(),
                                                      3.0 * std::sqrt(one.pixel->cov(1, 1)))
                                        : "not in the camera's field of view";
    lines.push_back(fmt::format("{:.4g} m: {}   x {:.4f} ± {:.2g}  y {:.4f} ± {:.2g}  z {:.4f} ± {:.2g} m   (3σ)",
                                one.range_m, pixel, p.x(), sigma.x(), p.y(), sigma.y(), p.z(), sigma.z()));
  }
}

JsonValue rows_of(const Eigen::MatrixXd& matrix) {
  JsonValue rows = JsonValue::list();
  for (Eigen::Index i = 0; i < matrix.rows(); ++i) {
    std::vector<double> row;
    for (Eigen::Index j = 0; j < matrix.cols(); ++j) row.push_back(matrix(i, j));
    rows.push_back(std::move(row));
  }
  return rows;
}

/// The first range under the names of a single answer.
void fill_first(const ProjectedReading& first, ResultDocument& document) {
  const Eigen::Vector3d& p = first.point.point_in_cam;
  document.estimate["point_in_cam_m"] = std::vector<double>{p.x(), p.y(), p.z()};
  document.estimate["point_cov_m2"] = rows_of(first.point.cov);
  const Eigen::Vector3d sigma_m = first.point.cov.diagonal().cwiseSqrt();
  document.stddev["point_in_cam_m"] = std::vector<double>{sigma_m.x(), sigma_m.y(), sigma_m.z()};
  if (!first.pixel) return;
  document.estimate["px"] = std::vector<double>{first.pixel->px.x(), first.pixel->px.y()};
  document.estimate["px_cov_px2"] = rows_of(first.pixel->cov);
  document.stddev["px"] = std::vector<double>{std::sqrt(first.pixel->cov(0, 0)), std::sqrt(first.pixel->cov(1, 1))};
}

void append_matrix_lines(const HeadProjection& head, int number, std::vector<std::string>& lines) {
  const Eigen::Matrix<double, 3, 4>& M = head.M;
  lines.push_back(fmt::format("M{} (head {}, pan {:g} rad, tilt {:g} rad)", number, head.id, head.pan_tilt_rad.x(),
                              head.pan_tilt_rad.y()));
  for (Eigen::Index i = 0; i < 3; ++i)
    lines.push_back(fmt::format("  {:14.6f} {:14.6f} {:14.6f} {:14.6f}", M(i, 0), M(i, 1), M(i, 2), M(i, 3)));
}

std::vector<double> components_of(const Eigen::VectorXd& vector) {
  return {vector.data(), vector.data() + vector.size()};
}

/// One head's part of the document, and its lines.
JsonValue head_value(const HeadProjection& head, bool has_point, std::vector<std::string>& lines) {
  JsonValue value;
  value["id"] = head.id;
  value["M"] = rows_of(head.M);
  value["cam_centre_in_world_m"] = components_of(head.cam_centre_in_world);
  if (!has_point) return value;
  if (!head.pixel) {
    lines.push_back("  the point is not in the camera's field of view");
    return value;
  }
  const Eigen::Vector2d& px = head.pixel->px;
  const Eigen::Matrix2d& cov = head.pixel->cov;
  value["px"] = components_of(px);
  value["sigma_px"] = std::vector<double>{std::sqrt(cov(0, 0)), std::sqrt(cov(1, 1))};
  value["cov_px2"] = std::vector<double>{cov(0, 0), cov(0, 1), cov(1, 1)};
  lines.push_back(fmt::format("  u {:.3f} ± {:.2g}  v {:.3f} ± {:.2g} px   (3σ)", px.x(), 3.0 * std::sqrt(cov(0, 0)),
                              px.y(), 3.0 * std::sqrt(cov(1, 1))));
  return value;
}

void fill_point(const RigProjection& projection, JobOutcome& outcome) {
  if (!projection.point_cov) return;
  const Eigen::Matrix3d& cov = *projection.point_cov;
  const Eigen::Vector3d sigma_m = cov.diagonal().cwiseSqrt();
  outcome.document.estimate["point_in_world_m"] = components_of(*projection.point_in_world);
  outcome.document.stddev["point_in_world_m"] = components_of(sigma_m);
  outcome.document.estimate["point_cov_m2"] = rows_of(cov);
  outcome.lines.push_back(fmt::format("the heads determine this point to ± ({:.2g}, {:.2g}, {:.2g}) mm   (3σ)",
                                      3e3 * sigma_m.x(), 3e3 * sigma_m.y(), 3e3 * sigma_m.z()));
}

}  // namespace

JobOutcome outcome_of(const BeamProjection& projection) {
  if (projection.readings.empty()) throw ConfigError("there are no readings");
  JobOutcome outcome;
  ResultDocument& document = outcome.document;
  document.command = "project";
  document.counts = projection.counts;
  document.assumed = projection.assumed;
  document.verdict = projection.verdict;
  const DataTable table = points_table(projection.readings);
  outcome.files.push_back({"points.csv", points_csv(table, projection.readings.size())});
  document.data.push_back(table);
  fill_first(projection.readings.front(), document);
  append_readings_lines(projection.readings, outcome.lines);
  const Camera& camera = projection.camera;
  if (projection.beam.cov.isZero(0.0))
    outcome.lines.emplace_back("the beam's file has no covariance: σ is that of the reading alone");
  if (camera.cov.rows() != params(camera.lens).size() || !camera.cov.allFinite() || camera.cov.isZero(0.0))
    outcome.lines.emplace_back("the camera's file has no covariance: its error is not in σ");
  return outcome;
}

void add_overlay(const BeamProjection& projection, const cv::Mat& photo, JobOutcome& outcome) {
  outcome.files.push_back({"overlay.png", overlay_png(photo, projection.beam, projection.camera, projection.readings)});
}

JobOutcome outcome_of(const RigProjection& projection) {
  JobOutcome outcome;
  ResultDocument& document = outcome.document;
  document.command = "project";
  document.counts = projection.counts;
  document.verdict = projection.verdict;
  JsonValue heads = JsonValue::list();
  for (std::size_t h = 0; h < projection.heads.size(); ++h) {
    const HeadProjection& head = projection.heads[h];
    const int number = static_cast<int>(h) + 1;
    append_matrix_lines(head, number, outcome.lines);
    document.estimate[fmt::format("M{}", number)] = rows_of(head.M);
    heads.push_back(head_value(head, projection.point_in_world.has_value(), outcome.lines));
  }
  document.estimate["heads"] = std::move(heads);
  fill_point(projection, outcome);
  return outcome;
}

}  // namespace alidade
