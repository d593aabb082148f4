#pragma once

#include <map>
#include <optional>
#include <string>
#include <vector>

#include "alidade/report/calibrate_scene.h"
#include "alidade/report/document.h"
#include "alidade/report/observe_scene.h"
#include "alidade/report/rangefinder_scene.h"

namespace alidade::report {

/// One card of the page. Its title is the question that it answers.
struct Figure {
  std::string id = {};     ///< Checks link to it: #fig-ID.
  std::string title = {};  ///< Plain text.
  std::string note = {};   ///< Plain text beside the title: units, how to read.
  std::string body = {};   ///< Markup.
  std::string good = {};   ///< Plain text: what good looks like.
  int span = 8;            ///< Of 24 columns.
  std::size_t marks = 0;   ///< Rows of its table that are drawn.
};

/// Nothing where the document has no table for the figure.
using MaybeFigure = std::optional<Figure>;

/// Value ± 3σ of every estimate, and the correlation matrix.
[[nodiscard]] MaybeFigure figure_estimate(const Document& document);
/// The correlation matrix by itself; empty where fewer than two of the parameters have a variance.
[[nodiscard]] std::string correlation_markup(const std::vector<std::string>& names, const std::vector<double>& upper);

[[nodiscard]] MaybeFigure figure_trust(const CalibrateScene& scene);
[[nodiscard]] MaybeFigure figure_residuals(const CalibrateScene& scene);
[[nodiscard]] MaybeFigure figure_worst_photos(const CalibrateScene& scene);
[[nodiscard]] MaybeFigure figure_poses(const CalibrateScene& scene, const Pictures& pictures);
[[nodiscard]] MaybeFigure figure_photo(const CalibrateScene& scene, const Pictures& pictures);
[[nodiscard]] MaybeFigure figure_all_photos(const CalibrateScene& scene, const Pictures& pictures);
[[nodiscard]] MaybeFigure figure_halves(const CalibrateScene& scene);
[[nodiscard]] MaybeFigure figure_lens(const CalibrateScene& scene);
[[nodiscard]] MaybeFigure figure_board(const CalibrateScene& scene);
[[nodiscard]] MaybeFigure figure_next(const CalibrateScene& scene);
[[nodiscard]] MaybeFigure figure_undistorted(const CalibrateScene& scene, const Pictures& pictures);

/// Drawings that several figures show by reference: photos, their arrows, all corners by direction.
[[nodiscard]] std::string shared_drawings(const CalibrateScene& scene, const Pictures& pictures);

[[nodiscard]] MaybeFigure figure_difference(const Document& document);
[[nodiscard]] MaybeFigure figure_diagonal(const Document& document);
[[nodiscard]] MaybeFigure figure_parameters(const Document& document);

/// Figures of `observe`. They read, and do without what is missing (null in a row, or no such column):
/// - table `steps`, a row a row of the log (or thinned evenly, see thin.h, all rows with an event kept):
///   t_s; fx_px, fy_px, cx_px, cy_px (null until there is an estimate); sigma_fx_px, … (one σ); truth_fx_px, …;
///   bound_fx_px, … (Cramér–Rao σ of the log so far); nis, nis_dof (of the frame, of what was not left out);
///   event (start, burst, slip, zoom, zoom_end, restart, gap; empty or null: none), event_point (from 0, of a slip);
///   weak_eigenvalue (information on the weakest combination, above zero), weak_combination (what it is called; the
///   last one that is there is shown), weak_limit (below it: refused), weak_care (below it: with care); the motion, one
///   of pan_rad, tilt_rad, roll_rad or omega_x_rad_per_s, _y_, _z_; the attitude start_from_cam_qx,
///   _qy, _qz, _qw;
/// - table `points`, a row a pixel (thinned): step (row of the full log, growing), point (from 0; shown as p1, …),
/// u_px,
///   v_px (seen), residual_u_px, residual_v_px (predicted − seen), used (0: left out; 1 where missing);
/// - table `bearings`, a row a point: x, y, z in the start's frame;
/// - estimate: camera.width, camera.height (the picture's frame), camera.fx, fy, cx, cy (what the picture covers, the
///   principal point), sigma_px (σ of a coordinate).
/// Kept small by the writer: 2000 steps, 6000 points; 4 decimals of fx and σ, of residuals, 2 of pixels, 3 of t_s.
[[nodiscard]] MaybeFigure figure_observe_intrinsics(const ObserveScene& scene);
[[nodiscard]] MaybeFigure figure_observe_motion(const ObserveScene& scene);
[[nodiscard]] MaybeFigure figure_observe_directions(const ObserveScene& scene);
[[nodiscard]] MaybeFigure figure_observe_nis(const ObserveScene& scene);
[[nodiscard]] MaybeFigure figure_observe_points(const ObserveScene& scene);
[[nodiscard]] MaybeFigure figure_observe_tracks(const ObserveScene& scene);

/// Figures of `rangefinder`. They read, and do without what is missing (null in a row, or no such column):
/// - table `shots`, a row a shot: name, used, reason, range_m, residual_range_m, sigma_residual_range_m, u_px, v_px,
///   residual_u_px, residual_v_px, sigma_residual_u_px, sigma_residual_v_px, cov_residual_uv_px2, point_in_cam_x_m, …;
/// - table `planes`, a row a board, by the shot's name: nx, ny, nz, d_m, cam_from_board_*;
/// - table `left_out`: shot (row of `shots`, from 0), residual_range_m, residual_u_px, residual_v_px;
/// - table `by_count`: num_shots, sigma_origin_m, sigma_direction_rad, bound_origin_m, bound_direction_rad;
/// - grid `next_shot`: distance_m, tilt_rad, sigma_point_m, cells in any order;
/// - estimate: origin_m, direction, theta_x_rad, theta_y_rad, scale, bound, noise, left_out, spot_sigma_px at
///   spot_sigma_at_m, board, camera (width, height, model and the lens' parameters); covariance of origin, direction,
///   scale (7×7).
/// Pictures come under the shots' names, whole photos made smaller.
[[nodiscard]] MaybeFigure figure_rangefinder_estimate(const RangefinderScene& scene);
[[nodiscard]] MaybeFigure figure_rangefinder_refusal(const RangefinderScene& scene);
[[nodiscard]] MaybeFigure figure_rangefinder_beam(const RangefinderScene& scene);
[[nodiscard]] MaybeFigure figure_rangefinder_residuals(const RangefinderScene& scene);
[[nodiscard]] MaybeFigure figure_rangefinder_precision(const RangefinderScene& scene);
[[nodiscard]] MaybeFigure figure_rangefinder_counts(const RangefinderScene& scene);
[[nodiscard]] MaybeFigure figure_rangefinder_next(const RangefinderScene& scene);
[[nodiscard]] MaybeFigure figure_rangefinder_photo(const RangefinderScene& scene, const Pictures& pictures);
[[nodiscard]] MaybeFigure figure_rangefinder_all_photos(const RangefinderScene& scene, const Pictures& pictures);
/// Photos and what is drawn over them, shown by reference.
[[nodiscard]] std::string shared_rangefinder_drawings(const RangefinderScene& scene, const Pictures& pictures);

/// The first rows of every table, with a download of all.
[[nodiscard]] std::string data_tables(const Document& document);

}  // namespace alidade::report
