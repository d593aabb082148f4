#include <fmt/format.h>

#include <algorithm>
#include <cmath>

#include "alidade/report/figures.h"
#include "alidade/report/markup.h"

namespace alidade::report {
namespace {

constexpr std::size_t most_rows = 60;  // all rows are in the download

std::string cell(const Column& column, std::size_t row) {
  if (!column.texts.empty())
    return "<td class=\"word\">" + (column.texts[row].empty() ? "–" : escaped(column.texts[row])) + "</td>";
  return "<td>" + number_text(column.numbers[row], 6) + "</td>";
}

std::string markup(const std::string& name, const Table& table) {
  const std::size_t shown = std::min(most_rows, table.num_rows);
  std::string out =
      fmt::format("<details><summary>{} · {} rows</summary><p><button data-csv=\"{}\">{}.csv</button>{}</p>",
                  escaped(name), table.num_rows, escaped(name), escaped(name),
                  shown < table.num_rows ? fmt::format(" the first {} rows:", shown) : "");
  out += "<div class=\"scroll\"><table class=\"data\"><thead><tr>";
  for (const Column& column : table.columns) out += "<th>" + escaped(column.name) + "</th>";
  out += "</tr></thead><tbody>";
  for (std::size_t row = 0; row < shown; ++row) {
    out += "<tr>";
    for (const Column& column : table.columns) out += cell(column, row);
    out += "</tr>";
  }
  return out + "</tbody></table></div></details>";
}

}  // namespace

std::string data_tables(const Document& document) {
  std::string out;
  for (const auto& [name, table] : document.data) out += markup(name, table);
  return out;
}

}  // namespace alidade::report
