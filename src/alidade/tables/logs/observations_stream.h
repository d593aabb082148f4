#pragma once

#include <deque>
#include <istream>
#include <optional>
#include <string>
#include <vector>

#include "alidade/files/csv.h"
#include "alidade/tables/localize_file.h"

namespace alidade {

/// Builds frames from rows of observations, each checked against the previous ones. Missing frame numbers become frames
/// without observations.
class ObservationRows {
 public:
  /// `layout` has the header. Throws InputError for a missing column.
  ObservationRows(const Csv& layout, const ObservationsOptions& options);

  /// Throws InputError; such a row is ignored in later checks.
  void read(const Csv& csv, std::size_t row);
  /// Declares that no more rows follow: the last frame is complete.
  void end();
  /// The next complete frame: a row of a later one has been read.
  [[nodiscard]] std::optional<ObservationFrame> next();

 private:
  [[nodiscard]] FeatureObservation observation_in(const Csv& csv, std::size_t row) const;
  void require_order(const Csv& csv, std::size_t row, long number, double t_s) const;
  void complete();

  ObservationsOptions options_;
  std::optional<ObservationFrame> open_;  ///< The present frame: rows may follow.
  std::optional<ObservationFrame> last_;  ///< The frame before it, without its observations.
  std::deque<ObservationFrame> complete_;
};

/// Frames of observations as their rows arrive, with the checks of read_observations(). A frame ends with the first row
/// of the next one.
class ObservationsStream {
 public:
  /// Reads the header. Throws InputError.
  ObservationsStream(std::istream& in, const std::string& name, const ObservationsOptions& options);

  /// The next frame; none at the end. Throws InputError, also if there is no row at all.
  [[nodiscard]] std::optional<ObservationFrame> next();
  [[nodiscard]] const std::vector<SkippedInput>& skipped() const { return skipped_; }

 private:
  [[nodiscard]] bool read_row();

  CsvStream table_;
  Csv row_;
  ObservationRows rows_;
  bool skips_bad_, has_frames_ = false;
  std::vector<SkippedInput> skipped_;
};

}  // namespace alidade
