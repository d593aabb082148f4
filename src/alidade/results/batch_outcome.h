#pragma once

#include <optional>
#include <string>
#include <utility>
#include <vector>

#include "alidade/results/outcome.h"

namespace alidade {

/// The outcome of one row of a batch.
struct BatchRow {
  struct Value {
    std::string name;
    double value = 0.0, sigma = 0.0;
  };
  std::string camera, folder;  ///< Where its results are, in the batch's folder.
  int exit_code = 0;           ///< 128 + a signal that ended it.
  std::string state;           ///< good, care, bad, refused, not_converged; "failed" where there is no result.
  std::string sentence;        ///< Of its verdict, or the line it ended with.
  std::vector<Value> values;   ///< Each estimate that has a σ.
  double seconds = 0.0;
};

/// State, sentence and values of a row's result.json. Throws InputError where it is none.
void read_result(std::string_view result_json, const std::string& file, BatchRow& row);

/// One row's outcome as text, and back: makes a batch resumable. `words`: its arguments.
[[nodiscard]] std::string row_text(const BatchRow& row, const std::vector<std::string>& words);
/// None where the text is no row, or of other words.
[[nodiscard]] std::optional<BatchRow> parse_row(std::string_view text, const std::vector<std::string>& words);

/// A value of a row and its batch: how far from the median, over 1.4826 times the median of the distances and its
/// own σ.
struct BatchOutlier {
  std::size_t row = 0;
  std::string name;
  double value = 0.0, sigma = 0.0, median = 0.0, z = 0.0;
};
/// Of quantities that eight rows or more have: every value, in order of quantities and rows.
[[nodiscard]] std::vector<BatchOutlier> distances_of(const std::vector<BatchRow>& rows);
/// Those beyond 4, the furthest first, of quantities that eight rows or more have.
[[nodiscard]] std::vector<BatchOutlier> outliers_of(const std::vector<BatchRow>& rows);

/// Text of batch.csv: camera,verdict,exit_code,NAME,sigma_NAME,…,seconds,sentence,folder, in order of the rows.
[[nodiscard]] std::string batch_csv(const std::vector<BatchRow>& rows);

/// The document of a batch, its lines, and batch.csv.
[[nodiscard]] JobOutcome outcome_of(const std::vector<BatchRow>& rows);

}  // namespace alidade
