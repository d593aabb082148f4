#include "alidade/report/plain_page.h"

#include <algorithm>
#include <cmath>
#include <limits>
#include <nlohmann/json.hpp>

#include "alidade/report/markup.h"

namespace alidade::report {
namespace {

using Json = nlohmann::ordered_json;

constexpr std::size_t max_rows = 60;  // result.json has all of them
constexpr std::size_t max_leaves = 400;

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

std::string plus_minus(const ValueText& words) { return words.plus_minus.empty() ? "" : "± " + words.plus_minus; }

/// The element, or member, of a σ that belongs to one of a value.
const Json& beside(const Json& sigmas, const Json& value, const std::string& name, std::size_t index) {
  const bool has_element = sigmas.is_array() && index < sigmas.size();
  return has_element ? sigmas[index] : member(sigmas, value.is_object() ? name : "");
}

/// A row a leaf of the estimate; `sigmas` and `ideal` (σ if every single measurement erred by itself) walk along: σ has
/// the same path.
void append_leaves(std::string& rows, const std::string& path, const Json& value, const Json& sigmas, const Json& ideal,
                   std::size_t& leaves) {
  if (value.is_structured()) {
    std::size_t index = 0;
    for (const auto& [name, child] : value.items()) {
      append_leaves(rows, path.empty() ? name : path + (value.is_object() ? "." + name : "[" + name + "]"), child,
                    beside(sigmas, value, name, index), beside(ideal, value, name, index), leaves);
      ++index;
    }
    return;
  }
  if (++leaves > max_leaves) return;
  const ValueText words = value_text(number_of(value), number_of(sigmas));
  rows += "<tr><th>" + escaped(path) + "</th><td>" + (value.is_number() ? words.value : escaped(text_of(value))) +
          "</td><td>" + plus_minus(words) + "</td><td>" + plus_minus(value_text(number_of(value), number_of(ideal))) +
          "</td></tr>";
}

/// The assumptions, and their effect on the answer.
std::string assumed_markup(const Json& assumed) {
  if (!assumed.is_array() || assumed.empty()) return "";
  std::string rows;
  for (const Json& each : assumed) {
    const Json &value = member(each, "value"), &sigma = member(each, "sigma");
    const std::string known = sigma.is_null()           ? "not given"
                              : number_of(sigma) == 0.0 ? "exact"
                                                        : number_text(number_of(sigma));
    const std::string moved = text_of(member(each, "moved"));
    const std::string error =
        sigma.is_null() ? number_text(number_of(member(each, "ordinary"))) + " more or less" : "its σ";
    const Json& by = member(each, "moves");  // null: `moved` says it in a sentence
    rows += "<tr><th>" + escaped(text_of(member(each, "name"))) + "</th>" + cell(value) + "<td>" + known + "</td><td>" +
            (moved.empty()  ? ""
             : by.is_null() ? escaped(moved)
                            : escaped(error + " moves " + moved + " by ") + number_text(number_of(by)) + " of its σ") +
            "</td></tr>";
  }
  return "<h2>Taken as given</h2><table><tr><th>what</th><th>value</th><th>σ</th><th>effect</th></tr>" + rows +
         "</table>";
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
  for (std::size_t row = 0; row < std::min(num_rows, max_rows); ++row) {
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
  const Json &ideal = member(document, "stddev_model"), &assumed = member(document, "assumed");
  append_leaves(rows, "", member(document, "estimate"), member(document, "stddev"), ideal, leaves);
  if (ideal.is_object() && !ideal.empty())
    rows = "<tr><th></th><th>value</th><th>3σ</th><th>3σ if every measurement erred by itself</th></tr>" + rows;
  page += "<h2>Estimate, value ± 3σ</h2><table>" + rows + "</table>" + assumed_markup(assumed) + "<h2>Data</h2>";
  if (const Json& data = member(document, "data"); data.is_object())
    for (const auto& [name, columns] : data.items())
      if (columns.is_object()) page += table_markup(name, columns);
  return page + "<p>Built without figures; the numbers are in result.json beside this page.</p></body></html>\n";
}

}  // namespace alidade::report
