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
  std::string camera, folder;  ///< Camera of the row, and folder of its results in the batch's folder.
  int exit_code = 0;           ///< 128 + a signal that ended it.
  std::string state;           ///< good, care, bad, refused, not_converged; "failed" if there is no result.
  std::string sentence;        ///< Sentence of the verdict, or the last line of output.
  std::vector<Value> values;   ///< Every estimate that has a σ.
  double seconds = 0.0;
};

/// Reads state, sentence and values from a row's result.json. Throws InputError if it is not one.
void read_result(std::string_view result_json, const std::string& file, BatchRow& row);

/// Writes and reads a row's outcome as text, so that a batch can be resumed. `words`: its arguments.
[[nodiscard]] std::string row_text(const BatchRow& row, const std::vector<std::string>& words);
/// None if the text is not a row, or has other words.
[[nodiscard]] std::optional<BatchRow> parse_row(std::string_view text, const std::vector<std::string>& words);

/// A value of a row relative to its batch: its distance from the median, over 1.4826 times the median of the distances
/// combined with its own σ.
struct BatchOutlier {
  std::size_t row = 0;
  std::string name;
  double value = 0.0, sigma = 0.0, median = 0.0, z = 0.0;
};
/// For quantities with eight rows or more: every value, in order of quantities and rows.
[[nodiscard]] std::vector<BatchOutlier> distances_of(const std::vector<BatchRow>& rows);
/// The outliers beyond 4, in decreasing order, of quantities with eight rows or more.
[[nodiscard]] std::vector<BatchOutlier> outliers_of(const std::vector<BatchRow>& rows);

/// Text of batch.csv: camera,verdict,exit_code,NAME,sigma_NAME,…,seconds,sentence,folder, in order of the rows.
[[nodiscard]] std::string batch_csv(const std::vector<BatchRow>& rows);

/// Result document and printed lines of a batch, and batch.csv.
[[nodiscard]] JobOutcome outcome_of(const std::vector<BatchRow>& rows);

}  // namespace alidade
