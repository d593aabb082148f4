#include "alidade/files/table_rows.h"

#include <algorithm>
#include <utility>

namespace alidade {

SkippedInput skipped_row(const Csv& csv, std::size_t row, std::string reason) {
  SkippedInput skipped = skipped_row(csv.name(), std::move(reason));
  skipped.line = csv.line(row);
  return skipped;
}

void for_each_row(const Csv& csv, bool skip_bad, std::vector<SkippedInput>& skipped,
                  const std::function<void(std::size_t row)>& read) {
  const auto first = static_cast<std::ptrdiff_t>(skipped.size());
  skipped.insert(skipped.end(), csv.skipped().begin(), csv.skipped().end());
  for (std::size_t row = 0; row < csv.num_rows(); ++row) {
    try {
      read(row);
    } catch (const InputError& error) {
      if (!skip_bad) throw;
      skipped.push_back(skipped_row(csv, row, error.what()));
    }
  }
  std::ranges::stable_sort(skipped.begin() + first, skipped.end(), {}, &SkippedInput::line);
}

}  // namespace alidade
