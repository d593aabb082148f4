#pragma once

#include <Eigen/Core>
#include <vector>

#include "alidade/servo/identify/positioner_fit.h"

namespace alidade {

/// Indices of the fitted parameters: logarithms of rate, acceleration and time constant, then seconds and radians.
struct PositionerPlace {
  enum : int { rate, acceleration, time_constant, latency, backlash, offset, count };
};
using PositionerVector = Eigen::Vector<double, PositionerPlace::count>;

[[nodiscard]] PositionerParams positioner_params(const PositionerVector& theta, double dead_band_rad);

/// The readings of a log that are used, whitened.
class PositionerProblem {
 public:
  PositionerProblem(const PositionerLog& log, double step_rad, double dead_band_rad);

  [[nodiscard]] std::size_t size() const { return readings_.size(); }
  /// (model − reading) / σ, beyond 4σ as far as its logarithm.
  [[nodiscard]] Eigen::VectorXd misfit(const PositionerVector& theta) const;
  [[nodiscard]] std::vector<double> model(const PositionerVector& theta) const;
  /// By central differences; columns of fixed parameters are zero.
  [[nodiscard]] Eigen::MatrixXd jacobian(const PositionerVector& theta, const std::vector<int>& free) const;
  /// Minimises from `theta` over the free parameters; the sum of squares.
  double solve(PositionerVector& theta, const std::vector<int>& free, int max_steps = 60) const;

  /// The encoder is sampled so often from that time on; readings are of its samples.
  void set_sampling(double period_s, double phase_s, const PositionerVector& theta);
  /// Searches the residuals for the encoder's sampling; false: none.
  bool find_sampling(const PositionerVector& theta, double& period_s, double& phase_s) const;

  [[nodiscard]] const std::vector<PositionerReading>& readings() const { return readings_; }
  [[nodiscard]] const std::vector<double>& rates() const { return rate_; }
  /// Which command's doing a reading is: its cluster.
  [[nodiscard]] const std::vector<int>& move() const { return move_; }

 private:
  [[nodiscard]] std::vector<double> response(const PositionerVector& theta, const std::vector<double>& times) const;

  std::vector<PositionCommand> commands_;
  std::vector<PositionerReading> readings_;
  std::vector<double> times_, rate_, sigma_, shared_;
  std::vector<int> move_;
  double start_rad_ = 0.0, dead_band_rad_ = 0.0, step_rad_ = 0.0, origin_s_ = 0.0;
};

}  // namespace alidade
