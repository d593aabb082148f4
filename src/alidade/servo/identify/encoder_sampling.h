#pragma once

#include <functional>
#include <optional>
#include <vector>

namespace alidade {

/// An encoder that is sampled every `period_s`, also at `phase_s`: what is read is its last sample.
struct EncoderSampling {
  double period_s = 0.0, phase_s = 0.0;

  [[nodiscard]] double cycle(double t_s) const;   ///< Which sample is read at that time.
  [[nodiscard]] double last_s(double t_s) const;  ///< When that was taken.
};

/// Readings of an axis, in the order of their times, and what a model says of it at any (ascending) times.
struct AxisReadings {
  std::vector<double> t_s, angle_rad, sigma_rad;
  std::function<std::vector<double>(const std::vector<double>&)> model;
};

/// Looks for a sampling in the times by which readings are later than the model: they are a sawtooth. None: the encoder
/// is read when it is asked.
[[nodiscard]] std::optional<EncoderSampling> found_sampling(const AxisReadings& readings);

/// The sampling near a given one under which readings are best explained by samples that the model explains. The model
/// was fitted with the given one: its latency and the phase cannot be separated but by which sample each reading is.
[[nodiscard]] EncoderSampling refined_sampling(const AxisReadings& readings, const EncoderSampling& given);

/// When what each reading says was sampled, in order. So near to the next or the last sample that clocks decide (1.5 ms
/// and `edges_s` of each reading), the one is taken that the model explains.
[[nodiscard]] std::vector<double> sample_times(const AxisReadings& readings, const EncoderSampling& sampling,
                                               const std::vector<double>& edges_s);

/// Squares that count beyond `threshold` only as their logarithm.
[[nodiscard]] double robust_residual(double z, double threshold);

}  // namespace alidade
