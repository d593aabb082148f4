#pragma once

#include <Eigen/Core>
#include <string>
#include <vector>

#include "alidade/estimation/progress.h"
#include "alidade/estimation/verdict.h"
#include "alidade/heads/head_device.h"

namespace alidade {

/// Limits set by a user; none: those of the head. [rad]
struct HeadRange {
  Eigen::Vector2d low_rad = Eigen::Vector2d::Constant(-1e9), high_rad = Eigen::Vector2d::Constant(1e9);
};

/// A small zoom movement, back and forth, and what pan and tilt did meanwhile.
struct ZoomTrial {
  bool has_zoom = false;
  double from = 0.0, to = 0.0, read = 0.0;  ///< Fractions; what was read after it.
  Eigen::Vector2d moved_rad = Eigen::Vector2d::Zero();
};

/// Properties of a head, as it states them and as it responds.
struct HeadSurvey {
  std::string url;
  HeadLimits limits;
  std::vector<HeadPosition> readings;
  double latency_s = 0.0, latency_p99_s = 0.0, jitter_s = 0.0;  ///< Of a reply: median, 99th percentile, scatter.
  bool answers_questions = true;  ///< False: it reports unasked, and the previous three are meaningless.
  bool has_moved = false;
  /// From a small move: the largest rate, and the smallest change of a reading; 0: it did not move.
  Eigen::Vector2d rate_rad_s = Eigen::Vector2d::Zero(), resolution_rad = Eigen::Vector2d::Zero();
  ZoomTrial zoom;
  Verdict verdict;
};

/// 100 readings; and with `moves` a step of a few degrees back and forth. Throws InputError, Interrupted, with the head
/// stopped.
[[nodiscard]] HeadSurvey survey_head(HeadDevice& device, bool moves, const HeadRange& range = {},
                                     const Progress& progress = {});

/// Waits until two readings half a second apart are equal, up to a time limit; returns the last one.
HeadPosition wait_for_rest(MovingHead& head, double max_s);

/// Zooms a little and back, if the head has zoom. Throws as MovingHead does.
[[nodiscard]] ZoomTrial try_zoom(MovingHead& head);
/// Reports what the trial showed: nothing if there is no zoom.
void judge_zoom(const ZoomTrial& trial, Verdict& verdict);

}  // namespace alidade
