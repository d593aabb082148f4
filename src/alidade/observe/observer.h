#pragma once

#include <memory>
#include <optional>
#include <span>

#include "alidade/estimation/progress.h"
#include "alidade/observe/config.h"
#include "alidade/observe/report.h"
#include "alidade/pantilt/rotation_log.h"
#include "alidade/public.h"

namespace alidade {
ALIDADE_PUBLIC_BEGIN

/// The estimate after a row.
struct ObserveStep {
  double t_s = 0.0;
  IntrinsicsEstimate estimate;
  Eigen::Vector3d rate_rad_per_s = Eigen::Vector3d::Zero();            ///< Angular rate in the camera frame.
  Eigen::Quaterniond start_from_cam = Eigen::Quaterniond::Identity();  ///< Rotation since the first row of the segment.
  std::optional<TrueIntrinsics> truth = {};
};

/// Incremental observe(), row by row: push() returns the estimate of the hybrid method at once, and finish() the report
/// of observe() on all rows. For a stream longer than `keep_rows` it uses the newest rows, and the report says so.
class Observer {
 public:
  /// `layout`: a log without rows, which defines the rows: the source of the rotation and the number of points (0: as
  /// in the first row). Throws ConfigError as observe() does, also if the size of the images is missing, or if errors
  /// of the rotation are to be estimated, which requires a whole log.
  Observer(RotationLog layout, const ObserveConfig& config);
  ~Observer();
  Observer(Observer&&) noexcept;
  Observer& operator=(Observer&&) noexcept;

  /// Throws ConfigError for an invalid row, which is skipped.
  ObserveStep push(RotationRow row, const std::optional<TrueIntrinsics>& truth = {});
  /// The same with ω (source rate) or pan, tilt, roll (source head), and one pixel per point; NaN: not seen.
  ObserveStep push(double t_s, const Eigen::Vector3d& rotation, std::span<const Eigen::Vector2d> px);
  /// The same with the attitude base_from_cam (source attitude).
  ObserveStep push(double t_s, const Eigen::Quaterniond& base_from_cam, std::span<const Eigen::Vector2d> px);

  [[nodiscard]] std::size_t num_rows() const;  ///< Rows that were accepted.
  /// The report on all rows so far, or on the newest; more rows may follow.
  [[nodiscard]] ObserveReport finish(const Progress& progress = {}) const;

 private:
  struct State;
  std::unique_ptr<State> state_;
};

ALIDADE_PUBLIC_END
}  // namespace alidade
