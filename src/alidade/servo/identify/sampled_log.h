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

/// Rows whose angle is far from those before and after them, at most three in a row: no axis is there and back so soon.
/// Far: of ten times what the rows about them differ by. Not by a turn: an encoder may begin again.
[[nodiscard]] std::vector<std::size_t> spikes(std::span<const ServoSample> log);

/// The log without some of its rows; of a command that changed in one of them the next row has the time.
[[nodiscard]] std::vector<ServoSample> without_rows(std::span<const ServoSample> log,
                                                    const std::vector<std::size_t>& rows);

/// Rows whose command, of those that changed, the axis did not follow: what every command did is fitted by itself, with
/// time constant and latency by their grid, then those are lost without which one gain explains the log. None where
/// commands change fewer than four times or more than sixty, or a third seems lost.
[[nodiscard]] std::vector<std::size_t> lost_commands(std::span<const ServoSample> log, ServoKind kind);

/// 2 ln of how many choices there were of so many lost commands.
[[nodiscard]] double price_of_lost(std::span<const ServoSample> log, std::size_t lost);

/// The slip of the encoder's zero that explains most of what a fit leaves: a score test at each row with the parameters
/// following. None where 2 ln of the likelihood ratio, counted in rows with independent errors, is not above 3 ln n +
/// 12 (Schwarz's price of a size, that of a choice among n rows, and a margin).
[[nodiscard]] std::optional<ZeroSlip> zero_slip(std::span<const ServoSample> log, const ServoFit& fit);

/// A column of each slip beside those of parameters and freed flaws: ∂ reading / ∂ its size.
[[nodiscard]] Eigen::MatrixXd with_slips(std::span<const ServoSample> log, const std::vector<ZeroSlip>& slips,
                                         Eigen::MatrixXd J);

/// The log as the axis had it: a lost command is the one before it, and the encoder's zero stays.
[[nodiscard]] std::vector<ServoSample> without_faults(std::span<const ServoSample> log,
                                                      const std::vector<std::size_t>& lost,
                                                      const std::vector<ZeroSlip>& slips);

/// A value of each row from one of each reading.
[[nodiscard]] std::vector<double> by_row(std::span<const ServoSample> log, const std::vector<double>& by_reading);

}  // namespace alidade
