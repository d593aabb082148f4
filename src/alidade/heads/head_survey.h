#pragma once

#include <Eigen/Core>
#include <string>
#include <vector>

#include "alidade/estimation/progress.h"
#include "alidade/estimation/verdict.h"
#include "alidade/heads/head_device.h"

namespace alidade {

/// Where a person lets a head go; none: as far as it can. [rad]
struct HeadRange {
  Eigen::Vector2d low_rad = Eigen::Vector2d::Constant(-1e9), high_rad = Eigen::Vector2d::Constant(1e9);
};

/// A little of zoom, to and fro, and what pan and tilt did meanwhile.
struct ZoomTrial {
  bool has_zoom = false;
  double from = 0.0, to = 0.0, read = 0.0;  ///< Shares; what was read after it.
  Eigen::Vector2d moved_rad = Eigen::Vector2d::Zero();
};

/// What a head is, as it says and as it answers.
struct HeadSurvey {
  std::string url;
  HeadLimits limits;
  std::vector<HeadPosition> readings;
  double latency_s = 0.0, latency_p99_s = 0.0, jitter_s = 0.0;  ///< Of an answer: median, 99th of 100, its scatter.
  bool answers_questions = true;  ///< Else it reports unasked, and the three before are of nothing.
  bool has_moved = false;
  /// By a small move: the largest rate, and the smallest change of what is read; 0: it did not move.
  Eigen::Vector2d rate_rad_s = Eigen::Vector2d::Zero(), resolution_rad = Eigen::Vector2d::Zero();
  ZoomTrial zoom;
  Verdict verdict;
};

/// 100 readings; and with `moves` a step of a few degrees to and fro. Throws InputError, Interrupted: the head stands
/// then.
[[nodiscard]] HeadSurvey survey_head(HeadDevice& device, bool moves, const HeadRange& range = {},
                                     const Progress& progress = {});

/// Waits until two readings half a second apart are the same, at most so long; the last one.
HeadPosition wait_for_rest(MovingHead& head, double max_s);

/// Zooms a little and back, where the head has zoom. Throws as MovingHead does.
[[nodiscard]] ZoomTrial try_zoom(MovingHead& head);
/// Says what the trial showed: nothing where there is no zoom.
void judge_zoom(const ZoomTrial& trial, Verdict& verdict);

}  // namespace alidade
