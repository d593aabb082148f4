#include <algorithm>
#include <array>
#include <cmath>
#include <numbers>
#include <utility>

#include "alidade/files/csv.h"

namespace alidade {
namespace {

/// A unit as headers write it, the one that is asked for instead, and what it is of that.
struct Unit {
  std::string_view name, asked;
  double size;
};
constexpr std::array<Unit, 12> units{Unit{"s", "s", 1.0},
                                     {"ms", "s", 1e-3},
                                     {"us", "s", 1e-6},
                                     {"ns", "s", 1e-9},
                                     {"rad", "rad", 1.0},
                                     {"deg", "rad", std::numbers::pi / 180.0},
                                     {"m", "m", 1.0},
                                     {"mm", "m", 1e-3},
                                     {"cm", "m", 1e-2},
                                     {"px", "px", 1.0},
                                     {"°", "rad", std::numbers::pi / 180.0},
                                     {"µs", "s", 1e-6}};

const Unit* unit_called(std::string_view name) {
  const auto* const unit = std::ranges::find(units, name, &Unit::name);
  return unit == units.end() ? nullptr : unit;
}

/// Words that mean the same column, the first of which is asked for, with the unit of one that names none; 0: a clock.
struct Word {
  std::string_view name, asked;
  double size, unnamed_unit;
  std::string_view unit;
};
constexpr std::array<Word, 9> words{
    Word{"t", "t", 1.0, 0.0, "s"},         {"time", "t", 1.0, 0.0, "s"},
    {"timestamp", "t", 1.0, 0.0, "s"},     {"pan", "pan", 1.0, 1.0, "rad"},
    {"yaw", "pan", 1.0, 1.0, "rad"},       {"azimuth", "pan", -1.0, 1.0, "rad"},  // to the right, as a compass does
    {"tilt", "tilt", 1.0, 1.0, "rad"},     {"pitch", "tilt", 1.0, 1.0, "rad"},
    {"elevation", "tilt", 1.0, 1.0, "rad"}};

std::string_view without_mark(std::string_view text) {
  while (text.starts_with('#') || text.starts_with('%')) text = csv_trimmed(text.substr(1));
  return text;
}

/// "pan [deg]" and "pan(deg)" as its name and what stands in the brackets.
std::pair<std::string_view, std::string_view> name_and_brackets(std::string_view column) {
  const std::size_t open = column.find_last_of("[(");
  if (open == std::string_view::npos || open == 0 || !(column.ends_with(']') || column.ends_with(')')))
    return {column, {}};
  return {csv_trimmed(column.substr(0, open)), column.substr(open + 1, column.size() - open - 2)};
}

/// A column whose name never has its unit: "p12x [px]", "omega_x [rad/s]".
bool is_named_without(std::string_view name, std::string_view unit) {
  if (unit == "rad/s") return name.starts_with("omega_") && name.size() == 7;
  const bool is_point =
      unit == "px" && name.size() > 2 && name.starts_with('p') && (name.back() == 'x' || name.back() == 'y');
  return is_point && std::ranges::all_of(name.substr(1, name.size() - 2), [](char c) { return c >= '0' && c <= '9'; });
}

std::string tidy_name(std::string_view column) {
  const auto [name, brackets] = name_and_brackets(column);
  const Unit* const unit = unit_called(csv_trimmed(brackets));
  if (is_named_without(name, csv_trimmed(brackets))) return std::string(name);
  if (unit == nullptr) return std::string(column);
  const std::string_view ascii = unit->name == "°" ? "deg" : unit->name == "µs" ? "us" : unit->name;
  return std::string(name) + "_" + std::string(ascii);
}

/// What a column may be asked for beside its name, and its unit then.
std::vector<std::pair<std::string, double>> other_names(const std::string& column) {
  const std::size_t at = column.rfind('_');
  const Unit* const unit = at == std::string::npos ? nullptr : unit_called(std::string_view(column).substr(at + 1));
  const std::string stem = unit == nullptr ? column : column.substr(0, at);
  std::vector<std::pair<std::string, double>> names;
  if (unit != nullptr && unit->name != unit->asked)
    names.emplace_back(stem + "_" + std::string(unit->asked), unit->size);
  const auto* const word = std::ranges::find(words, stem, &Word::name);
  if (word == words.end() || (unit != nullptr && unit->asked != word->unit)) return names;
  const double size = word->size * (unit == nullptr ? word->unnamed_unit : unit->size);
  names.emplace_back(std::string(word->asked) + "_" + std::string(word->unit), size);
  return names;
}

std::string at_header(const CsvRow& header, const std::string& name) {
  return name + ":" + std::to_string(header.line) + ": ";
}

}  // namespace

std::string_view csv_trimmed(std::string_view text) {
  const auto is_space = [](char c) { return c == ' ' || c == '\t'; };
  while (!text.empty() && is_space(text.front())) text.remove_prefix(1);
  while (!text.empty() && is_space(text.back())) text.remove_suffix(1);
  return text;
}

/// Clocks count seconds, or their thousandths since 1970, which no log in seconds reaches.
double csv_time_s(const std::string& cell, double unit_s, const CsvPlace& place) {
  constexpr double min_ms = 1e11, min_us = 1e14, min_ns = 1e17, largest_ns = 1e19;
  const std::optional<double> value = finite_number(cell);
  if (value && unit_s == 0.0) unit_s = *value < min_ms ? 1.0 : *value < min_us ? 1e-3 : *value < min_ns ? 1e-6 : 1e-9;
  const bool is_clock = value && std::abs(*value) < largest_ns && unit_s < 1.0;
  if (!is_clock) return (unit_s == 0.0 ? 1.0 : unit_s) * csv_number(cell, place);
  return *value / std::round(1.0 / unit_s);  // rounded once: 150 ms and 150000000 ns are the same time
}

char csv_separator(std::string_view text) {
  const std::string_view header = text.substr(0, text.find_first_of("\r\n"));
  const auto has = [header](char c) { return header.find(c) != std::string_view::npos; };
  return has(',') ? ',' : has(';') ? ';' : has('\t') ? '\t' : ',';
}

bool is_csv_comment(std::string_view line) {
  line = csv_trimmed(line.substr(0, line.find_first_of("\r\n")));
  if (!line.starts_with('#') && !line.starts_with('%')) return false;
  const char separator = csv_separator(line);
  if (line.find(separator) == std::string_view::npos) return true;
  line = without_mark(line);
  for (bool is_last = false; !is_last;) {
    const std::size_t end = line.find(separator);
    is_last = end == std::string_view::npos;
    const std::string_view name = name_and_brackets(csv_trimmed(line.substr(0, end))).first;
    if (name.empty() || name.find(' ') != std::string_view::npos) return true;
    if (!is_last) line.remove_prefix(end + 1);
  }
  return false;
}

std::map<std::string, CsvColumn> csv_columns(CsvRow& header, const std::string& name) {
  std::map<std::string, CsvColumn> columns;
  for (std::size_t i = 0; i < header.cells.size(); ++i) {
    std::string& column = header.cells[i];
    column = tidy_name(i == 0 ? without_mark(column) : std::string_view(column));
    if (column.empty()) throw InputError(at_header(header, name) + "column " + std::to_string(i + 1) + " has no name");
    if (!columns.emplace(column, CsvColumn{i}).second)
      throw InputError(at_header(header, name) + "column '" + column + "' appears twice in the header");
  }
  constexpr std::size_t unclear = std::string::npos;  // two that mean the same
  std::map<std::string, CsvColumn> others;
  for (std::size_t i = 0; i < header.cells.size(); ++i)
    for (const auto& [other, unit] : other_names(header.cells[i])) {
      if (columns.contains(other)) continue;
      const auto [known, is_new] = others.emplace(other, CsvColumn{i, unit});
      if (!is_new && known->second.at != i) known->second.at = unclear;
    }
  std::erase_if(others, [](const auto& other) { return other.second.at == unclear; });
  columns.merge(others);
  return columns;
}

}  // namespace alidade
