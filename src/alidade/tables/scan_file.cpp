#include "alidade/tables/scan_file.h"

#include <cmath>
#include <numbers>

#include "alidade/files/csv.h"

namespace alidade {
namespace {

double angle(const Csv& csv, std::size_t row, const std::string& column) {
  const double value = csv.number(row, column);
  if (std::abs(value) > 2.0 * std::numbers::pi)
    throw InputError(csv.where(row, column) + ": '" + csv.text(row, column) +
                     "' is beyond a full revolution; angles are radians");
  return value;
}

}  // namespace

std::vector<ScanRow> read_scan(const std::filesystem::path& file) { return read_scan(Csv::read(file)); }

std::vector<ScanRow> read_scan(const Csv& csv) {
  constexpr double max_m = 1000.0;
  std::vector<ScanRow> scan;
  for (std::size_t row = 0; row < csv.num_rows(); ++row) {
    ScanRow read{angle(csv, row, "pan"), angle(csv, row, "tilt"), csv.number(row, "range_m")};
    if (!(read.range_m > 0.0 && read.range_m <= max_m))
      throw InputError(csv.where(row, "range_m") + ": '" + csv.text(row, "range_m") + "' is not between 0 and 1000 m");
    scan.push_back(read);
  }
  if (scan.empty()) throw InputError(csv.name() + ": has no readings; at least one row is needed");
  return scan;
}

}  // namespace alidade
