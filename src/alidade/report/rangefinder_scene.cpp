#include "alidade/report/rangefinder_scene.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <limits>
#include <map>

#include "alidade/beam/unit_direction.h"

namespace alidade::report {
namespace {

constexpr double missing = std::numeric_limits<double>::quiet_NaN();
constexpr double absurd = 1e7;  // metres or pixels: not of this world, and not to be drawn

double sane(double value) { return std::abs(value) < absurd ? value : missing; }

Eigen::Vector3d vector_of(const Table& table, const std::array<const char*, 3>& names, std::size_t row) {
  return {sane(table.number(names[0], row)), sane(table.number(names[1], row)), sane(table.number(names[2], row))};
}

ShotMark shot_of(const Table& table, std::size_t row) {
  const auto number = [&](const char* name) { return sane(table.number(name, row)); };
  ShotMark shot;
  shot.name = table.text("name", row);
  if (shot.name.empty()) shot.name = "shot " + std::to_string(row + 1);
  shot.reason = table.text("reason", row);
  shot.is_used = table.find("used") == nullptr || table.number("used", row) > 0.0;
  shot.range_m = number("range_m");
  shot.residual_range_m = number("residual_range_m");
  shot.sigma_range_m = number("sigma_residual_range_m");
  shot.seen_px = {number("u_px"), number("v_px")};
  shot.residual_px = {number("residual_u_px"), number("residual_v_px")};
  const double sigma_u = number("sigma_residual_u_px"), sigma_v = number("sigma_residual_v_px"),
               uv = number("cov_residual_uv_px2");
  shot.cov_px << sigma_u * sigma_u, uv, uv, sigma_v * sigma_v;
  shot.left_out_range_m = missing;
  shot.left_out_px.setConstant(missing);
  shot.hit_in_cam = vector_of(table, {"point_in_cam_x_m", "point_in_cam_y_m", "point_in_cam_z_m"}, row);
  return shot;
}

void read_planes(const Table& table, RangefinderScene& scene) {
  std::multimap<std::string, std::size_t> rows;  // names may repeat: each plane goes to the next shot of its name
  for (std::size_t i = 0; i < scene.shots.size(); ++i) rows.emplace(scene.shots[i].name, i);
  for (std::size_t row = 0; row < table.num_rows; ++row) {
    const auto found = rows.find(table.text("name", row));
    if (found == rows.end()) continue;
    ShotMark& shot = scene.shots[found->second];
    rows.erase(found);
    shot.normal_in_cam = vector_of(table, {"nx", "ny", "nz"}, row);
    shot.d_m = sane(table.number("d_m", row));
    const double length = shot.normal_in_cam.norm();
    shot.has_plane = length > 0.5 && length < 2.0 && std::isfinite(shot.d_m);
    shot.has_pose =
        read_pose(table, "cam_from_board", row, shot.cam_from_board) && shot.cam_from_board.translation.norm() < absurd;
  }
}

void read_left_out(const Table& table, RangefinderScene& scene) {
  for (std::size_t row = 0; row < table.num_rows; ++row) {
    const double index = table.number("shot", row);
    if (!(index >= 0.0) || !(index < static_cast<double>(scene.shots.size()))) continue;
    ShotMark& shot = scene.shots[static_cast<std::size_t>(index)];
    shot.left_out_range_m = sane(table.number("residual_range_m", row));
    shot.left_out_px = {sane(table.number("residual_u_px", row)), sane(table.number("residual_v_px", row))};
  }
}

void read_beam(RangefinderScene& scene) {
  const Document& document = scene.document;
  BeamMark beam;
  for (int i = 0; i < 3; ++i) {
    const std::string index = "[" + std::to_string(i) + "]";
    beam.origin_in_cam[i] = sane(document.estimated("origin_m" + index));
    beam.direction_in_cam[i] = sane(document.estimated("direction" + index));
  }
  const double length = beam.direction_in_cam.norm();
  if (!beam.origin_in_cam.allFinite() || !(length > 0.5) || !(length < 2.0)) return;
  beam.direction_in_cam /= length;
  if (const double scale = document.estimated("scale"); scale > 0.0 && scale < 100.0) beam.scale = scale;
  beam.cov.setConstant(missing);
  if (document.covariance_names.size() == 7 && document.covariance_upper.size() == 28) {
    std::size_t at = 0;
    for (int i = 0; i < 7; ++i)
      for (int j = i; j < 7; ++j) beam.cov(i, j) = beam.cov(j, i) = sane(document.covariance_upper[at++]);
  }
  if (beam.has_cov() && beam.cov.diagonal().minCoeff() < 0.0) beam.cov.setConstant(missing);
  scene.beam = beam;
}

void read_camera(RangefinderScene& scene) {
  const Document& document = scene.document;
  const double width = document.estimated("camera.width"), height = document.estimated("camera.height");
  if (!(width >= 1.0 && width < 1e6) || !(height >= 1.0 && height < 1e6)) return;
  Camera camera;
  camera.width_px = static_cast<int>(width);
  camera.height_px = static_cast<int>(height);
  camera.lens = make_lens(document.estimated_text("camera.model")).value_or(Calibrated<Pinhole>{});
  const std::vector<std::string> names = param_names(camera.lens);
  Eigen::VectorXd values = Eigen::VectorXd::Zero(static_cast<Eigen::Index>(names.size()));
  for (std::size_t i = 0; i < names.size(); ++i)
    if (const double value = document.estimated("camera." + names[i]); std::isfinite(value))
      values[static_cast<Eigen::Index>(i)] = value;
  const double fx = document.estimated("camera.fx"), fy = document.estimated("camera.fy");
  if (!(fx > 0.0 && fx < absurd) || !(fy > 0.0 && fy < absurd) || !values.allFinite()) return;
  camera.lens = with_params(camera.lens, values);
  scene.camera = camera;
}

void read_board(RangefinderScene& scene) {
  const Document& document = scene.document;
  const double cols = document.estimated("board.cols"), rows = document.estimated("board.rows"),
               square_m = document.estimated("board.square_m");
  if (!(cols >= 1.0 && cols < 1000.0) || !(rows >= 1.0 && rows < 1000.0) || !(square_m > 0.0 && square_m < 100.0))
    return;
  scene.board_cols = static_cast<int>(cols);
  scene.board_rows = static_cast<int>(rows);
  scene.square_m = square_m;
}

void rank_shots(RangefinderScene& scene) {
  for (std::size_t i = 0; i < scene.shots.size(); ++i) scene.worst_first.push_back(i);
  std::ranges::stable_sort(scene.worst_first, [&](std::size_t a, std::size_t b) {
    const ShotMark &left = scene.shots[a], &right = scene.shots[b];
    if (left.is_used != right.is_used) return left.is_used;
    return left.severity() > right.severity();
  });
  if (!scene.worst_first.empty()) scene.chosen = scene.worst_first.front();
}

}  // namespace

bool ShotMark::has_range_residual() const { return std::isfinite(residual_range_m); }
bool ShotMark::has_spot_residual() const { return residual_px.allFinite(); }

double ShotMark::severity() const {
  const double range = std::abs(residual_range_m) / sigma_range_m,
               spot = std::max(std::abs(residual_px.x()) / std::sqrt(cov_px(0, 0)),
                               std::abs(residual_px.y()) / std::sqrt(cov_px(1, 1)));
  return std::max(std::isfinite(range) ? range : 0.0, std::isfinite(spot) ? spot : 0.0);
}

Eigen::Vector3d BeamMark::at(double range_m) const { return origin_in_cam + scale * range_m * direction_in_cam; }

Eigen::Matrix3d BeamMark::cov_at(double range_m) const {
  Eigen::Matrix<double, 3, 7> J_point_beam;
  J_point_beam << Eigen::Matrix3d::Identity(), scale * range_m * Eigen::Matrix3d::Identity(),
      range_m * direction_in_cam;
  return J_point_beam * cov * J_point_beam.transpose();
}

Eigen::Matrix2d BeamMark::cov_direction() const {
  const Eigen::Matrix<double, 3, 2> basis = tangent_basis(direction_in_cam);
  return basis.transpose() * cov.block<3, 3>(3, 3) * basis;
}

double RangefinderScene::longest_m() const {
  double longest = 0.0;
  for (const ShotMark& shot : shots)
    if (shot.is_used && shot.range_m > longest) longest = shot.range_m;
  return longest;
}

RangefinderScene rangefinder_scene(const Document& document, const Pictures& pictures) {
  RangefinderScene scene{.document = document};
  if (const Table* table = document.table("shots"))
    for (std::size_t row = 0; row < table->num_rows; ++row) scene.shots.push_back(shot_of(*table, row));
  if (const Table* table = document.table("planes")) read_planes(*table, scene);
  if (const Table* table = document.table("left_out")) read_left_out(*table, scene);
  read_beam(scene);
  if (!scene.beam)  // they were put where no beam is known to be
    for (ShotMark& shot : scene.shots) shot.hit_in_cam.setConstant(missing);
  read_camera(scene);
  read_board(scene);
  rank_shots(scene);
  const auto with_photo = std::ranges::find_if(
      scene.worst_first, [&](std::size_t index) { return pictures.contains(scene.shots[index].name); });
  if (with_photo != scene.worst_first.end()) scene.chosen = *with_photo;
  return scene;
}

}  // namespace alidade::report
