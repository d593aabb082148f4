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

/// What was left of a long table, and how: all of it is in a CSV file beside the document.
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

/// Values on a regular grid of pixels, row by row from (u0, v0).
struct DataGrid {
  std::string name;
  int cols = 0;
  int rows = 0;
  double u0_px = 0.0, v0_px = 0.0, du_px = 0.0, dv_px = 0.0;
  std::vector<std::pair<std::string, std::vector<double>>> values;  ///< Name (with its unit), row-major.
};

/// The document of result.json, the same for every command: what ran on what, the verdict, the numbers, and the data
/// behind the report's figures. Missing values are null.
struct ResultDocument {
  std::string command;
  std::vector<std::string> argv;
  std::string created_utc;  ///< 2026-01-31T12:00:00Z
  std::optional<std::uint64_t> seed;
  std::vector<std::pair<std::string, double>> seconds;  ///< total, and its parts by name.
  std::vector<InputFile> inputs;
  Verdict verdict;
  Counts counts;
  std::vector<Assumption> assumed;
  JsonValue estimate = JsonValue::object();
  JsonValue stddev = JsonValue::object();        ///< σ by the names of `estimate`.
  JsonValue stddev_model = JsonValue::object();  ///< The same if every single measurement erred by itself.
  std::vector<std::string> covariance_names;     ///< Parameters, in the order of the covariance.
  std::vector<double> covariance_upper;          ///< Upper triangle, row by row.
  std::vector<DataTable> data;
  std::vector<DataGrid> grids;
  std::vector<std::string> files;  ///< Written beside result.json.
};

/// The word for a state in documents: good, care, bad, refused, not_converged.
[[nodiscard]] std::string state_name(State state);

/// Whether a document with this exit code holds an estimate, usable or not to be trusted.
[[nodiscard]] constexpr bool is_estimate(int exit_code) {
  return exit_code == static_cast<int>(ExitCode::ok) || exit_code == static_cast<int>(ExitCode::not_trusted);
}

/// Text of result.json (schema alidade-result/1), ending in a newline. Throws std::logic_error where columns of a
/// table, values of a grid or the covariance do not have the length they must have.
[[nodiscard]] std::string result_text(const ResultDocument& document);

ALIDADE_PUBLIC_END
}  // namespace alidade
