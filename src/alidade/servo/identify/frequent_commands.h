#pragma once

#include <cstddef>
#include <span>
#include <vector>

#include "alidade/servo/identify/identify.h"

namespace alidade {

/// Number of commands between two rows that stands for continuous change.
inline constexpr std::size_t continuous_commands = 1000;

/// Whether most changed commands change again in the next row, as with a sine, and the log has no command times:
/// the controller may send more commands than rows are logged.
[[nodiscard]] bool has_frequent_commands(std::span<const ServoSample> log);

/// The log with the commands between its rows, `per_row` per usual interval, each
/// on the cubic through its neighbours (C. de Boor, "A practical guide to splines", 1978, IV); 0: none. Added rows
/// are not readings: they repeat the sample of the row before them.
[[nodiscard]] std::vector<ServoSample> with_commands_between(std::span<const ServoSample> log, std::size_t per_row);

/// Number of commands per row, by the plain model: if 2 ln of the likelihood ratio against the log
/// as it is exceeds 12, the most likely of 1 (if rows are lost), 2, 3, 4, 6 and continuous. Else 0.
[[nodiscard]] std::size_t commands_per_row(std::span<const ServoSample> log, const ServoFit& fit);

/// Additional covariance of the parameters, since a log seldom determines the number of commands: a held
/// command acts half of its hold time late, and only the ripple separates that from a latency. The
/// mean square of the parameters' differences, weighted by the likelihood of each hypothesis.
[[nodiscard]] decltype(ServoFit::cov) cov_of_commands_between(std::span<const ServoSample> log, const ServoFit& fit,
                                                              std::size_t per_row);

/// Threshold above which the latency is reported to depend on command times: a fifth of it, or, if it is short, a
/// twentieth of the time constant.
[[nodiscard]] double max_sigma_command_s(const ServoFit& fit);

}  // namespace alidade
