#pragma once

#include <map>
#include <string>
#include <string_view>
#include <utility>
#include <vector>

namespace alidade::report {

/// One column of a table: numbers (NaN where missing) or texts (empty where missing). `texts` is empty for numbers.
struct Column {
  std::string name;
  std::vector<double> numbers;
  std::vector<std::string> texts;
};

/// Columns of equal length, in the document's order. A column that is not there reads as all missing.
struct Table {
  std::size_t num_rows = 0;
  std::vector<Column> columns;

  [[nodiscard]] const Column* find(std::string_view name) const;
  [[nodiscard]] double number(std::string_view name, std::size_t row) const;
  [[nodiscard]] std::vector<double> numbers(std::string_view name) const;
  [[nodiscard]] std::string text(std::string_view name, std::size_t row) const;
};

/// Values on a regular grid of pixels, row-major; value (col, row) stands at (u0 + col·du, v0 + row·dv).
struct Grid {
  int cols = 0, rows = 0;
  double u0_px = 0.0, v0_px = 0.0, du_px = 1.0, dv_px = 1.0;
  std::map<std::string, std::vector<double>> values;

  /// Empty unless there are cols × rows values of this name.
  [[nodiscard]] std::vector<double> value(const std::string& name) const;
};

/// A leaf of `estimate`: its path (`camera.fx`, `origin_m[0]`), its number or text, and σ of the same path in `stddev`.
struct Quantity {
  std::string path;
  double value = 0.0;  ///< NaN if it is a text.
  double sigma = 0.0;  ///< NaN if there is none.
  std::string text;
};

struct CheckLine {
  std::string name, state, text, figure;
  double value, limit;  ///< NaN if missing.
  std::string unit;
};

struct InputFile {
  std::string role, name, sha256;
  double bytes = 0.0;
};

struct SkippedInput {
  std::string file, reason;
  double line = 0.0;
};

/// A result document (schema alidade-result/1) as values; whatever is missing is empty or NaN.
struct Document {
  bool readable = false;
  std::string command, version, created_utc, seed;
  std::vector<std::string> argv;
  std::vector<std::pair<std::string, double>> seconds;
  std::vector<InputFile> inputs;
  std::string state, sentence, to_add;
  std::vector<CheckLine> checks;
  std::vector<std::pair<std::string, double>> counts;
  std::vector<SkippedInput> skipped;
  std::vector<Quantity> estimate;
  std::vector<std::string> covariance_names;
  std::vector<double> covariance_upper;  ///< Row by row, diagonal first.
  std::map<std::string, Table> data;
  std::map<std::string, Grid> grids;

  [[nodiscard]] const Table* table(const std::string& name) const;  ///< Null if missing or without rows.
  [[nodiscard]] const Grid* grid(const std::string& name) const;    ///< Null if missing or empty.
  [[nodiscard]] double estimated(std::string_view path) const;      ///< NaN if missing.
  [[nodiscard]] std::string estimated_text(std::string_view path) const;
  [[nodiscard]] bool is_answer() const { return state == "good" || state == "care" || state == "bad"; }
};

/// Reads a document leniently: a page must come out of whatever a run could write.
[[nodiscard]] Document read_document(std::string_view json);

}  // namespace alidade::report
