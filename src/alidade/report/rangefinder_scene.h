#pragma once

#include <Eigen/Core>
#include <optional>
#include <string>
#include <vector>

#include "alidade/camera/camera.h"
#include "alidade/geometry/rigid3.h"
#include "alidade/report/calibrate_scene.h"
#include "alidade/report/document.h"

namespace alidade::report {

/// A shot with all that the document says of it; NaN where something is missing.
struct ShotMark {
  std::string name, reason;
  bool is_used = false;
  double range_m = 0.0;
  double residual_range_m = 0.0, sigma_range_m = 0.0;
  Eigen::Vector2d seen_px, residual_px;  ///< Residual: predicted − seen.
  Eigen::Matrix2d cov_px;                ///< Of the residual.
  double left_out_range_m = 0.0;         ///< Residual when the other shots predict this one.
  Eigen::Vector2d left_out_px;
  Eigen::Vector3d hit_in_cam;
  bool has_plane = false, has_pose = false;
  Eigen::Vector3d normal_in_cam;  ///< Of its board, n·p + d = 0.
  double d_m = 0.0;
  Rigid3 cam_from_board;

  [[nodiscard]] bool has_range_residual() const;
  [[nodiscard]] bool has_spot_residual() const;
  [[nodiscard]] bool has_spot() const { return seen_px.allFinite(); }
  /// Residual over σ, the worse of range and spot; 0 where there is none.
  [[nodiscard]] double severity() const;
};

struct BeamMark {
  Eigen::Vector3d origin_in_cam, direction_in_cam;
  double scale = 1.0;
  Eigen::Matrix<double, 7, 7> cov;  ///< Of origin, direction, scale; NaN if the document has none.

  [[nodiscard]] bool has_cov() const { return cov.allFinite(); }
  [[nodiscard]] Eigen::Vector3d at(double range_m) const;
  [[nodiscard]] Eigen::Matrix3d cov_at(double range_m) const;
  [[nodiscard]] Eigen::Matrix3d cov_origin() const { return cov.topLeftCorner<3, 3>(); }
  /// Of the direction [rad²], to the right and downwards as seen along the beam (camera x and y, nearly).
  [[nodiscard]] Eigen::Matrix2d cov_direction() const;
};

/// What the figures of `rangefinder` draw, out of its tables (the columns are named in figures.h).
struct RangefinderScene {
  const Document& document;
  std::vector<ShotMark> shots = {};
  std::optional<BeamMark> beam = {};
  std::optional<Camera> camera = {};
  int board_cols = 0, board_rows = 0;
  double square_m = 0.0;                      ///< 0 if there is no board of known size.
  std::vector<std::size_t> worst_first = {};  ///< Used shots, then the others.
  std::size_t chosen = 0;                     ///< The shot that is lit first: the worst with a photo.

  [[nodiscard]] bool has_board() const { return square_m > 0.0 && board_cols > 0 && board_rows > 0; }
  [[nodiscard]] double longest_m() const;  ///< Of the used readings; 0 if there is none.
};

[[nodiscard]] RangefinderScene rangefinder_scene(const Document& document, const Pictures& pictures);

}  // namespace alidade::report
