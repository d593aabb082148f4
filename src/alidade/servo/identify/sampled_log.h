#pragma once

#include <Eigen/Core>
#include <optional>
#include <span>
#include <vector>

#include "alidade/servo/identification.h"
#include "alidade/servo/identify/encoder_sampling.h"

namespace alidade {

/// Whether a row is the first of its sample (ServoSample::sampled_t_s); the others repeat it and determine nothing.
[[nodiscard]] bool is_reading(std::span<const ServoSample> log, std::size_t row);

/// Angles and times of the rows that are readings.
[[nodiscard]] Eigen::VectorXd readings_of(std::span<const ServoSample> log);
[[nodiscard]] std::vector<double> reading_times(std::span<const ServoSample> log);

/// The sampling of an encoder that holds its angle for several rows, from the rows in which a moving axis changes.
struct HeldSampling {
  EncoderSampling sampling;
  double sigma_phase_s = 0.0;  ///< Rows in step with the samples do not show when between two rows one was taken.
};
/// None: angles are not held, or at no regular interval.
[[nodiscard]] std::optional<HeldSampling> held_sampling(std::span<const ServoSample> log);

/// When the sample that each row repeats was read on average: half a period after it was taken.
[[nodiscard]] std::vector<double> sampled_times(std::span<const ServoSample> log, const EncoderSampling& sampling);

/// The log with such times; none: all its rows are readings. `command_t_s`: and with these of its commands, where there
/// are any.
[[nodiscard]] std::vector<ServoSample> sampled_log(std::span<const ServoSample> log,
                                                   const std::vector<double>& sampled_t_s,
                                                   const std::vector<double>& command_t_s = {});

/// A value of each row from one of each reading.
[[nodiscard]] std::vector<double> by_row(std::span<const ServoSample> log, const std::vector<double>& by_reading);

}  // namespace alidade
