#pragma once

#include <functional>
#include <string>
#include <vector>

#include "alidade/estimation/counts.h"
#include "alidade/files/csv.h"

namespace alidade {

/// The same of a fault that may be the whole row's.
[[nodiscard]] SkippedInput skipped_row(const Csv& csv, std::size_t row, std::string reason);

/// Calls `read(row)` for every row of a table. What it throws as InputError stops the reading, or with `skip_bad` the
/// row is rejected and named in `skipped`, in the order of the lines and with those that were no rows of this table.
void for_each_row(const Csv& csv, bool skip_bad, std::vector<SkippedInput>& skipped,
                  const std::function<void(std::size_t row)>& read);

}  // namespace alidade
