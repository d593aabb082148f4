#include "alidade/results/result_document.h"

#include <stdexcept>

namespace alidade {
namespace {

JsonValue text_or_null(const std::string& text) { return text.empty() ? JsonValue() : JsonValue(text); }

std::size_t length_of(const JsonValue& column) {
  return std::visit(
      [](const auto& content) -> std::size_t {
        if constexpr (requires { content.capacity(); } && !std::is_same_v<decltype(content), const std::string&>) {
          return content.size();
        }
        throw std::logic_error("a column of a result table is not a list");
      },
      column.content());
}

JsonValue check_value(const Check& check) {
  JsonValue value = JsonValue::object();
  value["name"] = check.name;
  value["state"] = state_name(check.state);
  value["text"] = check.text;
  value["value"] = check.value;
  value["limit"] = check.limit;
  value["unit"] = check.unit;
  value["figure"] = text_or_null(check.figure);
  return value;
}

JsonValue verdict_value(const Verdict& verdict) {
  JsonValue value = JsonValue::object();
  value["state"] = state_name(verdict.state);
  value["exit_code"] = static_cast<int>(verdict.exit_code);
  value["sentence"] = verdict.sentence;
  value["to_add"] = text_or_null(verdict.to_add);
  value["checks"] = JsonValue::list();
  for (const Check& check : verdict.checks) value["checks"].push_back(check_value(check));
  return value;
}

JsonValue inputs_value(const std::vector<InputFile>& inputs) {
  JsonValue list = JsonValue::list();
  for (const InputFile& input : inputs) {
    JsonValue value = JsonValue::object();
    value["role"] = input.role;
    value["name"] = input.name;
    value["bytes"] = input.bytes;
    value["sha256"] = input.sha256;
    list.push_back(std::move(value));
  }
  return list;
}

JsonValue counts_value(const Counts& counts) {
  JsonValue value = JsonValue::object();
  value["given"] = counts.given;
  value["used"] = counts.used;
  value["dropped"] = counts.dropped;
  value["skipped"] = JsonValue::list();
  for (const SkippedInput& skipped : counts.skipped) {
    JsonValue row = JsonValue::object();
    row["file"] = skipped.file;
    row["line"] = skipped.line == 0 ? JsonValue() : JsonValue(skipped.line);
    row["reason"] = skipped.reason;
    value["skipped"].push_back(std::move(row));
  }
  return value;
}

/// σ null: none is given, and `ordinary` is the error supposed.
JsonValue assumed_value(const std::vector<Assumption>& assumed) {
  JsonValue list = JsonValue::list();
  for (const Assumption& each : assumed) {
    JsonValue row = JsonValue::object();
    row["name"] = each.name;
    row["value"] = each.value;
    row["sigma"] = each.sigma ? JsonValue(*each.sigma) : JsonValue();
    row["ordinary"] = each.sigma ? JsonValue() : JsonValue(each.ordinary);
    row["moves"] = each.moves;
    row["moved"] = text_or_null(each.moved);
    row["moved_by"] = each.moved_by;
    list.push_back(std::move(row));
  }
  return list;
}

JsonValue covariance_value(const ResultDocument& document) {
  const std::size_t n = document.covariance_names.size();
  if (document.covariance_upper.size() != n * (n + 1) / 2) {
    throw std::logic_error("the covariance's triangle does not fit its names");
  }
  JsonValue value = JsonValue::object();
  value["names"] = document.covariance_names;
  value["upper"] = document.covariance_upper;
  return value;
}

JsonValue table_value(const DataTable& table) {
  JsonValue value = JsonValue::object();
  for (const auto& [name, column] : table.columns) {
    if (length_of(column) != length_of(table.columns.front().second)) {
      throw std::logic_error("table " + table.name + ": column " + name + " has another length");
    }
    value[name] = column;
  }
  if (table.thinned) {
    JsonValue& thinned = value["thinned"];
    thinned["from"] = table.thinned->from;
    thinned["to"] = table.thinned->to;
    thinned["how"] = table.thinned->how;
  }
  return value;
}

JsonValue grid_value(const DataGrid& grid) {
  JsonValue value = JsonValue::object();
  value["cols"] = grid.cols;
  value["rows"] = grid.rows;
  value["u0_px"] = grid.u0_px;
  value["v0_px"] = grid.v0_px;
  value["du_px"] = grid.du_px;
  value["dv_px"] = grid.dv_px;
  for (const auto& [name, values] : grid.values) {
    if (values.size() != static_cast<std::size_t>(grid.cols) * static_cast<std::size_t>(grid.rows)) {
      throw std::logic_error("grid " + grid.name + ": " + name + " has another size");
    }
    value[name] = values;
  }
  return value;
}

/// Members one per line, so that a user finds things and a diff is readable; each member in one line, so that it is
/// small.
std::string lines_of(JsonValue& value) {
  std::string text = "{\n";
  const auto& members = std::get<JsonValue::Object>(value.content());
  for (std::size_t i = 0; i < members.size(); ++i) {
    text +=
        JsonValue(members[i].first).text() + ": " + members[i].second.text() + (i + 1 < members.size() ? ",\n" : "\n");
  }
  return text + "}\n";
}

}  // namespace

std::string state_name(State state) {
  switch (state) {
    case State::good:
      return "good";
    case State::care:
      return "care";
    case State::bad:
      return "bad";
    case State::refused:
      return "refused";
    case State::not_converged:
      return "not_converged";
  }
  throw std::logic_error("unknown state");
}

std::string result_text(const ResultDocument& document) {
  JsonValue value = JsonValue::object();
  value["schema"] = "alidade-result/1";
  value["command"] = document.command;
  value["version"] = ALIDADE_VERSION;
  value["argv"] = document.argv;
  value["created_utc"] = text_or_null(document.created_utc);
  value["seed"] = document.seed ? JsonValue(*document.seed) : JsonValue();
  value["seconds"] = JsonValue::object();
  for (const auto& [part, seconds] : document.seconds) value["seconds"][part] = seconds;
  value["inputs"] = inputs_value(document.inputs);
  value["verdict"] = verdict_value(document.verdict);
  value["counts"] = counts_value(document.counts);
  value["assumed"] = assumed_value(document.assumed);
  value["estimate"] = document.estimate;
  value["stddev"] = document.stddev;
  value["stddev_model"] = document.stddev_model;
  value["covariance"] = covariance_value(document);
  value["files"] = document.files;
  value["data"] = JsonValue::object();
  for (const DataTable& table : document.data) value["data"][table.name] = table_value(table);
  value["grids"] = JsonValue::object();
  for (const DataGrid& grid : document.grids) value["grids"][grid.name] = grid_value(grid);
  return lines_of(value);
}

}  // namespace alidade
