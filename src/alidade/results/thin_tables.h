#pragma once

#include <functional>
#include <string>

#include "alidade/results/result_document.h"

namespace alidade {

/// Rows of a table that a document holds, and of the table of corners; text of a document [bytes].
inline constexpr std::size_t max_table_rows = 20'000, max_corner_rows = 60'000, max_result_bytes = 8'000'000;

/// result_text() of a size that a page can hold. Longer tables are thinned: of equal buckets of rows stay the first and
/// those where a residual (or what the table has of that kind) is smallest and largest, and besides all rows that are
/// flagged: rejected, or with an event. What was done is in the table's `thinned`. The whole table goes to
/// `add_file(name, csv)` first, which may add the name to document.files.
[[nodiscard]] std::string result_text_of_size(ResultDocument& document,
                                              const std::function<void(std::string, std::string)>& add_file);

/// Records that a table of steps holds only some of so many, as thinned_rows() keeps them: of equal buckets the first
/// and those with the extremes of `extremes_of` (a column; empty: of none), and those with an event. `all_in`: the file
/// that has them all. Nothing to record where the table does.
void record_steps_kept(DataTable& table, std::size_t from, const std::string& extremes_of, const std::string& all_in);

}  // namespace alidade
