#include "alidade/results/thin_tables.h"

#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <string_view>

#include "alidade/report/thin.h"

namespace alidade {
namespace {

using KeptRows = std::vector<std::size_t>;

template <typename Content>
constexpr bool is_row_list = std::is_same_v<Content, std::vector<double>> || std::is_same_v<Content, JsonValue::List> ||
                             std::is_same_v<Content, std::vector<std::int64_t>>;

std::size_t num_rows(const JsonValue& column) {
  return std::visit(
      [](const auto& content) -> std::size_t {
        if constexpr (is_row_list<std::decay_t<decltype(content)>>) return content.size();
        return 0;
      },
      column.content());
}

/// 0 where columns differ in length: result_text() says so.
std::size_t num_rows(const DataTable& table) {
  if (table.columns.empty()) return 0;
  const std::size_t count = num_rows(table.columns.front().second);
  const bool is_table = std::all_of(table.columns.begin(), table.columns.end(),
                                    [&](const auto& column) { return num_rows(column.second) == count; });
  return is_table ? count : 0;
}

/// The rows of a column; what is no list is left as it is.
JsonValue picked(const JsonValue& column, const KeptRows& rows) {
  return std::visit(
      [&](const auto& content) -> JsonValue {
        using Content = std::decay_t<decltype(content)>;
        if constexpr (is_row_list<Content>) {
          Content kept;
          kept.reserve(rows.size());
          for (const std::size_t row : rows) kept.push_back(content[row]);
          return kept;
        }
        return column;
      },
      column.content());
}

/// A column of numbers that shows how a row fits.
bool shows_the_fit(std::string_view name) {
  return name.starts_with("residual") || name.starts_with("innovation") || name == "nis" || name == "rms_px";
}

/// Marks the rows that a column flags: weight 0, used or accepted false, an event or a reason.
void flag_rows(const std::string& name, const JsonValue& column, std::vector<bool>& flagged) {
  if (const auto* numbers = std::get_if<std::vector<double>>(&column.content()); numbers && name == "weight") {
    for (std::size_t i = 0; i < numbers->size(); ++i) flagged[i] = flagged[i] || (*numbers)[i] == 0.0;
  }
  const auto* list = std::get_if<JsonValue::List>(&column.content());
  if (list == nullptr) return;
  const bool is_use = name == "used" || name == "accepted", is_event = name == "event" || name == "reason";
  for (std::size_t i = 0; i < list->size() && (is_use || is_event); ++i) {
    const auto* flag = std::get_if<bool>(&(*list)[i].content());
    const auto* word = std::get_if<std::string>(&(*list)[i].content());
    if ((is_use && flag && !*flag) || (is_event && word && !word->empty())) flagged[i] = true;
  }
}

/// Where most rows are flagged, no row is special: evenly spread ones stand for them.
void keep_at_most(std::size_t most, std::vector<bool>& flagged) {
  const auto count = static_cast<std::size_t>(std::count(flagged.begin(), flagged.end(), true));
  if (count <= most) return;
  std::size_t seen = 0;
  for (std::size_t i = 0; i < flagged.size(); ++i) {
    if (!flagged[i]) continue;
    flagged[i] = (seen + 1) * most / count > seen * most / count;
    ++seen;
  }
}

std::string cell_text(const JsonValue& column, std::size_t row) {
  const auto of_text = [](const std::string& text) {
    if (text.find_first_of(",\"\r\n") == std::string::npos) return text;
    std::string quoted = "\"";
    for (const char c : text) quoted += c == '"' ? std::string("\"\"") : std::string(1, c);
    return quoted + "\"";
  };
  if (const auto* numbers = std::get_if<std::vector<double>>(&column.content())) {
    return std::isfinite((*numbers)[row]) ? fmt::format("{}", (*numbers)[row]) : "";
  }
  if (const auto* whole = std::get_if<std::vector<std::int64_t>>(&column.content()))
    return std::to_string((*whole)[row]);
  const auto* list = std::get_if<JsonValue::List>(&column.content());
  if (list == nullptr) return "";
  const auto* text = std::get_if<std::string>(&(*list)[row].content());
  if (text != nullptr) return of_text(*text);
  const std::string other = (*list)[row].text();
  return other == "null" ? "" : of_text(other);
}

std::string table_csv(const DataTable& table) {
  std::string csv;
  for (const auto& [name, column] : table.columns) csv += (csv.empty() ? "" : ",") + name;
  csv += "\n";
  const std::size_t count = num_rows(table);
  for (std::size_t row = 0; row < count; ++row) {
    for (std::size_t k = 0; k < table.columns.size(); ++k) {
      csv += (k > 0 ? "," : "") + cell_text(table.columns[k].second, row);
    }
    csv += "\n";
  }
  return csv;
}

std::string how_thinned(const std::string& extremes_of, const std::string& besides, const std::string& all_in) {
  std::string how = "of equal buckets of rows the first";
  if (!extremes_of.empty()) how += " and those with the smallest and the largest " + extremes_of;
  return how + "; besides " + besides + "; all rows are in " + all_in;
}

void thin_table(DataTable& table, std::size_t most) {
  const std::size_t count = num_rows(table);
  std::vector<bool> flagged(count, false);
  std::vector<std::vector<double>> fits;
  std::string names;
  for (const auto& [name, column] : table.columns) {
    flag_rows(name, column, flagged);
    const auto* numbers = std::get_if<std::vector<double>>(&column.content());
    if (numbers == nullptr || !shows_the_fit(name) || fits.size() == 4) continue;
    names += (names.empty() ? "" : ", ") + name;
    fits.push_back(*numbers);
  }
  keep_at_most(most / 2, flagged);
  const auto num_flagged = static_cast<std::size_t>(std::count(flagged.begin(), flagged.end(), true));
  const KeptRows rows = report::thinned_rows(count, fits, flagged, most - num_flagged - 1);
  for (auto& [name, column] : table.columns) column = picked(column, rows);
  if (table.thinned) {  // once more, for the size of the whole
    table.thinned->to = rows.size();
    return;
  }
  table.thinned = Thinned{count, rows.size(),
                          how_thinned(names, "the rows that were rejected or have an event", table.name + "_all.csv")};
}

}  // namespace

void record_steps_kept(DataTable& table, std::size_t from, const std::string& extremes_of, const std::string& all_in) {
  const std::size_t to = num_rows(table);
  if (to != from) table.thinned = Thinned{from, to, how_thinned(extremes_of, "the rows with an event", all_in)};
}

std::string result_text_of_size(ResultDocument& document,
                                const std::function<void(std::string, std::string)>& add_file) {
  constexpr std::size_t fewest_rows = 500;  // beyond them it is not the tables that are large
  std::string text;
  for (double share = 1.0; share > 0.01; share *= 0.75) {
    bool is_thinner = text.empty();
    for (DataTable& table : document.data) {
      const double max_rows = table.name == "corners" ? max_corner_rows : max_table_rows;
      const auto most = std::max(fewest_rows, static_cast<std::size_t>(share * max_rows));
      if (num_rows(table) <= most) continue;
      if (!table.thinned) add_file(table.name + "_all.csv", table_csv(table));
      thin_table(table, most);
      is_thinner = true;
    }
    if (is_thinner) text = result_text(document);
    if (text.size() <= max_result_bytes) break;
  }
  return text;
}

}  // namespace alidade
