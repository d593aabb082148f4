#pragma once

#include <vector>

#include "alidade/pantilt/rotation_log.h"

namespace alidade {

/// Rotation of a log at times between its rows.
class AngleInterpolation {
 public:
  /// Of several rows with one time the first is used; pan, tilt and roll take the shorter way round.
  explicit AngleInterpolation(const RotationLog& angles);

  [[nodiscard]] double first_s() const { return rows_.front().t_s; }
  [[nodiscard]] double last_s() const { return rows_.back().t_s; }
  [[nodiscard]] bool covers(double t_s) const;

  /// A row without pixels: the cubic through four rows (Hermite's, with the slopes of parabolas), for attitudes by
  /// their rotation vectors. It is not known between rows of which one was not measured.
  [[nodiscard]] RotationRow at(double t_s) const;
  /// Linear between the rows; the log must have truth.
  [[nodiscard]] TrueIntrinsics truth_at(double t_s) const;

  /// The rows strictly between two times.
  [[nodiscard]] std::vector<RotationRow> between(double begin_s, double end_s) const;

 private:
  [[nodiscard]] std::size_t interval_of(double t_s) const;
  [[nodiscard]] Eigen::Vector3d value(std::size_t row, std::size_t reference) const;
  [[nodiscard]] Eigen::Vector3d slope(std::size_t row, std::size_t reference) const;

  RotationSource source_;
  std::vector<RotationRow> rows_;
  std::vector<TrueIntrinsics> truth_;
};

}  // namespace alidade
