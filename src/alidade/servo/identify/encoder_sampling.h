#pragma once

#include <functional>
#include <optional>
#include <vector>

namespace alidade {

/// An encoder that is sampled every `period_s`, with phase `phase_s`: a reading is its last sample.
struct EncoderSampling {
  double period_s = 0.0, phase_s = 0.0;

  [[nodiscard]] double cycle(double t_s) const;   ///< Index of the sample that is read at that time.
  [[nodiscard]] double last_s(double t_s) const;  ///< Time at which it was taken.
};

/// Readings of an axis, in chronological order, and the model's value at any (ascending) times.
struct AxisReadings {
  std::vector<double> t_s, angle_rad, sigma_rad;
  std::function<std::vector<double>(const std::vector<double>&)> model;
};

/// Searches for a sampling in the delays of the readings relative to the model: they form a sawtooth. None: the encoder
/// is read on request.
[[nodiscard]] std::optional<EncoderSampling> found_sampling(const AxisReadings& readings);

/// The sampling near a given one with which samples that the model explains best explain the readings. The model
/// was fitted with the given one: its latency and the phase can only be separated by the sample of each reading.
[[nodiscard]] EncoderSampling refined_sampling(const AxisReadings& readings, const EncoderSampling& given);

/// Sampling time of each reading, in order. Where the next or the last sample is so close that clocks decide (1.5 ms
/// and `edges_s` of each reading), the one that the model explains is used.
[[nodiscard]] std::vector<double> sample_times(const AxisReadings& readings, const EncoderSampling& sampling,
                                               const std::vector<double>& edges_s);

/// Squared loss that continues as its logarithm beyond `threshold`.
[[nodiscard]] double robust_residual(double z, double threshold);

}  // namespace alidade
