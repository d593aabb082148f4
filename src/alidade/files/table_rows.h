#pragma once

#include <functional>
#include <string>
#include <vector>

#include "alidade/estimation/counts.h"
#include "alidade/files/csv.h"

namespace alidade {

/// The same for a fault that may concern the whole row.
[[nodiscard]] SkippedInput skipped_row(const Csv& csv, std::size_t row, std::string reason);

/// Calls `read(row)` for every row of a table. An InputError from it ends the reading; with `skip_bad` the row is
/// rejected and listed in `skipped`, in the order of the lines, together with the rows that the table itself skipped.
void for_each_row(const Csv& csv, bool skip_bad, std::vector<SkippedInput>& skipped,
                  const std::function<void(std::size_t row)>& read);

}  // namespace alidade
