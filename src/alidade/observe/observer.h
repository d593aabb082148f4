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

/// What is known after a row.
struct ObserveStep {
  double t_s = 0.0;
  IntrinsicsEstimate estimate;
  Eigen::Vector3d rate_rad_per_s = Eigen::Vector3d::Zero();            ///< Camera frame.
  Eigen::Quaterniond start_from_cam = Eigen::Quaterniond::Identity();  ///< Since the first row of the segment.
  std::optional<TrueIntrinsics> truth = {};
};

/// Incremental observe(), row by row: push() returns the estimate of the hybrid method at once, and finish() the report
/// of observe() on all rows; of a stream longer than `keep_rows` on the newest, and the report says so.
class Observer {
 public:
  /// `layout`: a log without rows, which says what rows have: the source of the rotation, how many points (0: as many
  /// as the first row). Throws ConfigError as observe() does, without the size of the images, and where errors of the
  /// rotation are to be estimated: they take a whole log.
  Observer(RotationLog layout, const ObserveConfig& config);
  ~Observer();
  Observer(Observer&&) noexcept;
  Observer& operator=(Observer&&) noexcept;

  /// Throws ConfigError for an invalid row, which is skipped.
  ObserveStep push(RotationRow row, const std::optional<TrueIntrinsics>& truth = {});
  /// The same with ω (source rate) or pan, tilt, roll (source head), and a pixel per point; NaN: not seen.
  ObserveStep push(double t_s, const Eigen::Vector3d& rotation, std::span<const Eigen::Vector2d> px);
  /// The same with the attitude (source attitude).
  ObserveStep push(double t_s, const Eigen::Quaterniond& base_from_cam, std::span<const Eigen::Vector2d> px);

  [[nodiscard]] std::size_t num_rows() const;  ///< That were taken.
  /// Of all rows so far, or the newest; more may follow.
  [[nodiscard]] ObserveReport finish(const Progress& progress = {}) const;

 private:
  struct State;
  std::unique_ptr<State> state_;
};

ALIDADE_PUBLIC_END
}  // namespace alidade
