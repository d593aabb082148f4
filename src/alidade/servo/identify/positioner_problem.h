#pragma once

#include <Eigen/Core>
#include <optional>
#include <vector>

#include "alidade/servo/identify/encoder_sampling.h"
#include "alidade/servo/identify/positioner_fit.h"

namespace alidade {

/// Indices of the fitted parameters: logarithms of rate, acceleration and time constant, then seconds and radians; by
/// how much of itself the period of the encoder's sampling is longer than the one that was set.
struct PositionerPlace {
  enum : int { rate, acceleration, time_constant, latency, backlash, offset, sampling, count };
};
using PositionerVector = Eigen::Vector<double, PositionerPlace::count>;

[[nodiscard]] PositionerParams positioner_params(const PositionerVector& theta, double dead_band_rad);

/// The readings of a log that are used, whitened.
class PositionerProblem {
 public:
  PositionerProblem(const PositionerLog& log, double step_rad, double dead_band_rad);

  [[nodiscard]] std::size_t size() const { return readings_.size(); }
  /// (model − reading) / σ, beyond the threshold as far as its logarithm.
  [[nodiscard]] Eigen::VectorXd misfit(const PositionerVector& theta) const;
  [[nodiscard]] std::vector<double> model(const PositionerVector& theta) const;
  /// By central differences; columns of fixed parameters are zero.
  [[nodiscard]] Eigen::MatrixXd jacobian(const PositionerVector& theta, const std::vector<int>& free) const;
  /// Minimises from `theta` over the free parameters; the sum of squares.
  double solve(PositionerVector& theta, const std::vector<int>& free, int max_steps = 60) const;
  /// A start is searched for without a threshold: what is far off would count for nothing, and a wrong minimum hold.
  void set_threshold(double sigmas) { threshold_ = sigmas; }

  /// Readings are of the encoder's samples.
  void set_sampling(const EncoderSampling& sampling, const PositionerVector& theta);
  /// Searches the residuals for the encoder's sampling; none: it is read when it is asked.
  [[nodiscard]] std::optional<EncoderSampling> find_sampling(const PositionerVector& theta) const;
  /// The sampling near this one, with which `theta` was fitted, that puts the fewest readings into another sample; the
  /// latency of `theta` follows its phase.
  [[nodiscard]] EncoderSampling refined(const EncoderSampling& sampling, PositionerVector& theta) const;

  /// A sampling that was set, with the period that was fitted since.
  [[nodiscard]] EncoderSampling fitted(const EncoderSampling& sampling, const PositionerVector& theta) const;

  [[nodiscard]] const std::vector<PositionerReading>& readings() const { return readings_; }
  [[nodiscard]] const std::vector<double>& rates() const { return rate_; }
  /// Which command's doing a reading is: its cluster.
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

/// Of readings that are renewed at no regular times the model cannot know how old each is; when the first change is
/// read is seen, of commands that came at any phase.
void heed_renewal(const PositionerLog& log, double step_rad, PositionerFit& fit);

}  // namespace alidade
