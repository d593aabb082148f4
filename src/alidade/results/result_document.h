#pragma once

#include <cstdint>
#include <optional>
#include <string>
#include <utility>
#include <vector>

#include "alidade/estimation/counts.h"
#include "alidade/estimation/verdict.h"
#include "alidade/files/json_value.h"
#include "alidade/public.h"

namespace alidade {
ALIDADE_PUBLIC_BEGIN

/// The rows kept of a long table, and how they were chosen: a CSV file next to the document has all rows.
struct Thinned {
  std::size_t from = 0, to = 0;  ///< Rows before and after.
  std::string how;
};

/// Columns of equal length, in order.
struct DataTable {
  std::string name;
  std::vector<std::pair<std::string, JsonValue>> columns = {};  ///< Name (with its unit) and a list.
  std::optional<Thinned> thinned = {};
};

/// Values on a regular grid of pixels, row-major from (u0, v0).
struct DataGrid {
  std::string name;
  int cols = 0;
  int rows = 0;
  double u0_px = 0.0, v0_px = 0.0, du_px = 0.0, dv_px = 0.0;
  std::vector<std::pair<std::string, std::vector<double>>> values;  ///< Name (with its unit), row-major.
};

/// The content of result.json, the same for every command: what was run on which input, the verdict, the estimates, and
/// the data behind the report's figures. Missing values are null.
struct ResultDocument {
  std::string command;
  std::vector<std::string> argv;
  std::string created_utc;  ///< 2026-01-31T12:00:00Z
  std::optional<std::uint64_t> seed;
  std::vector<std::pair<std::string, double>> seconds;  ///< The total, and its parts by name.
  std::vector<InputFile> inputs;
  Verdict verdict;
  Counts counts;
  std::vector<Assumption> assumed;
  JsonValue estimate = JsonValue::object();
  JsonValue stddev = JsonValue::object();        ///< σ by the names of `estimate`.
  JsonValue stddev_model = JsonValue::object();  ///< The same, for independent errors of single measurements.
  std::vector<std::string> covariance_names;     ///< Names of the parameters, in the order of the covariance.
  std::vector<double> covariance_upper;          ///< Upper triangle, row-major.
  std::vector<DataTable> data;
  std::vector<DataGrid> grids;
  std::vector<std::string> files;  ///< Written next to result.json.
};

/// The word for a state in documents: good, care, bad, refused, not_converged.
[[nodiscard]] std::string state_name(State state);

/// Whether a document with this exit code has an estimate, usable or not to be trusted.
[[nodiscard]] constexpr bool is_estimate(int exit_code) {
  return exit_code == static_cast<int>(ExitCode::ok) || exit_code == static_cast<int>(ExitCode::not_trusted);
}

/// Text of result.json (schema alidade-result/1), ending in a newline. Throws std::logic_error if columns of a table,
/// values of a grid or the covariance have a wrong length.
[[nodiscard]] std::string result_text(const ResultDocument& document);

ALIDADE_PUBLIC_END
}  // namespace alidade
