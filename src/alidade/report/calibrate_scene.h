#pragma once

#include <Eigen/Core>
#include <map>
#include <string>
#include <vector>

#include "alidade/geometry/rigid3.h"
#include "alidade/report/document.h"
#include "alidade/report/picture_map.h"

namespace alidade::report {

using Pictures = std::map<std::string, std::string>;  ///< File name as in the document → JPEG bytes.

struct CornerMark {
  std::size_t photo = 0;
  double u_px = 0.0, v_px = 0.0;
  double residual_u_px = 0.0, residual_v_px = 0.0;  ///< Predicted − found; NaN if there is none.
  double sigma_u_px = 0.0, sigma_v_px = 0.0, corr_uv = 0.0;
  bool is_used = true;
};

struct PhotoMark {
  std::string name, reason;
  bool is_used = false;
  double rms_px = 0.0;  ///< NaN if there is none.
  bool has_pose = false;
  Rigid3 cam_from_board;
  std::vector<std::size_t> corners;
};

/// The tables of a calibrate document, joined: what more than one figure looks up.
struct CalibrateScene {
  const Document& document;
  double width_px = 0.0, height_px = 0.0;  ///< 0 if the document does not tell.
  std::vector<PhotoMark> photos = {};
  std::vector<CornerMark> corners = {};
  std::vector<std::size_t> worst_first = {};  ///< Used photos by falling RMS.
  std::vector<std::size_t> unused = {};
  std::size_t chosen = 0;  ///< The photo that is shown first: the worst.
  int board_cols = 0, board_rows = 0;
  double square_m = 0.0;  ///< 0 if the document does not tell.

  [[nodiscard]] bool has_picture_size() const { return width_px > 0.0 && height_px > 0.0; }
  [[nodiscard]] PicturePanel panel(double width) const {
    return PicturePanel::fitting(width_px, height_px, width, width);
  }
};

[[nodiscard]] CalibrateScene calibrate_scene(const Document& document, const Pictures& pictures);

/// A pose column group of a table; nothing (false) if a part is missing.
[[nodiscard]] bool read_pose(const Table& table, const std::string& prefix, std::size_t row, Rigid3& pose);

/// The width that photos and all corners are drawn at, once for all figures.
inline constexpr double photo_width = 640.0;
inline constexpr double map_width = 520.0;

}  // namespace alidade::report
