#pragma once

#include <Eigen/Core>
#include <optional>
#include <vector>

#include "alidade/servo/identify/encoder_sampling.h"
#include "alidade/servo/identify/positioner_fit.h"

namespace alidade {

/// Indices of the fitted parameters: logarithms of rate, acceleration and time constant, then seconds and radians; last
/// the relative difference of the encoder's sampling period from the preset one.
struct PositionerPlace {
  enum : int { rate, acceleration, time_constant, latency, backlash, offset, sampling, count };
};
using PositionerVector = Eigen::Vector<double, PositionerPlace::count>;

[[nodiscard]] PositionerParams positioner_params(const PositionerVector& theta, double dead_band_rad);

/// The used readings of a log, whitened.
class PositionerProblem {
 public:
  PositionerProblem(const PositionerLog& log, double step_rad, double dead_band_rad);

  [[nodiscard]] std::size_t size() const { return readings_.size(); }
  /// (model − reading) / σ; beyond the threshold only its logarithm.
  [[nodiscard]] Eigen::VectorXd misfit(const PositionerVector& theta) const;
  [[nodiscard]] std::vector<double> model(const PositionerVector& theta) const;
  /// By central differences; columns of fixed parameters are zero.
  [[nodiscard]] Eigen::MatrixXd jacobian(const PositionerVector& theta, const std::vector<int>& free) const;
  /// Minimises from `theta` over the free parameters; returns the sum of squares.
  double solve(PositionerVector& theta, const std::vector<int>& free, int max_steps = 60) const;
  /// Initial search without a threshold: otherwise outliers would have no weight, and a wrong minimum would persist.
  void set_threshold(double sigmas) { threshold_ = sigmas; }

  /// Readings are samples held by the encoder.
  void set_sampling(const EncoderSampling& sampling, const PositionerVector& theta);
  /// Searches the residuals for the encoder's sampling; none: it is read on request.
  [[nodiscard]] std::optional<EncoderSampling> find_sampling(const PositionerVector& theta) const;
  /// The sampling near this one, used for `theta`, that assigns the fewest readings to a different sample; the
  /// latency of `theta` is adjusted to its phase.
  [[nodiscard]] EncoderSampling refined(const EncoderSampling& sampling, PositionerVector& theta) const;

  /// The preset sampling with the period fitted since.
  [[nodiscard]] EncoderSampling fitted(const EncoderSampling& sampling, const PositionerVector& theta) const;

  [[nodiscard]] const std::vector<PositionerReading>& readings() const { return readings_; }
  [[nodiscard]] const std::vector<double>& rates() const { return rate_; }
  /// The command that a reading responds to: its cluster.
  [[nodiscard]] const std::vector<int>& move() const { return move_; }

 private:
  [[nodiscard]] std::vector<double> response(const PositionerVector& theta, const std::vector<double>& times) const;
  [[nodiscard]] std::vector<double> sampled_times(double sampling) const;
  [[nodiscard]] double middle_s() const { return 0.5 * (times_.front() + times_.back()); }
  [[nodiscard]] AxisReadings axis_readings(const PositionerVector& theta) const;

  std::vector<PositionCommand> commands_;
  std::vector<PositionerReading> readings_;
  std::vector<double> times_, rate_, sigma_, shared_;
  std::vector<int> move_;
  double start_rad_ = 0.0, dead_band_rad_ = 0.0, step_rad_ = 0.0, origin_s_ = 0.0, threshold_ = 4.0;
};

/// If readings are renewed at irregular times, the model cannot know the age of each; the delay of the first visible
/// change is observable, from commands at random phases.
void heed_renewal(const PositionerLog& log, double step_rad, PositionerFit& fit);

}  // namespace alidade
