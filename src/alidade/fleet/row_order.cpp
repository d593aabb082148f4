#include "alidade/fleet/row_order.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <sstream>

namespace alidade {
namespace {

constexpr std::size_t max_waiting = 256, min_waiting = 3;
constexpr double max_wait_s = 30.0;
constexpr std::int64_t stray_rows = 4096;  // a row that waits for so long is of no order
constexpr std::int64_t most_missing = 1'000'000'000'000;

std::string rows_word(std::int64_t num) { return fmt::format("{} row{}", num, num == 1 ? "" : "s"); }

}  // namespace

std::string sentence_of(const FleetNumbers& numbers) {
  std::string text;
  const auto add = [&text](const std::string& words, std::int64_t times) {
    text += (text.empty() ? "" : "; ") + words;
    if (times > 1) text += fmt::format(" {} times", times);
  };
  if (numbers.num_missing > 0) add(rows_word(numbers.num_missing) + " never came", 1);
  if (numbers.num_restarts > 0) add("its observer restarted", numbers.num_restarts);
  if (numbers.num_back > 0)
    add(fmt::format("its clock went back by {}{:.6g} s", numbers.num_back > 1 ? "up to " : "", numbers.most_back_s),
        numbers.num_back);
  return text;
}

std::string numbers_text(const FleetNumbers& numbers) {
  return fmt::format("{} {} {} {} {} {} {} {}", numbers.num_missing, numbers.num_restarts, numbers.begun_at,
                     numbers.read_to, numbers.num_back, numbers.most_back_s, numbers.first_t_s, numbers.last_t_s);
}

bool parse_numbers(const std::string& text, FleetNumbers& numbers) {
  std::istringstream in(text);
  std::string first, last;  // "nan" is read by strtod alone
  FleetNumbers read;
  in >> read.num_missing >> read.num_restarts >> read.begun_at >> read.read_to >> read.num_back >> read.most_back_s;
  if (!(in >> first >> last)) return false;
  read.first_t_s = std::strtod(first.c_str(), nullptr);
  read.last_t_s = std::strtod(last.c_str(), nullptr);
  numbers = read;
  return true;
}

void note_time(const FleetRow& row, FleetNumbers& numbers) {
  if (row.n == 1) numbers.first_t_s = row.t_s;
  if (!std::isfinite(row.t_s)) return;
  if (row.t_s < numbers.last_t_s) {
    ++numbers.num_back;
    numbers.most_back_s = std::max(numbers.most_back_s, numbers.last_t_s - row.t_s);
  }
  numbers.last_t_s = row.t_s;
}

bool FleetRowOrder::begins_anew(const FleetRow& row) const {
  if (row.n > n_) return false;
  return row.t_s > numbers_.last_t_s ||
         (row.n == 1 && std::isfinite(row.t_s) && std::isfinite(numbers_.first_t_s) && row.t_s != numbers_.first_t_s);
}

bool FleetRowOrder::is_given_up() const {
  if (waiting_.size() > max_waiting) return true;
  const double span_s = waiting_.rbegin()->second.row.t_s - waiting_.begin()->second.row.t_s;
  return waiting_.size() >= min_waiting && span_s > max_wait_s;
}

std::uint64_t FleetRowOrder::first_waiting_place() const {
  std::uint64_t place = std::numeric_limits<std::uint64_t>::max();
  for (const auto& [n, waiting] : waiting_) place = std::min(place, waiting.place);
  return place;
}

void FleetRowOrder::take(const FleetRow& row, std::int64_t num_missing, bool begins_anew, std::vector<Ready>& ready) {
  n_ = row.n;
  numbers_.num_missing = std::min(numbers_.num_missing + std::min(num_missing, most_missing), most_missing);
  if (begins_anew) numbers_.last_t_s = std::numeric_limits<double>::quiet_NaN();
  note_time(row, numbers_);
  ready.push_back({row, num_missing, begins_anew});
}

/// Those that wait and are next, or no longer wait.
void FleetRowOrder::release(bool all, std::vector<Ready>& ready) {
  while (!waiting_.empty()) {
    const auto first = waiting_.begin();
    const std::int64_t num_missing = first->first - n_ - 1;
    if (all && num_missing > stray_rows) break;
    if (num_missing > 0 && !all && !is_given_up()) break;
    take(first->second.row, num_missing, false, ready);
    waiting_.erase(first);
  }
  const auto is_stray = [this](const Waiting& waiting) { return waiting.n_then + stray_rows < n_; };
  while (!waiting_.empty() && is_stray(waiting_.rbegin()->second)) waiting_.erase(std::prev(waiting_.end()));
}

FleetRowOrder::Arrival FleetRowOrder::add(const FleetRow& row, std::uint64_t place, std::vector<Ready>& ready) {
  if (place < numbers_.begun_at) return Arrival::known;
  const bool was_read = place <= numbers_.read_to;
  numbers_.read_to = std::max(numbers_.read_to, place);
  if (row.n <= n_) {
    if (was_read) return Arrival::known;
    if (!begins_anew(row)) return Arrival::late;
    release(true, ready);
    waiting_.clear();
    numbers_.begun_at = place;
    ++numbers_.num_restarts;
    numbers_.first_t_s = std::numeric_limits<double>::quiet_NaN();
    take(row, row.n - 1, true, ready);
    return Arrival::ready;
  }
  if (row.n == n_ + 1) {
    take(row, 0, false, ready);
  } else if (!waiting_.try_emplace(row.n, Waiting{row, place, n_}).second) {
    return was_read ? Arrival::known : Arrival::late;
  }
  release(false, ready);
  return n_ >= row.n ? Arrival::ready : Arrival::waits;
}

}  // namespace alidade
