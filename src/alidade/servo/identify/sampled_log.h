#pragma once

#include <Eigen/Core>
#include <optional>
#include <span>
#include <vector>

#include "alidade/servo/identification.h"
#include "alidade/servo/identify/encoder_sampling.h"

namespace alidade {

/// Whether a row is the first of its sample (ServoSample::sampled_t_s); the others repeat it and add no information.
[[nodiscard]] bool is_reading(std::span<const ServoSample> log, std::size_t row);

/// Angles and times of the rows that are readings.
[[nodiscard]] Eigen::VectorXd readings_of(std::span<const ServoSample> log);
[[nodiscard]] std::vector<double> reading_times(std::span<const ServoSample> log);

/// Sampling of an encoder that holds its angle for several rows, from the rows in which a moving axis changes.
struct HeldSampling {
  EncoderSampling sampling;
  double sigma_phase_s = 0.0;  ///< Rows in step with the samples leave open when between two rows one was taken.
};
/// None if angles are not held, or at no regular interval.
[[nodiscard]] std::optional<HeldSampling> held_sampling(std::span<const ServoSample> log);

/// Mean sampling time of the value that each row repeats: half a period after it was taken.
[[nodiscard]] std::vector<double> sampled_times(std::span<const ServoSample> log, const EncoderSampling& sampling);

/// The log with such times; none: all its rows are readings. `command_t_s`: also with these command times, if there
/// are any.
[[nodiscard]] std::vector<ServoSample> sampled_log(std::span<const ServoSample> log,
                                                   const std::vector<double>& sampled_t_s,
                                                   const std::vector<double>& command_t_s = {});

/// Rows whose angle is far from those before and after them, at most three consecutive: no axis moves there and back so
/// fast. Far: ten times the differences between the rows around. Not a full revolution: an encoder may wrap.
[[nodiscard]] std::vector<std::size_t> spikes(std::span<const ServoSample> log);

/// The log without some of its rows; if a command changed in one of them, the next row has its time.
[[nodiscard]] std::vector<ServoSample> without_rows(std::span<const ServoSample> log,
                                                    const std::vector<std::size_t>& rows);

/// Rows with changed commands that the axis did not follow: the response to every command is fitted separately, with
/// time constant and latency from their grid; lost are those without which one gain explains the log. None if
/// commands change fewer than four times or more than sixty, or if a third seems lost.
[[nodiscard]] std::vector<std::size_t> lost_commands(std::span<const ServoSample> log, ServoKind kind);

/// 2 ln of the number of ways to choose that many lost commands.
[[nodiscard]] double price_of_lost(std::span<const ServoSample> log, std::size_t lost);

/// The step of the encoder's zero that explains most of the residuals: a score test at each row with the parameters
/// following. None if 2 ln of the likelihood ratio, counted in rows with independent errors, is not above 3 ln n +
/// 12 (Schwarz's penalty for a size, that for a choice among n rows, and a margin).
[[nodiscard]] std::optional<ZeroSlip> zero_slip(std::span<const ServoSample> log, const ServoFit& fit);

/// One column per step, besides those of parameters and freed nonlinearities: ∂ reading / ∂ its size.
[[nodiscard]] Eigen::MatrixXd with_slips(std::span<const ServoSample> log, const std::vector<ZeroSlip>& slips,
                                         Eigen::MatrixXd J);

/// The log as the axis saw it: a lost command is replaced by the one before it, and the encoder's zero is constant.
[[nodiscard]] std::vector<ServoSample> without_faults(std::span<const ServoSample> log,
                                                      const std::vector<std::size_t>& lost,
                                                      const std::vector<ZeroSlip>& slips);

/// Expands one value per reading to one per row.
[[nodiscard]] std::vector<double> by_row(std::span<const ServoSample> log, const std::vector<double>& by_reading);

}  // namespace alidade
