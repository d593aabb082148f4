#pragma once

#include <deque>
#include <functional>
#include <optional>

#include "alidade/pantilt/positioner.h"

namespace alidade {

/// One axis that is told where to go, as it is known: where it was between two readings, and what to tell it so that
/// it goes along with something that moves. What the model says beside what is read is held to last.
class AxisPilot {
 public:
  AxisPilot(const PositionerParams& axis, double start_rad, double t_s);

  /// In order of time.
  void read(double t_s, double angle_rad);
  void send(double t_s, double target_rad);
  /// Between the readings of the last two seconds; none: before or after them.
  [[nodiscard]] std::optional<double> at(double t_s) const;

  /// Where an axis shall be, by time.
  using Course = std::function<double(double t_s)>;
  /// What to send at `now_s`, another command following every `period_s`: of the commands about where the course will
  /// be, the one after which the axis, as it is known, is least beside the course (RMS), the next commands being the
  /// simple ones.
  [[nodiscard]] double command(double now_s, double period_s, const Course& wanted_rad) const;

 private:
  struct Place {
    double t_s, model_rad;
  };
  struct Reading {
    double t_s, angle_rad, beside_rad;  ///< `beside`: reading less model.
  };
  void advance(double t_s);
  [[nodiscard]] double simple_command(double acts_s, double period_s, const Course& wanted_rad) const;

  PositionerParams axis_;
  Positioner model_;
  std::deque<Place> course_;
  std::deque<Reading> readings_;
};

}  // namespace alidade
