#include "alidade/results/batch_outcome.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <map>
#include <nlohmann/json.hpp>

#include "alidade/estimation/median.h"
#include "alidade/files/csv.h"

namespace alidade {
namespace {

using nlohmann::ordered_json;

constexpr double outlying = 4.0;    // of a normal batch one value in 16 000
constexpr std::size_t min_lot = 8;  // below, the batch's own scatter is poorly known

/// Numbers that stand in both trees at the same place: an estimate and its σ.
void add_values(const ordered_json& estimate, const ordered_json& stddev, const std::string& path, BatchRow& row) {
  if (estimate.is_number() && stddev.is_number()) {
    row.values.push_back({path, estimate.get<double>(), stddev.get<double>()});
    return;
  }
  const auto under = [&](const std::string& name) { return path.empty() ? name : path + "." + name; };
  if (estimate.is_object() && stddev.is_object()) {
    for (const auto& [name, value] : estimate.items())
      if (stddev.contains(name)) add_values(value, stddev.at(name), under(name), row);
  } else if (estimate.is_array() && stddev.is_array() && estimate.size() == stddev.size()) {
    for (std::size_t i = 0; i < estimate.size(); ++i)
      add_values(estimate[i], stddev[i], path + "[" + std::to_string(i) + "]", row);
  }
}

/// Of every quantity the rows that have it, in order of its first appearance.
using Column = std::pair<std::string, std::vector<std::pair<std::size_t, BatchRow::Value>>>;
std::vector<Column> columns_of(const std::vector<BatchRow>& rows) {
  std::vector<Column> columns;
  std::map<std::string, std::size_t> place;
  for (std::size_t i = 0; i < rows.size(); ++i) {
    for (const BatchRow::Value& value : rows[i].values) {
      const auto [found, is_new] = place.try_emplace(value.name, columns.size());
      if (is_new) columns.push_back({value.name, {}});
      columns[found->second].second.emplace_back(i, value);
    }
  }
  return columns;
}

std::string number_text(double value) { return std::isfinite(value) ? fmt::format("{}", value) : ""; }

/// Of each quantity all outliers, and as many others as the figure needs.
std::vector<BatchOutlier> shown_distances(const std::vector<BatchRow>& rows) {
  constexpr std::size_t max_of_quantity = 1000, most = 20000;
  const std::vector<BatchOutlier> all = distances_of(rows);
  std::map<std::string, std::size_t> counts, at;
  for (const BatchOutlier& one : all) ++counts[one.name];
  std::vector<BatchOutlier> shown;
  for (const BatchOutlier& one : all) {
    const std::size_t every = (counts[one.name] + max_of_quantity - 1) / max_of_quantity;
    const bool is_taken = at[one.name]++ % every == 0 || std::abs(one.z) > outlying;
    if (is_taken && shown.size() < most) shown.push_back(one);
  }
  return shown;
}

DataTable distances_table(const std::string& name, const std::vector<BatchRow>& rows,
                          const std::vector<BatchOutlier>& outliers) {
  std::vector<std::string> cameras, names;
  std::vector<double> values, sigmas, medians, zs;
  for (const BatchOutlier& outlier : outliers) {
    cameras.push_back(rows[outlier.row].camera);
    names.push_back(outlier.name);
    values.push_back(outlier.value);
    sigmas.push_back(outlier.sigma);
    medians.push_back(outlier.median);
    zs.push_back(outlier.z);
  }
  return {name,
          {{"camera", cameras},
           {"quantity", names},
           {"value", values},
           {"sigma", sigmas},
           {"median_of_lot", medians},
           {"z", rounded(zs, 2)}}};
}

DataTable rows_table(const std::vector<BatchRow>& rows) {
  std::vector<std::string> cameras, states, sentences, folders;
  std::vector<int> codes;
  std::vector<double> seconds;
  for (const BatchRow& row : rows) {
    cameras.push_back(row.camera);
    states.push_back(row.state);
    codes.push_back(row.exit_code);
    seconds.push_back(row.seconds);
    sentences.push_back(row.sentence);
    folders.push_back(row.folder);
  }
  return {"rows",
          {{"camera", cameras},
           {"verdict", states},
           {"exit_code", codes},
           {"seconds", rounded(seconds, 3)},
           {"sentence", sentences},
           {"folder", folders}}};
}

DataTable lot_table(const std::vector<BatchRow>& rows) {
  std::vector<std::string> names;
  std::vector<std::int64_t> counts;
  std::vector<double> medians, scatters, sigmas;
  for (const auto& [name, values] : columns_of(rows)) {
    std::vector<double> numbers, own;
    for (const auto& [row, value] : values) {
      numbers.push_back(value.value);
      own.push_back(value.sigma);
    }
    const double median = median_of(numbers);
    for (double& number : numbers) number = std::abs(number - median);
    names.push_back(name);
    counts.push_back(static_cast<std::int64_t>(values.size()));
    medians.push_back(median);
    scatters.push_back(normal_from_mad * median_of(numbers));
    sigmas.push_back(median_of(own));
  }
  return {"lot",
          {{"quantity", names}, {"rows", counts}, {"median", medians}, {"scatter", scatters}, {"sigma", sigmas}}};
}

constexpr std::size_t max_lines = 10;

void add_failures(const std::vector<BatchRow>& rows, std::vector<std::string>& lines) {
  std::size_t failures = 0;
  for (std::size_t i = 0; i < rows.size(); ++i) {
    if (is_estimate(rows[i].exit_code) || ++failures > max_lines) continue;
    lines.push_back(
        fmt::format("row {} ({}): exit code {}: {}", i + 1, rows[i].camera, rows[i].exit_code, rows[i].sentence));
  }
  if (failures > max_lines) lines.push_back(fmt::format("… and {} more without an estimate", failures - max_lines));
}

void add_outliers(const std::vector<BatchRow>& rows, const std::vector<BatchOutlier>& outliers,
                  std::vector<std::string>& lines) {
  for (std::size_t i = 0; i < std::min(outliers.size(), max_lines); ++i)
    lines.push_back(fmt::format("outlier: {}  {} = {:.6g} ± {:.2g}, the lot's median {:.6g} (z {:.1f})",
                                rows[outliers[i].row].camera, outliers[i].name, outliers[i].value, outliers[i].sigma,
                                outliers[i].median, outliers[i].z));
}

Verdict batch_verdict(std::size_t rows, std::size_t answered, std::size_t outliers) {
  Verdict verdict;
  verdict.sentence = fmt::format("{} of {} rows have an estimate; {} outliers in the lot", answered, rows, outliers);
  if (answered < rows || outliers > 0) {
    verdict.state = State::care;
    verdict.to_add = "look at them in batch.csv";
  }
  if (answered == 0) {
    verdict.state = State::refused;
    verdict.exit_code = ExitCode::undetermined;
  }
  return verdict;
}

}  // namespace

void read_result(std::string_view result_json, const std::string& file, BatchRow& row) {
  try {
    const ordered_json json = ordered_json::parse(result_json);
    row.state = json.at("verdict").at("state").get<std::string>();
    row.sentence = json.at("verdict").at("sentence").get<std::string>();
    row.values.clear();
    add_values(json.at("estimate"), json.at("stddev"), "", row);
  } catch (const std::exception&) {
    throw InputError(file + ": is no result of alidade");
  }
}

std::string row_text(const BatchRow& row, const std::vector<std::string>& words) {
  ordered_json json;
  json["schema"] = "alidade-batch-row/1";
  json["words"] = words;
  json["camera"] = row.camera;
  json["folder"] = row.folder;
  json["exit_code"] = row.exit_code;
  json["state"] = row.state;
  json["sentence"] = row.sentence;
  json["seconds"] = row.seconds;
  json["values"] = ordered_json::array();
  for (const auto& value : row.values) json["values"].push_back({value.name, value.value, value.sigma});
  return json.dump(1, ' ', false, ordered_json::error_handler_t::replace) + "\n";
}

std::optional<BatchRow> parse_row(std::string_view text, const std::vector<std::string>& words) {
  try {
    const ordered_json json = ordered_json::parse(text);
    if (json.at("words").get<std::vector<std::string>>() != words) return std::nullopt;
    BatchRow row;
    row.camera = json.at("camera").get<std::string>();
    row.folder = json.at("folder").get<std::string>();
    row.exit_code = json.at("exit_code").get<int>();
    row.state = json.at("state").get<std::string>();
    row.sentence = json.at("sentence").get<std::string>();
    row.seconds = json.at("seconds").get<double>();
    for (const auto& value : json.at("values"))
      row.values.push_back({value.at(0).get<std::string>(), value.at(1).get<double>(), value.at(2).get<double>()});
    return row;
  } catch (const std::exception&) {
    return std::nullopt;
  }
}

std::vector<BatchOutlier> distances_of(const std::vector<BatchRow>& rows) {
  std::vector<BatchOutlier> distances;
  for (const auto& [name, values] : columns_of(rows)) {
    if (values.size() < min_lot) continue;
    std::vector<double> numbers;
    for (const auto& [row, value] : values) numbers.push_back(value.value);
    const double median = median_of(numbers);
    for (double& number : numbers) number = std::abs(number - median);
    const double scatter = normal_from_mad * median_of(numbers);
    for (const auto& [row, value] : values) {
      const double z = (value.value - median) / std::hypot(scatter, value.sigma);
      // In a batch with identical values, and without σ, any different one is an outlier.
      if (!std::isnan(z)) distances.push_back({row, name, value.value, value.sigma, median, std::clamp(z, -1e6, 1e6)});
    }
  }
  return distances;
}

std::vector<BatchOutlier> outliers_of(const std::vector<BatchRow>& rows) {
  std::vector<BatchOutlier> outliers = distances_of(rows);
  std::erase_if(outliers, [](const auto& one) { return !(std::abs(one.z) > outlying); });
  std::ranges::stable_sort(outliers, [](const auto& a, const auto& b) { return std::abs(a.z) > std::abs(b.z); });
  return outliers;
}

std::string batch_csv(const std::vector<BatchRow>& rows) {
  const std::vector<Column> columns = columns_of(rows);
  std::vector<std::vector<const BatchRow::Value*>> cells(rows.size(),
                                                         std::vector<const BatchRow::Value*>(columns.size(), nullptr));
  std::string text = "camera,verdict,exit_code";
  for (std::size_t c = 0; c < columns.size(); ++c) {
    // "camera.fx" of calibrate is fx: whose it is the row says.
    std::string name = columns[c].first;
    if (name.starts_with("camera.")) name.erase(0, 7);
    text += "," + csv_cell(name) + "," + csv_cell("sigma_" + name);
    for (const auto& [row, value] : columns[c].second) cells[row][c] = &value;
  }
  text += ",seconds,sentence,folder\n";
  for (std::size_t i = 0; i < rows.size(); ++i) {
    text += fmt::format("{},{},{}", csv_cell(rows[i].camera), rows[i].state, rows[i].exit_code);
    for (const BatchRow::Value* value : cells[i])
      text += value != nullptr ? "," + number_text(value->value) + "," + number_text(value->sigma) : ",,";
    text += fmt::format(",{:.3f},{},{}\n", rows[i].seconds, csv_cell(rows[i].sentence), csv_cell(rows[i].folder));
  }
  return text;
}

JobOutcome outcome_of(const std::vector<BatchRow>& rows) {
  JobOutcome outcome;
  ResultDocument& document = outcome.document;
  std::map<std::string, std::size_t> states;
  for (const BatchRow& row : rows) ++states[row.state];
  const auto answered = static_cast<std::size_t>(
      std::ranges::count_if(rows, [](const BatchRow& row) { return is_estimate(row.exit_code); }));
  const std::vector<BatchOutlier> outliers = outliers_of(rows);
  document.counts.given = rows.size();
  document.counts.used = answered;
  document.counts.dropped = rows.size() - answered;
  document.estimate["rows"] = rows.size();
  document.estimate["verdicts"] = JsonValue::object();
  for (const auto& [state, count] : states) document.estimate["verdicts"][state] = count;
  document.estimate["outliers"] = outliers.size();
  document.data = {distances_table("outliers", rows, outliers), lot_table(rows), rows_table(rows),
                   distances_table("values", rows, shown_distances(rows))};
  outcome.files.push_back({"batch.csv", batch_csv(rows)});
  for (const auto& [state, count] : states)
    outcome.lines.push_back(fmt::format("{:<14} {} {}", state, count, count == 1 ? "row" : "rows"));
  add_failures(rows, outcome.lines);
  add_outliers(rows, outliers, outcome.lines);
  document.verdict = batch_verdict(rows.size(), answered, outliers.size());
  return outcome;
}

}  // namespace alidade
