#include "alidade/tables/logs/head_column.h"

#include <algorithm>
#include <cmath>

namespace alidade {

std::size_t head_in_row(const Csv& csv, std::size_t row, std::span<const RigHead> heads) {
  const long id = csv.integer(row, "head", -1000000, 1000000);
  const auto at = std::ranges::find_if(heads, [id](const RigHead& head) { return head.head.id == id; });
  if (at == heads.end()) {
    std::string known;
    for (const RigHead& head : heads) known += (known.empty() ? "" : ", ") + std::to_string(head.head.id);
    throw InputError(csv.where(row, "head") + ": '" + csv.text(row, "head") + "' is not a head of the rig (" + known +
                     ")");
  }
  return static_cast<std::size_t>(at - heads.begin());
}

double angle_in_row(const Csv& csv, std::size_t row, const std::string& column) {
  constexpr double max_rad = 1e4;
  const double angle_rad = csv.number(row, column);
  if (std::abs(angle_rad) > max_rad)
    throw InputError(csv.where(row, column) + ": '" + csv.text(row, column) + "' is no angle in radians");
  return angle_rad;
}

}  // namespace alidade
