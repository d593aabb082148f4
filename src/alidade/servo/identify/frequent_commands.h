#pragma once

#include <cstddef>
#include <span>
#include <vector>

#include "alidade/servo/identify/identify.h"

namespace alidade {

/// Commands between two rows: so many that they change all the time.
inline constexpr std::size_t continuous_commands = 1000;

/// Whether most commands that change do so in the next row again, as of a sine, and the log does not say when they were
/// given: the controller may give more of them than rows are logged.
[[nodiscard]] bool has_frequent_commands(std::span<const ServoSample> log);

/// The log with the commands that were given between its rows, `per_row` in the usual time from one to the next, each
/// on the cubic through its neighbours (C. de Boor, "A practical guide to splines", 1978, IV); 0: none. Rows that are
/// added are no readings: they repeat the sample of the row before them.
[[nodiscard]] std::vector<ServoSample> with_commands_between(std::span<const ServoSample> log, std::size_t per_row);

/// How many commands there are from row to row, by the plain model: where 2 ln of the likelihood ratio against the log
/// as it is exceeds 12, the most likely of 1 (where rows are lost), 2, 3, 4, 6 and of all the time. Else 0.
[[nodiscard]] std::size_t commands_per_row(std::span<const ServoSample> log, const ServoFit& fit);

/// What the parameters' covariance has beside it, since a log seldom says for sure how many commands there are: a held
/// command acts by half of its hold later than it was wanted, and nothing but the ripple tells that from a latency. The
/// mean square of the parameters' differences, each hypothesis weighted by its likelihood.
[[nodiscard]] decltype(ServoFit::cov) cov_of_commands_between(std::span<const ServoSample> log, const ServoFit& fit,
                                                              std::size_t per_row);

/// Beyond it the latency is said to depend on when commands were given: a fifth of it, or, where it is short, a
/// twentieth of the time constant.
[[nodiscard]] double max_sigma_command_s(const ServoFit& fit);

}  // namespace alidade
