#pragma once

#include <cstddef>
#include <vector>

namespace alidade::report {

/// Rows of a table of time steps that a page holds; the CSV beside it has all.
inline constexpr std::size_t max_step_rows = 20'000;

/// Rows of a long table to keep, in order, about `most` of them: the first and the last, all with `must_keep` (one a
/// row, or empty), and of each of equal buckets the rows where a column is smallest and largest. All rows where there
/// are not more. NaN is never an extreme.
[[nodiscard]] std::vector<std::size_t> thinned_rows(std::size_t num_rows,
                                                    const std::vector<std::vector<double>>& columns,
                                                    const std::vector<bool>& must_keep, std::size_t most);

}  // namespace alidade::report
