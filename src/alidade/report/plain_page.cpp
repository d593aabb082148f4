#include "alidade/report/plain_page.h"

#include <algorithm>
#include <cmath>
#include <limits>
#include <nlohmann/json.hpp>

#include "alidade/report/markup.h"

namespace alidade::report {
namespace {

using Json = nlohmann::ordered_json;

constexpr std::size_t most_rows = 60;  // result.json has all of them
constexpr std::size_t most_leaves = 400;

const Json& member(const Json& object, const std::string& name) {
  static const Json null;
  const auto found = object.is_object() ? object.find(name) : object.end();
  return object.is_object() && found != object.end() ? *found : null;
}

std::string text_of(const Json& value) {
  if (value.is_null()) return "";
  if (value.is_string()) return value.get<std::string>();
  return value.dump(-1, ' ', false, Json::error_handler_t::replace);
}

double number_of(const Json& value) {
  return value.is_number() ? value.get<double>() : std::numeric_limits<double>::quiet_NaN();
}

std::string cell(const Json& value) {
  return "<td>" + (value.is_number() ? number_text(number_of(value), 6) : escaped(text_of(value))) + "</td>";
}

/// A row a leaf of the estimate; `sigmas` walks along: σ has the same path.
void append_leaves(std::string& rows, const std::string& path, const Json& value, const Json& sigmas,
                   std::size_t& leaves) {
  if (value.is_structured()) {
    std::size_t index = 0;
    for (const auto& [name, child] : value.items()) {
      const bool has_element = sigmas.is_array() && index < sigmas.size();
      const Json& sigma = has_element ? sigmas[index] : member(sigmas, value.is_object() ? name : "");
      ++index;
      append_leaves(rows, path.empty() ? name : path + (value.is_object() ? "." + name : "[" + name + "]"), child,
                    sigma, leaves);
    }
    return;
  }
  if (++leaves > most_leaves) return;
  const ValueText words = value_text(number_of(value), number_of(sigmas));
  rows += "<tr><th>" + escaped(path) + "</th><td>" + (value.is_number() ? words.value : escaped(text_of(value))) +
          "</td><td>" + (words.plus_minus.empty() ? "" : "± " + words.plus_minus) + "</td></tr>";
}

std::string table_markup(const std::string& name, const Json& columns) {
  std::size_t num_rows = 0;
  std::string head;
  for (const auto& [column, values] : columns.items()) {
    if (!values.is_array()) continue;
    num_rows = std::max(num_rows, values.size());
    head += "<th>" + escaped(column) + "</th>";
  }
  std::string out = "<details><summary>" + escaped(name) + ", " + std::to_string(num_rows) +
                    " rows</summary><table><tr>" + head + "</tr>";
  for (std::size_t row = 0; row < std::min(num_rows, most_rows); ++row) {
    out += "<tr>";
    for (const auto& [column, values] : columns.items())
      if (values.is_array()) out += row < values.size() ? cell(values[row]) : "<td></td>";
    out += "</tr>";
  }
  return out + "</table></details>";
}

std::string checks_markup(const Json& checks) {
  std::string items;
  if (checks.is_array())
    for (const Json& check : checks)
      items += "<li>" + escaped(text_of(member(check, "state"))) + ": <b>" + escaped(text_of(member(check, "name"))) +
               "</b> " + escaped(text_of(member(check, "text"))) + "</li>";
  return items.empty() ? "" : "<ul>" + items + "</ul>";
}

}  // namespace

std::string plain_page(std::string_view result_json) {
  const Json document = Json::parse(result_json, nullptr, false);
  const Json& verdict = member(document, "verdict");
  const std::string command = escaped(text_of(member(document, "command")));
  std::string page =
      "<!DOCTYPE html>\n<html lang=\"en\"><head><meta charset=\"utf-8\"><title>alidade " + command +
      "</title><style>body{font:15px/1.5 sans-serif;margin:2em}th,td{text-align:left;padding:0 1em 0 0}</style></head>"
      "<body><p>alidade " +
      command + "</p>";
  if (!document.is_object()) return page + "<h1>The result document cannot be read.</h1></body></html>\n";
  page += "<h1>" + escaped(text_of(member(verdict, "state"))) + ": " + escaped(text_of(member(verdict, "sentence"))) +
          "</h1>";
  if (const std::string add = text_of(member(verdict, "to_add")); !add.empty())
    page += "<p>What to do: " + escaped(add) + "</p>";
  page += checks_markup(member(verdict, "checks"));
  std::string rows;
  std::size_t leaves = 0;
  append_leaves(rows, "", member(document, "estimate"), member(document, "stddev"), leaves);
  page += "<h2>Estimate, value ± 3σ</h2><table>" + rows + "</table><h2>Data</h2>";
  if (const Json& data = member(document, "data"); data.is_object())
    for (const auto& [name, columns] : data.items())
      if (columns.is_object()) page += table_markup(name, columns);
  return page + "<p>Built without figures; the numbers are in result.json beside this page.</p></body></html>\n";
}

}  // namespace alidade::report
