#include "alidade/report/thin.h"

#include <algorithm>
#include <cmath>
#include <span>

namespace alidade::report {
namespace {

/// Indices of the smallest and the largest of values[begin, end) that are numbers; appended to `out`.
void append_extremes(std::span<const double> values, std::size_t begin, std::size_t end,
                     std::vector<std::size_t>& out) {
  std::size_t low = end, high = end;
  for (std::size_t i = begin; i < end; ++i) {
    if (!std::isfinite(values[i])) continue;
    if (low == end || values[i] < values[low]) low = i;
    if (high == end || values[i] > values[high]) high = i;
  }
  if (low == end) return;
  out.push_back(low);
  out.push_back(high);
}

void sort_unique(std::vector<std::size_t>& rows) {
  std::sort(rows.begin(), rows.end());
  rows.erase(std::unique(rows.begin(), rows.end()), rows.end());
}

}  // namespace

std::vector<std::size_t> thinned_rows(std::size_t num_rows, const std::vector<std::vector<double>>& columns,
                                      const std::vector<bool>& must_keep, std::size_t most) {
  std::vector<std::size_t> rows;
  if (num_rows <= most) {
    for (std::size_t i = 0; i < num_rows; ++i) rows.push_back(i);
    return rows;
  }
  const std::size_t per_bucket = 2 * columns.size() + 1, buckets = std::max<std::size_t>(1, most / per_bucket);
  for (std::size_t k = 0; k < buckets; ++k) {
    const std::size_t begin = k * num_rows / buckets, end = (k + 1) * num_rows / buckets;
    rows.push_back(begin);
    for (const std::vector<double>& column : columns) append_extremes(column, begin, end, rows);
  }
  rows.push_back(num_rows - 1);
  for (std::size_t i = 0; i < must_keep.size() && i < num_rows; ++i)
    if (must_keep[i]) rows.push_back(i);
  sort_unique(rows);
  return rows;
}

}  // namespace alidade::report
