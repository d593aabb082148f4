#include "alidade/tables/rotation_log_file.h"

#include <fmt/format.h>

#include <algorithm>
#include <iterator>
#include <sstream>

#include "alidade/pantilt/head_view.h"
#include "alidade/tables/logs/rotation_log_stream.h"

namespace alidade {
namespace {

/// The same number, or both missing.
bool is_same(double a, double b) { return a == b || (std::isnan(a) && std::isnan(b)); }

template <typename Vector>
bool is_same_vector(const Vector& a, const Vector& b) {
  return std::equal(a.data(), a.data() + a.size(), b.data(), is_same);
}

bool is_repeated(const RotationLogEntry& entry, const RotationLogEntry& last) {
  const RotationRow &a = entry.row, &b = last.row;
  return a.t_s == b.t_s && is_same_vector(a.rate_rad_per_s, b.rate_rad_per_s) &&
         is_same_vector(a.pan_tilt_roll_rad, b.pan_tilt_roll_rad) &&
         a.base_from_cam.coeffs() == b.base_from_cam.coeffs() && a.velocity_m_per_s == b.velocity_m_per_s &&
         is_same(a.range_m, b.range_m) && entry.truth == last.truth &&
         std::equal(a.px.begin(), a.px.end(), b.px.begin(), is_same_vector<Eigen::Vector2d>);
}

RotationLog layout_of(const RotationLogColumns& columns) {
  RotationLog layout;
  layout.source = columns.source;
  layout.num_points = columns.points.size();
  layout.has_roll_rate = columns.rate.size() == 3;
  layout.has_velocity = !columns.velocity.empty();
  return layout;
}

void check_log(const RotationLog& log, const std::string& name) {
  if (log.rows.size() < 2)
    throw InputError(fmt::format("{}: has {} usable row{}; at least 2 are needed", name, log.rows.size(),
                                 log.rows.size() == 1 ? "" : "s"));
  const bool sees = std::any_of(log.rows.begin(), log.rows.end(),
                                [](const RotationRow& row) { return std::ranges::any_of(row.px, is_seen); });
  if (!sees) throw InputError(name + ": no point is seen in any row");
}

void append_cells(std::string& text, const double* values, std::size_t count, bool is_measured) {
  for (std::size_t i = 0; i < count; ++i) {
    text += ',';
    if (is_measured) fmt::format_to(std::back_inserter(text), "{:.12g}", values[i]);
  }
}

std::string header_of(const RotationLog& log) {
  std::string text = "t";
  if (log.source == RotationSource::rate) text += log.has_roll_rate ? ",omega_x,omega_y,omega_z" : ",omega_x,omega_y";
  if (log.source == RotationSource::head) text += ",pan,tilt,roll";
  if (log.source == RotationSource::attitude) text += ",qw,qx,qy,qz";
  if (log.has_velocity) text += ",vx,vy,vz";
  for (std::size_t i = 1; i <= log.num_points; ++i) text += fmt::format(",p{0}x,p{0}y", i);
  const bool has_range = std::ranges::any_of(log.rows, [](const RotationRow& r) { return std::isfinite(r.range_m); });
  if (has_range) text += ",range_m";
  if (!log.truth.empty()) text += ",fx,fy,cx,cy";
  if (log.sigma_scale) text += ",sigma_scale";
  if (log.sigma_parallax) text += ",sigma_parallax";
  return text + "\n";
}

void append_rotation(std::string& text, const RotationLog& log, const RotationRow& row) {
  if (log.source == RotationSource::rate)
    append_cells(text, row.rate_rad_per_s.data(), log.has_roll_rate ? 3 : 2, row.rate_rad_per_s.allFinite());
  if (log.source == RotationSource::head)
    append_cells(text, row.pan_tilt_roll_rad.data(), 3, row.pan_tilt_roll_rad.allFinite());
  if (log.source != RotationSource::attitude) return;
  const Eigen::Quaterniond& q = row.base_from_cam;
  const Eigen::Vector4d wxyz(q.w(), q.x(), q.y(), q.z());
  append_cells(text, wxyz.data(), 4, wxyz.norm() > 0.5);
}

}  // namespace

RotationLogStream::RotationLogStream(std::istream& in, const std::string& name, const RotationLogOptions& options)
    : table_(in, name),
      options_(options),
      columns_(rotation_log_columns(table_, options.needs_rotation, options.needs_points)),
      layout_(layout_of(columns_)) {}

std::optional<RotationLogEntry> RotationLogStream::next() {
  for (;;) {
    std::optional<RotationLogEntry> entry;
    try {
      entry = next_checked();
    } catch (const InputError& error) {
      if (!options_.skip_bad) throw;
      skipped_.push_back(skipped_row(table_.name(), error.what()));
      continue;
    }
    if (entry && last_ && is_repeated(*entry, *last_)) {
      skipped_.push_back({table_.name(), entry->line, "repeated row"});
      continue;
    }
    if (entry) last_ = entry;
    if (entry) unwrap(entry->row.pan_tilt_roll_rad);
    return entry;
  }
}

/// Encoders that begin again after a turn go on from the row before.
void RotationLogStream::unwrap(Eigen::Vector3d& angles_rad) {
  for (int i = 0; i < 3; ++i) {
    angles_rad[i] = reading_after(angles_rad[i], last_angles_[i]);
    if (std::isfinite(angles_rad[i])) last_angles_[i] = angles_rad[i];
  }
}

std::optional<RotationLogEntry> RotationLogStream::next_checked() {
  const std::optional<CsvRow> row = table_.next();
  if (!row) return std::nullopt;
  RotationLogEntry entry{rotation_row(*row, columns_, table_.name()), true_intrinsics(*row, columns_, table_.name()),
                         row->line};
  layout_.sigma_scale = given_share(*row, columns_.sigma_scale, columns_, table_.name());
  layout_.sigma_parallax = given_share(*row, columns_.sigma_parallax, columns_, table_.name());
  if (last_ && entry.row.t_s < last_->row.t_s) {
    throw InputError(CsvPlace{table_.name(), row->line, columns_.names[columns_.t]}.text() + ": '" +
                     row->cells[columns_.t] + "' is before the row above; time must not go back");
  }
  return entry;
}

RotationLogFile read_rotation_log(const std::filesystem::path& file, const RotationLogOptions& options) {
  return parse_rotation_log(read_file(file), file.string(), options);
}

RotationLogFile parse_rotation_log(const std::string& csv, const std::string& name, const RotationLogOptions& options) {
  std::istringstream text(csv);
  RotationLogStream stream(text, name, options);
  RotationLogFile read{stream.layout(), {}};
  while (std::optional<RotationLogEntry> entry = stream.next()) {
    read.log.sigma_scale = stream.layout().sigma_scale;
    read.log.sigma_parallax = stream.layout().sigma_parallax;
    read.log.rows.push_back(std::move(entry->row));
    if (entry->truth) read.log.truth.push_back(*entry->truth);
  }
  read.skipped = stream.skipped();
  check_log(read.log, name);
  return read;
}

std::string rotation_log_csv(const RotationLog& log) {
  std::string text = header_of(log);
  const bool has_range = text.find(",range_m") != std::string::npos;
  for (std::size_t i = 0; i < log.rows.size(); ++i) {
    const RotationRow& row = log.rows[i];
    fmt::format_to(std::back_inserter(text), "{:.9f}", row.t_s);
    append_rotation(text, log, row);
    if (log.has_velocity) append_cells(text, row.velocity_m_per_s.data(), 3, true);
    for (const Eigen::Vector2d& px : row.px) text += is_seen(px) ? fmt::format(",{:.6f},{:.6f}", px.x(), px.y()) : ",,";
    if (has_range) append_cells(text, &row.range_m, 1, std::isfinite(row.range_m));
    if (!log.truth.empty())
      for (const double value : log.truth[i]) fmt::format_to(std::back_inserter(text), ",{:.6f}", value);
    for (const std::optional<double>& given : {log.sigma_scale, log.sigma_parallax})
      if (given) fmt::format_to(std::back_inserter(text), ",{:g}", *given);
    text += '\n';
  }
  return text;
}

}  // namespace alidade
