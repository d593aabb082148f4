#include <algorithm>
#include <cmath>
#include <numbers>

#include "alidade/servo/identify/identify_causes.h"
#include "alidade/servo/identify/sampled_log.h"

// Spurious angles: a bit lost in transmission, a row of another axis.

namespace alidade {
namespace {

/// The third largest difference of neighbouring rows within eight rows around [first, last], so that another spike (of
/// two differences) does not count.
double usual_change(std::span<const ServoSample> log, std::size_t first, std::size_t last) {
  constexpr std::size_t near = 8, of_another = 2;
  std::vector<double> changes;
  for (std::size_t i = first > near ? first - near : 1; i < std::min(last + near + 2, log.size()); ++i)
    if (i < first || i > last + 1) changes.push_back(std::abs(log[i].angle_rad - log[i - 1].angle_rad));
  if (changes.size() <= of_another) return 0.0;
  std::ranges::sort(changes, std::greater{});
  return changes[of_another];
}

bool is_turn(double by_rad) {
  constexpr double about_rad = 0.5;
  return std::abs(std::abs(by_rad) - 2.0 * std::numbers::pi) < about_rad;
}

}  // namespace

std::vector<std::size_t> spikes(std::span<const ServoSample> log) {
  constexpr std::size_t longest = 3;
  constexpr double far = 10.0, least_steps = 5.0, least_rad = 1e-6;
  const double step_rad = encoder_step_rad(log);
  std::vector<std::size_t> rows;
  // Distance of rows [i, i + num) from the row before and the row after them, if on the same side; otherwise 0.
  const auto off_by = [&](std::size_t i, std::size_t num) {
    const double in = i > 0 ? log[i].angle_rad - log[i - 1].angle_rad : log[i].angle_rad - log[i + num].angle_rad;
    const double out = log[i + num - 1].angle_rad - log[i + num].angle_rad;
    if (in * out <= 0.0 || is_turn(in) || is_turn(out)) return 0.0;
    return std::min(std::abs(in), std::abs(out));
  };
  for (std::size_t i = 0; i + 1 < log.size();) {
    std::size_t found = 0;
    for (std::size_t num = 1; num <= longest && found == 0 && i + num < log.size(); ++num) {
      const double by_rad = off_by(i, num), usual_rad = usual_change(log, i, i + num - 1);
      if (!(by_rad > std::max({least_rad, least_steps * step_rad, far * usual_rad}))) continue;
      // For the first rows only the rows after them show which ones are the spike.
      const bool is_followed = i > 0 || i + num + 1 >= log.size() ||
                               std::abs(log[i + num + 1].angle_rad - log[i + num].angle_rad) < 0.5 * by_rad;
      if (is_followed) found = num;
    }
    for (std::size_t k = 0; k < found; ++k) rows.push_back(i + k);
    i += std::max<std::size_t>(found, 1);
  }
  return rows;
}

std::vector<ServoSample> without_rows(std::span<const ServoSample> log, const std::vector<std::size_t>& rows) {
  std::vector<ServoSample> kept;
  for (std::size_t i = 0; i < log.size(); ++i) {
    if (std::ranges::binary_search(rows, i)) continue;
    ServoSample row = log[i];
    // Its command was given in the first of the removed rows before it that have the same command.
    std::size_t first = i;
    while (first > 0 && std::ranges::binary_search(rows, first - 1) && log[first - 1].command == row.command) --first;
    const bool is_given_there = first < i && first > 0 && log[first - 1].command != row.command;
    if (is_given_there && std::isnan(row.command_t_s)) row.command_t_s = log[first].given_s();
    kept.push_back(row);
  }
  return kept;
}

}  // namespace alidade
