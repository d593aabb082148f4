#pragma once

#include <functional>
#include <string>
#include <vector>

#include "alidade/estimation/counts.h"
#include "alidade/files/csv.h"

namespace alidade {

/// A row's fault as its line and reason, freed of the "file:line: " that the reason begins with.
[[nodiscard]] SkippedInput skipped_row(const Csv& csv, std::size_t row, std::string reason);

/// Calls `read(row)` for every row of a table. What it throws as InputError stops the reading, or with `skip_bad` the
/// row is rejected and named in `skipped`.
void for_each_row(const Csv& csv, bool skip_bad, std::vector<SkippedInput>& skipped,
                  const std::function<void(std::size_t row)>& read);

}  // namespace alidade
