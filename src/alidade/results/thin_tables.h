#pragma once

#include <functional>
#include <string>

#include "alidade/results/result_document.h"

namespace alidade {

/// Largest numbers of rows in a document, for a table and for the table of corners; largest text of a document [bytes].
inline constexpr std::size_t max_table_rows = 20'000, max_corner_rows = 60'000, max_result_bytes = 8'000'000;

/// result_text() with a size that a page can hold. Longer tables are thinned: of equal buckets of rows the first is
/// kept and those where a residual (or similar column of the table) is smallest and largest, and also all rows that are
/// flagged: rejected, or with an event. `thinned` of the table says so. The whole table is first passed to
/// `add_file(name, csv)`, which may add the name to document.files.
[[nodiscard]] std::string result_text_of_size(ResultDocument& document,
                                              const std::function<void(std::string, std::string)>& add_file);

/// Records that a table of steps has only some of `from` rows, as thinned_rows() keeps them: of equal buckets the first
/// and those with the extremes of `extremes_of` (a column; empty: none), and those with an event. `all_in` is the file
/// with all rows. Records nothing if the table has all rows.
void record_steps_kept(DataTable& table, std::size_t from, const std::string& extremes_of, const std::string& all_in);

}  // namespace alidade
