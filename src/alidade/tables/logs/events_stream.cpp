#include "alidade/tables/logs/events_stream.h"

#include <cmath>
#include <numbers>

#include "alidade/files/table_rows.h"
#include "alidade/pantilt/head_view.h"
#include "alidade/tables/logs/head_column.h"

namespace alidade {
namespace {

std::string either(const Csv& csv, const std::string& first, const std::string& second) {
  if (csv.has(first)) return first;
  if (csv.has(second)) return second;
  csv.refuse_missing(first);
}

EventColumns event_columns_of(const Csv& csv, bool stands_still) {
  csv.require(std::vector<std::string>{"t_capture_s", "head"});
  const bool has_angles = !stands_still || csv.has("pan_rad") || csv.has("tilt_rad");
  EventColumns columns{has_angles ? either(csv, "pan_rad", "pan_rad_at_capture") : "",
                       has_angles ? either(csv, "tilt_rad", "tilt_rad_at_capture") : "",
                       "",
                       "",
                       csv.has("t_arrival_s"),
                       !csv.has("u_px") && csv.has("du_px")};
  columns.u = columns.from_centre ? "du_px" : "u_px";
  columns.v = columns.from_centre ? "dv_px" : "v_px";
  csv.require(std::vector<std::string>{columns.u, columns.v});
  return columns;
}

Eigen::Vector2d principal_point(const Camera& camera) {
  const Eigen::VectorXd values = params(camera.lens);  // fx, fy, cx, cy, skew come first in every model
  return {values[2], values[3]};
}

/// `newest_s`: arrival of the newest row so far; of one clock for all heads, or one for each.
TargetObservation read_row(const Csv& csv, std::size_t row, const EventColumns& columns, std::span<const RigHead> heads,
                           std::span<const double> newest_s) {
  TargetObservation observation;
  observation.head = head_in_row(csv, row, heads);
  observation.t_capture_s = csv.number(row, "t_capture_s");
  observation.t_arrival_s = columns.has_arrival ? csv.number(row, "t_arrival_s") : observation.t_capture_s;
  const std::string clock = columns.has_arrival ? "t_arrival_s" : "t_capture_s";
  if (!(observation.t_arrival_s >= observation.t_capture_s))
    throw InputError(csv.where(row, "t_arrival_s") + ": arrives before its capture");
  if (!(observation.t_arrival_s >= newest_s[newest_s.size() > 1 ? observation.head : 0]))
    throw InputError(csv.where(row, clock) + ": '" + csv.text(row, clock) +
                     "' runs backwards; rows must be in order of arrival");
  constexpr double max_px = 1e6;
  if (!columns.pan.empty())
    observation.pan_tilt_rad = {angle_in_row(csv, row, columns.pan), angle_in_row(csv, row, columns.tilt)};
  observation.px = {csv.number(row, columns.u), csv.number(row, columns.v)};
  if (!(observation.px.cwiseAbs().maxCoeff() < max_px))
    throw InputError(csv.where(row, columns.u) + ": is in no image");
  if (csv.has("sigma_px") && !csv.is_empty(row, "sigma_px")) observation.sigma_px = csv.positive(row, "sigma_px");
  if (columns.from_centre) observation.px += principal_point(heads[observation.head].camera);
  return observation;
}

}  // namespace

EventRows::EventRows(const Csv& layout, std::span<const RigHead> heads, bool stands_still)
    : heads_(heads),
      stands_still_(stands_still),
      columns_(event_columns_of(layout, stands_still)),
      newest_s_(stands_still ? heads.size() : 1, -1e300),
      first_rad_(heads.size()),
      seen_s_(heads.size()) {
  for (const RigHead& head : heads)
    last_rad_.emplace_back(head.head.encoder.pan_zero_rad, head.head.encoder.tilt_zero_rad);
}

TargetObservation EventRows::read(const Csv& csv, std::size_t row) {
  TargetObservation observation = read_row(csv, row, columns_, heads_, newest_s_);
  constexpr std::size_t max_kept = 100'000;  // images of a head: what is older than these does not come a second time
  std::set<double>& seen_s = seen_s_[observation.head];
  if (!seen_s.insert(observation.t_capture_s).second)
    throw InputError(csv.where(row, "t_capture_s") + ": '" + csv.text(row, "t_capture_s") +
                     "' is in an earlier row of this head; an image has one target");
  if (seen_s.size() > max_kept) seen_s.erase(seen_s.begin());
  for (int axis = 0; axis < 2; ++axis) {  // encoders that begin again after a turn
    double& last_rad = last_rad_[observation.head][axis];
    const double reading_rad = observation.pan_tilt_rad[axis];
    last_rad = observation.pan_tilt_rad[axis] = reading_after(reading_rad, last_rad);
    observation.turns[axis] = std::round((reading_rad - last_rad) / (2.0 * std::numbers::pi));
  }
  std::optional<Eigen::Vector2d>& stood_rad = first_rad_[observation.head];
  if (!stood_rad) stood_rad = observation.pan_tilt_rad;
  constexpr double still_rad = 1e-6;
  if (stands_still_ && (observation.pan_tilt_rad - *stood_rad).cwiseAbs().maxCoeff() > still_rad)
    throw InputError(csv.where(row, columns_.pan) + ": the head moves; this is for static cameras");
  newest_s_[stands_still_ ? observation.head : 0] = observation.t_arrival_s;
  return observation;
}

EventsStream::EventsStream(std::istream& in, const std::string& name, std::span<const RigHead> heads,
                           const EventsOptions& options)
    : table_(in, name),
      row_(table_.empty_table()),
      rows_(row_, heads, options.stands_still),
      skips_bad_(options.skip_bad) {}

std::optional<TargetObservation> EventsStream::next() {
  for (;;) {
    try {
      std::optional<CsvRow> row = table_.next();
      if (!row) break;
      row_.set_only_row(std::move(*row));
      const TargetObservation observation = rows_.read(row_, 0);
      has_rows_ = true;
      return observation;
    } catch (const InputError& error) {
      if (!skips_bad_) throw;
      skipped_.push_back(skipped_row(table_.name(), error.what()));
    }
  }
  if (!has_rows_) throw InputError(table_.name() + ": has no events; at least one row is needed");
  return std::nullopt;
}

}  // namespace alidade
