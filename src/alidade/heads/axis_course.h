#pragma once

#include <deque>
#include <optional>

#include "alidade/pantilt/positioner.h"

namespace alidade {

/// Position of one axis between two readings: from its model and the commands, plus the deviation of the readings.
class AxisCourse {
 public:
  AxisCourse(const PositionerParams& axis, double start_rad, double t_s);

  /// In chronological order.
  void read(double t_s, double angle_rad);
  void send(double t_s, double target_rad);
  /// Between the readings of the last two seconds; none: before or after them.
  [[nodiscard]] std::optional<double> at(double t_s) const;

 private:
  struct Point {
    double t_s, model_rad;
  };
  struct Reading {
    double t_s, angle_rad, beside_rad;  ///< `beside`: reading minus model.
  };
  void advance(double t_s);

  Positioner model_;
  std::deque<Point> course_;
  std::deque<Reading> readings_;
};

}  // namespace alidade
