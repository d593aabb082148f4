#include "alidade/files/table_rows.h"

namespace alidade {

SkippedInput skipped_row(const Csv& csv, std::size_t row, std::string reason) {
  const std::string place = csv.name() + ":" + std::to_string(csv.line(row)) + ": ";
  if (reason.starts_with(place)) reason.erase(0, place.size());
  return {csv.name(), csv.line(row), std::move(reason)};
}

void for_each_row(const Csv& csv, bool skip_bad, std::vector<SkippedInput>& skipped,
                  const std::function<void(std::size_t row)>& read) {
  for (std::size_t row = 0; row < csv.num_rows(); ++row) {
    try {
      read(row);
    } catch (const InputError& error) {
      if (!skip_bad) throw;
      skipped.push_back(skipped_row(csv, row, error.what()));
    }
  }
}

}  // namespace alidade
