#pragma once

#include <istream>
#include <optional>
#include <set>
#include <span>
#include <string>
#include <utility>
#include <vector>

#include "alidade/files/csv.h"
#include "alidade/tables/events_file.h"

namespace alidade {

/// The columns of a table of events.
struct EventColumns {
  std::string pan, tilt, u, v;
  bool has_arrival = false, from_centre = false;
};

/// Rows of events, each checked against the previous ones.
class EventRows {
 public:
  /// `layout` has the header. Throws InputError for a missing column.
  EventRows(const Csv& layout, std::span<const RigHead> heads, bool stands_still);

  /// Throws InputError; such a row is ignored in later checks.
  [[nodiscard]] TargetObservation read(const Csv& csv, std::size_t row);

 private:
  std::span<const RigHead> heads_;
  bool stands_still_;
  EventColumns columns_;
  std::vector<double> newest_s_;  ///< Newest arrival; one clock for all heads, or one per head.
  std::vector<std::optional<Eigen::Vector2d>> first_rad_;
  std::vector<Eigen::Vector2d> last_rad_;  ///< Last readings of each head's encoders; initially zero.
  std::vector<std::set<double>> seen_s_;   ///< Newest capture times of each head.
};

/// Events row by row as they arrive, with the checks of read_events().
class EventsStream {
 public:
  /// Reads the header. `heads` outlive it.
  EventsStream(std::istream& in, const std::string& name, std::span<const RigHead> heads,
               const EventsOptions& options = {});

  /// The next row that is not rejected; none at the end. Throws InputError, also if there is no row at all.
  [[nodiscard]] std::optional<TargetObservation> next();
  [[nodiscard]] const std::vector<SkippedInput>& skipped() const { return skipped_; }

 private:
  CsvStream table_;
  Csv row_;
  EventRows rows_;
  bool skips_bad_, has_rows_ = false;
  std::vector<SkippedInput> skipped_;
};

}  // namespace alidade
