#include "alidade/tables/corner_file.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <map>
#include <set>

#include "alidade/files/csv.h"
#include "alidade/files/table_rows.h"

namespace alidade {
namespace {

Eigen::Matrix2d read_cov(const Csv& csv, std::size_t row) {
  const double sigma_u = csv.positive(row, "sigma_u_px"), sigma_v = csv.positive(row, "sigma_v_px");
  double correlation = 0.0;
  if (csv.has("corr_uv") && !csv.is_empty(row, "corr_uv")) {
    correlation = csv.number(row, "corr_uv");
    if (!(std::abs(correlation) < 1.0)) {
      throw InputError(csv.where(row, "corr_uv") + ": '" + csv.text(row, "corr_uv") + "' is not between -1 and 1");
    }
  }
  Eigen::Matrix2d cov;
  cov << sigma_u * sigma_u, correlation * sigma_u * sigma_v, correlation * sigma_u * sigma_v, sigma_v * sigma_v;
  return cov;
}

}  // namespace

std::string corners_csv(std::span<const BoardView> views) {
  std::string text = "photo,corner,u_px,v_px,sigma_u_px,sigma_v_px,corr_uv\n";
  for (const BoardView& view : views) {
    const std::string photo = csv_cell(view.photo);
    for (const Corner& corner : view.corners) {
      const double sigma_u = std::sqrt(corner.cov(0, 0)), sigma_v = std::sqrt(corner.cov(1, 1));
      constexpr double most = 0.999999999;  // the next would be 1 to a reader, which no covariance has
      const double correlation = std::clamp(corner.cov(0, 1) / (sigma_u * sigma_v), -most, most);
      fmt::format_to(std::back_inserter(text), "{},{},{:.13g},{:.13g},{:.13g},{:.13g},{:.10g}\n", photo, corner.index,
                     corner.px.x(), corner.px.y(), sigma_u, sigma_v, correlation);
    }
  }
  return text;
}

std::vector<BoardView> read_corners(const std::filesystem::path& file, int num_points,
                                    std::vector<SkippedInput>* skipped) {
  const Csv csv = Csv::read(file, skipped != nullptr);
  const std::string u = csv.has("u_px") ? "u_px" : "u", v = csv.has("v_px") ? "v_px" : "v";
  // One σ without the other is a mistake, and named as such.
  const auto is_given = [&](std::size_t row, const std::string& column) {
    return csv.has(column) && !csv.is_empty(row, column);
  };
  std::vector<BoardView> views;
  std::map<std::string, std::size_t> number;
  std::set<std::pair<std::size_t, int>> seen;
  std::vector<SkippedInput> none;
  for_each_row(csv, skipped != nullptr, skipped != nullptr ? *skipped : none, [&](std::size_t row) {
    Corner corner;
    corner.index = static_cast<int>(csv.integer(row, "corner", 0, num_points - 1));
    corner.px = {csv.number(row, u), csv.number(row, v)};
    if (is_given(row, "sigma_u_px") || is_given(row, "sigma_v_px")) corner.cov = read_cov(csv, row);
    const std::string& photo = csv.text(row, "photo");
    if (photo.empty()) throw InputError(csv.where(row, "photo") + ": is empty");
    const auto [at, is_new] = number.try_emplace(photo, views.size());
    if (is_new) views.push_back({photo, {}});
    if (!seen.emplace(at->second, corner.index).second) {
      throw InputError(csv.where(row, "corner") + ": corner " + std::to_string(corner.index) + " of '" + photo +
                       "' appears twice");
    }
    views[at->second].corners.push_back(corner);
  });
  return views;
}

ImageSize min_size(std::span<const BoardView> views) {
  constexpr double max_px = 2e5;
  Eigen::Vector2d corner(1.0, 1.0);
  for (const BoardView& view : views) {
    for (const Corner& each : view.corners) corner = corner.cwiseMax(each.px);
  }
  const auto to_hold = [max_px](double px) { return static_cast<int>(std::ceil(std::min(px, max_px))) + 1; };
  return {to_hold(corner.x()), to_hold(corner.y())};
}

std::string poses_csv(const std::vector<std::string>& photos, std::span<const Rigid3> cam_from_board) {
  std::string text =
      "photo,cam_from_board_x_m,cam_from_board_y_m,cam_from_board_z_m,cam_from_board_qw,cam_from_board_qx,"
      "cam_from_board_qy,cam_from_board_qz\n";
  for (std::size_t i = 0; i < photos.size(); ++i) {
    const Eigen::Vector3d& t = cam_from_board[i].translation;
    const Eigen::Quaterniond& q = cam_from_board[i].rotation;
    fmt::format_to(std::back_inserter(text), "{},{:.9g},{:.9g},{:.9g},{:.9g},{:.9g},{:.9g},{:.9g}\n",
                   csv_cell(photos[i]), t.x(), t.y(), t.z(), q.w(), q.x(), q.y(), q.z());
  }
  return text;
}

std::string board_points_csv(std::span<const Eigen::Vector3d> points_in_board) {
  std::string text = "corner,x_m,y_m,z_m\n";
  for (std::size_t i = 0; i < points_in_board.size(); ++i) {
    const Eigen::Vector3d& point = points_in_board[i];
    fmt::format_to(std::back_inserter(text), "{},{:.9f},{:.9f},{:.9f}\n", i, point.x(), point.y(), point.z());
  }
  return text;
}

std::vector<Eigen::Vector3d> read_board_points(const std::filesystem::path& file, int num_points) {
  const Csv csv = Csv::read(file);
  std::vector<Eigen::Vector3d> points(static_cast<std::size_t>(num_points));
  std::vector<bool> found(points.size(), false);
  for (std::size_t row = 0; row < csv.num_rows(); ++row) {
    const auto at = static_cast<std::size_t>(csv.integer(row, "corner", 0, num_points - 1));
    if (found[at]) throw InputError(csv.where(row, "corner") + ": point " + std::to_string(at) + " appears twice");
    points[at] = {csv.number(row, "x_m"), csv.number(row, "y_m"), csv.number(row, "z_m")};
    found[at] = true;
  }
  for (std::size_t i = 0; i < found.size(); ++i) {
    if (!found[i]) throw InputError(file.string() + ": point " + std::to_string(i) + " of the board is missing");
  }
  return points;
}

}  // namespace alidade
