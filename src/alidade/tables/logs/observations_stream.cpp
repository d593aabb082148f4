#include "alidade/tables/logs/observations_stream.h"

#include <fmt/format.h>

#include <algorithm>
#include <utility>

#include "alidade/files/table_rows.h"

namespace alidade {
namespace {

constexpr long max_frames = 10'000'000, max_point_id = 1'000'000'000;
constexpr long max_missing = 100'000;  // frames; a longer gap is another recording

/// A tracker may be half an image off; a camera file of another size is further.
void require_near_image(const Csv& csv, std::size_t row, const char* column, double px, int size_px) {
  if (size_px <= 0) return;
  const double share = px / size_px;
  if (!(share > -0.5 && share < 1.5))
    throw InputError(csv.where(row, column) +
                     fmt::format(": '{}' is far outside the camera's {} px", csv.text(row, column), size_px));
}

}  // namespace

ObservationRows::ObservationRows(const Csv& layout, const ObservationsOptions& options) : options_(options) {
  for (const char* name : {"frame", "t_s", "point_id", "u_px", "v_px"}) {
    if (options.rate_hz > 0.0 && std::string(name) == "t_s") continue;
    if (!layout.has(name)) layout.refuse_missing(name, std::string(name) == "t_s" ? "; give it, or --rate" : "");
  }
}

FeatureObservation ObservationRows::observation_in(const Csv& csv, std::size_t row) const {
  FeatureObservation observation;
  observation.id = csv.integer(row, "point_id", 0, max_point_id);
  observation.px = {csv.number(row, "u_px"), csv.number(row, "v_px")};
  require_near_image(csv, row, "u_px", observation.px.x(), options_.width_px);
  require_near_image(csv, row, "v_px", observation.px.y(), options_.height_px);
  return observation;
}

void ObservationRows::require_order(const Csv& csv, std::size_t row, long number, double t_s) const {
  if (!open_) return;
  if (number == open_->frame && open_->t_s != t_s)
    throw InputError(csv.where(row, "t_s") +
                     fmt::format(": '{}' differs from the first row of frame {}", csv.text(row, "t_s"), number));
  if (number < open_->frame) throw InputError(csv.where(row, "frame") + fmt::format(": '{}' runs backwards", number));
  if (number > open_->frame && !(t_s > open_->t_s))
    throw InputError(csv.where(row, "t_s") +
                     fmt::format(": '{}' is not after frame {}", csv.text(row, "t_s"), open_->frame));
}

void ObservationRows::read(const Csv& csv, std::size_t row) {
  std::optional<FeatureObservation> observation;
  if (!csv.is_empty(row, "point_id")) observation = observation_in(csv, row);
  const long number = csv.integer(row, "frame", 0, max_frames);
  const double t_s = options_.rate_hz > 0.0 ? static_cast<double>(number) / options_.rate_hz : csv.number(row, "t_s");
  require_order(csv, row, number, t_s);
  if (open_ && open_->frame != number) complete();
  if (!open_) open_ = ObservationFrame{number, t_s, {}};
  if (!observation) return;
  if (std::ranges::count(open_->observations, observation->id, &FeatureObservation::id) > 0)
    throw InputError(csv.where(row, "point_id") +
                     fmt::format(": {} appears twice in frame {}", observation->id, number));
  open_->observations.push_back(*observation);
}

/// After those that are missing before it, evenly between it and the last one: nothing was seen there.
void ObservationRows::complete() {
  const long missing = last_ ? open_->frame - last_->frame - 1 : 0;
  if (missing > 0 && missing <= max_missing) {
    const double step_s = (open_->t_s - last_->t_s) / static_cast<double>(missing + 1);
    for (long k = 1; k <= missing; ++k)
      complete_.push_back({last_->frame + k, last_->t_s + step_s * static_cast<double>(k), {}});
  }
  open_->observations.shrink_to_fit();
  last_ = ObservationFrame{open_->frame, open_->t_s, {}};
  complete_.push_back(std::move(*open_));
  open_.reset();
}

void ObservationRows::end() {
  if (open_) complete();
}

std::optional<ObservationFrame> ObservationRows::next() {
  if (complete_.empty()) return std::nullopt;
  ObservationFrame frame = std::move(complete_.front());
  complete_.pop_front();
  return frame;
}

ObservationsStream::ObservationsStream(std::istream& in, const std::string& name, const ObservationsOptions& options)
    : table_(in, name), row_(table_.empty_table()), rows_(row_, options), skips_bad_(options.skip_bad) {}

/// False at the end of the input.
bool ObservationsStream::read_row() {
  try {
    std::optional<CsvRow> row = table_.next();
    if (!row) return false;
    row_.set_only_row(std::move(*row));
    rows_.read(row_, 0);
  } catch (const InputError& error) {
    if (!skips_bad_) throw;
    skipped_.push_back(skipped_row(table_.name(), error.what()));
  }
  return true;
}

std::optional<ObservationFrame> ObservationsStream::next() {
  for (;;) {
    if (auto frame = rows_.next()) {
      has_frames_ = true;
      return frame;
    }
    if (read_row()) continue;
    rows_.end();
    if (auto last = rows_.next()) {
      has_frames_ = true;
      return last;
    }
    if (!has_frames_) throw InputError(table_.name() + ": has no observations; at least one row is needed");
    return std::nullopt;
  }
}

}  // namespace alidade
