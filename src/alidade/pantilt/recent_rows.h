#pragma once

#include <cstddef>
#include <iterator>
#include <vector>

#include "alidade/estimation/verdict.h"

// For streams without end: only the newest rows are kept, to bound the memory.

namespace alidade {

/// Erases the oldest rows once there are twice `keep` of them, so that the mean cost per row is constant. How many.
template <typename Row>
std::size_t forget_oldest(std::vector<Row>& rows, std::size_t keep) {
  if (rows.size() < 2 * keep) return 0;
  const std::size_t count = rows.size() - keep;
  rows.erase(rows.begin(), std::next(rows.begin(), static_cast<std::ptrdiff_t>(count)));
  return count;
}

/// Adds to a result that it covers the newest rows only, if some were forgotten; `unit`: "rows", "observations".
void add_recent_rows(std::size_t forgotten, std::size_t kept, const char* unit, Verdict& verdict);

}  // namespace alidade
