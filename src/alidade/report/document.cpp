#include "alidade/report/document.h"

#include <algorithm>
#include <limits>
#include <nlohmann/json.hpp>

namespace alidade::report {
namespace {

using Json = nlohmann::ordered_json;

constexpr double missing = std::numeric_limits<double>::quiet_NaN();
constexpr std::size_t max_estimate_leaves = 400;  // more than that is a table, and stands in `data`

const Json& member(const Json& object, const char* name) {
  static const Json null;
  if (!object.is_object()) return null;
  const auto found = object.find(name);
  return found == object.end() ? null : *found;
}

double number_of(const Json& value) {
  if (value.is_boolean()) return value.get<bool>() ? 1.0 : 0.0;
  return value.is_number() ? value.get<double>() : missing;
}

std::string text_of(const Json& value) {
  if (value.is_null()) return "";
  if (value.is_string()) return value.get<std::string>();
  return value.dump(-1, ' ', false, Json::error_handler_t::replace);
}

std::string text_of(const Json& object, const char* name) { return text_of(member(object, name)); }

Column read_column(const std::string& name, const Json& values) {
  Column column{.name = name, .numbers = {}, .texts = {}};
  const bool is_text = std::any_of(values.begin(), values.end(), [](const Json& v) { return v.is_string(); });
  for (const Json& value : values) {
    if (is_text) column.texts.push_back(text_of(value));
    column.numbers.push_back(number_of(value));
  }
  return column;
}

Table read_table(const Json& columns) {
  Table table;
  for (const auto& [name, values] : columns.items()) {
    if (!values.is_array()) continue;
    table.columns.push_back(read_column(name, values));
    table.num_rows = std::max(table.num_rows, values.size());
  }
  for (Column& column : table.columns) {
    if (!column.texts.empty()) column.texts.resize(table.num_rows);
    column.numbers.resize(table.num_rows, missing);
  }
  return table;
}

Grid read_grid(const Json& json) {
  Grid grid;
  const auto value_or = [&](const char* name, double otherwise) {
    const double value = number_of(member(json, name));
    return value == value ? value : otherwise;
  };
  grid.cols = static_cast<int>(std::clamp(value_or("cols", 0.0), 0.0, 1e5));
  grid.rows = static_cast<int>(std::clamp(value_or("rows", 0.0), 0.0, 1e5));
  grid.u0_px = value_or("u0_px", 0.0);
  grid.v0_px = value_or("v0_px", 0.0);
  grid.du_px = value_or("du_px", 1.0);
  grid.dv_px = value_or("dv_px", 1.0);
  for (const auto& [name, values] : json.items())
    if (values.is_array()) grid.values[name] = read_column(name, values).numbers;
  return grid;
}

// `sigmas` walks along with `value`: σ has the same path.
void flatten(const std::string& path, const Json& value, const Json& sigmas, std::vector<Quantity>& out) {
  if (out.size() >= max_estimate_leaves) return;
  if (value.is_object()) {
    for (const auto& [name, child] : value.items())
      flatten(path.empty() ? name : path + "." + name, child, member(sigmas, name.c_str()), out);
  } else if (value.is_array()) {
    static const Json null;
    for (std::size_t i = 0; i < value.size(); ++i)
      flatten(path + "[" + std::to_string(i) + "]", value[i], sigmas.is_array() && i < sigmas.size() ? sigmas[i] : null,
              out);
  } else {
    out.push_back({path, value.is_boolean() ? missing : number_of(value), number_of(sigmas),
                   value.is_number() ? "" : text_of(value)});
  }
}

void read_verdict(const Json& verdict, Document& document) {
  document.state = text_of(verdict, "state");
  document.sentence = text_of(verdict, "sentence");
  document.to_add = text_of(verdict, "to_add");
  if (const Json& checks = member(verdict, "checks"); checks.is_array())
    for (const Json& check : checks)
      document.checks.push_back({text_of(check, "name"), text_of(check, "state"), text_of(check, "text"),
                                 text_of(check, "figure"), number_of(member(check, "value")),
                                 number_of(member(check, "limit")), text_of(check, "unit")});
}

void read_provenance(const Json& json, Document& document) {
  document.command = text_of(json, "command");
  document.version = text_of(json, "version");
  document.created_utc = text_of(json, "created_utc");
  document.seed = text_of(json, "seed");
  if (const Json& argv = member(json, "argv"); argv.is_array())
    for (const Json& word : argv) document.argv.push_back(text_of(word));
  if (const Json& seconds = member(json, "seconds"); seconds.is_object())
    for (const auto& [name, value] : seconds.items()) document.seconds.emplace_back(name, number_of(value));
  if (const Json& inputs = member(json, "inputs"); inputs.is_array())
    for (const Json& input : inputs)
      document.inputs.push_back({text_of(input, "role"), text_of(input, "name"), text_of(input, "sha256"),
                                 number_of(member(input, "bytes"))});
}

void read_counts(const Json& counts, Document& document) {
  if (!counts.is_object()) return;
  for (const auto& [name, value] : counts.items()) {
    if (value.is_number()) document.counts.emplace_back(name, number_of(value));
  }
  if (const Json& skipped = member(counts, "skipped"); skipped.is_array())
    for (const Json& one : skipped)
      document.skipped.push_back({text_of(one, "file"), text_of(one, "reason"), number_of(member(one, "line"))});
}

void read_numbers(const Json& json, Document& document) {
  flatten("", member(json, "estimate"), member(json, "stddev"), document.estimate);
  const Json& covariance = member(json, "covariance");
  if (const Json& names = member(covariance, "names"); names.is_array())
    for (const Json& name : names) document.covariance_names.push_back(text_of(name));
  if (const Json& upper = member(covariance, "upper"); upper.is_array())
    document.covariance_upper = read_column("upper", upper).numbers;
  if (const Json& data = member(json, "data"); data.is_object())
    for (const auto& [name, columns] : data.items())
      if (columns.is_object()) document.data[name] = read_table(columns);
  if (const Json& grids = member(json, "grids"); grids.is_object())
    for (const auto& [name, grid] : grids.items())
      if (grid.is_object()) document.grids[name] = read_grid(grid);
}

}  // namespace

const Column* Table::find(std::string_view name) const {
  const auto found = std::find_if(columns.begin(), columns.end(), [&](const Column& c) { return c.name == name; });
  return found == columns.end() ? nullptr : &*found;
}

double Table::number(std::string_view name, std::size_t row) const {
  const Column* column = find(name);
  return column && row < num_rows ? column->numbers[row] : missing;
}

std::vector<double> Table::numbers(std::string_view name) const {
  const Column* column = find(name);
  return column ? column->numbers : std::vector<double>(num_rows, missing);
}

std::string Table::text(std::string_view name, std::size_t row) const {
  const Column* column = find(name);
  return column && row < column->texts.size() ? column->texts[row] : "";
}

std::vector<double> Grid::value(const std::string& name) const {
  const auto found = values.find(name);
  const std::size_t expected = static_cast<std::size_t>(cols) * static_cast<std::size_t>(rows);
  return found == values.end() || found->second.size() != expected ? std::vector<double>{} : found->second;
}

const Table* Document::table(const std::string& name) const {
  const auto found = data.find(name);
  return found == data.end() || found->second.num_rows == 0 ? nullptr : &found->second;
}

const Grid* Document::grid(const std::string& name) const {
  const auto found = grids.find(name);
  if (found == grids.end() || found->second.cols < 2 || found->second.rows < 2) return nullptr;
  return found->second.du_px > 0.0 && found->second.dv_px > 0.0 ? &found->second : nullptr;
}

double Document::estimated(std::string_view path) const {
  const auto found = std::find_if(estimate.begin(), estimate.end(), [&](const Quantity& q) { return q.path == path; });
  return found == estimate.end() ? missing : found->value;
}

std::string Document::estimated_text(std::string_view path) const {
  const auto found = std::find_if(estimate.begin(), estimate.end(), [&](const Quantity& q) { return q.path == path; });
  return found == estimate.end() ? "" : found->text;
}

Document read_document(std::string_view json) {
  Document document;
  const Json parsed = Json::parse(json, nullptr, false);
  if (!parsed.is_object()) return document;
  document.readable = true;
  read_provenance(parsed, document);
  read_verdict(member(parsed, "verdict"), document);
  read_counts(member(parsed, "counts"), document);
  read_numbers(parsed, document);
  return document;
}

}  // namespace alidade::report
