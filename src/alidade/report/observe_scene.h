#pragma once

#include <Eigen/Geometry>
#include <string>
#include <vector>

#include "alidade/report/document.h"

namespace alidade::report {

/// Something that the estimator noticed.
struct EventMark {
  double t_s = 0.0;
  std::string kind;  ///< start, burst, slip, zoom, zoom_end, restart, gap, or another word.
  int point = -1;    ///< From 0; −1: of none.
};

/// A pixel of a point in a step, with its residual.
struct PointMark {
  int step = -1, point = 0;
  double u_px = 0.0, v_px = 0.0;                    ///< NaN if not known.
  double residual_u_px = 0.0, residual_v_px = 0.0;  ///< NaN if not known.
  bool is_used = true;
};

/// One of fx, fy, cx, cy over time; columns as long as the steps, NaN where missing.
struct IntrinsicColumns {
  std::string name;
  std::vector<double> value, sigma, truth, bound;
};

/// What the figures of `observe` draw, out of its tables (the columns are named in figures.h).
struct ObserveScene {
  const Document& document;
  const Table* steps = nullptr;  ///< Null if missing.
  std::vector<double> t_s;       ///< From the first step where that is far from zero (`is_relative`).
  bool is_relative = false;
  std::vector<IntrinsicColumns> intrinsics;
  std::vector<EventMark> events;
  std::vector<PointMark> points;
  std::vector<std::pair<std::size_t, Eigen::Quaterniond>> start_from_cam;  ///< Steps with an attitude.
  double width_px = 0.0, height_px = 0.0;                                  ///< Zero if not known.

  [[nodiscard]] double first_s() const { return t_s.empty() ? 0.0 : t_s.front(); }
  [[nodiscard]] double last_s() const { return t_s.empty() ? 1.0 : t_s.back(); }
  [[nodiscard]] bool has_picture_size() const { return width_px > 0.0 && height_px > 0.0; }
};

[[nodiscard]] ObserveScene observe_scene(const Document& document);

/// How points are called: p1, p2, …, as in the log's columns.
[[nodiscard]] std::string point_name(int point);

/// "98.4 %"; "–" of none.
[[nodiscard]] std::string share_text(std::size_t part, std::size_t whole);

}  // namespace alidade::report
