#include "alidade/tables/logs/rotation_log_columns.h"

#include <fmt/format.h>

#include <algorithm>
#include <cctype>
#include <cmath>
#include <map>
#include <numbers>
#include <span>
#include <utility>

#include "alidade/geometry/degree.h"

namespace alidade {
namespace {

std::string lower(std::string text) {
  std::transform(text.begin(), text.end(), text.begin(),
                 [](char c) { return static_cast<char>(std::tolower(static_cast<unsigned char>(c))); });
  return text;
}

/// Letters to insert, delete or replace.
std::size_t edit_distance(const std::string& a, const std::string& b) {
  std::vector<std::size_t> row(b.size() + 1);
  for (std::size_t j = 0; j <= b.size(); ++j) row[j] = j;
  for (std::size_t i = 0; i < a.size(); ++i) {
    std::size_t diagonal = std::exchange(row[0], i + 1);
    for (std::size_t j = 0; j < b.size(); ++j) {
      const std::size_t replaced = diagonal + (a[i] == b[j] ? 0 : 1);
      diagonal = row[j + 1];
      row[j + 1] = std::min({replaced, row[j] + 1, row[j + 1] + 1});
    }
  }
  return row.back();
}

/// Number of a point and its axis, of "p12x"; none for anything else.
std::optional<std::pair<std::size_t, std::size_t>> point_of(const std::string& name) {
  constexpr std::size_t max_digits = 6;
  if (name.size() < 3 || name.size() > 2 + max_digits || name.front() != 'p') return std::nullopt;
  if (name.back() != 'x' && name.back() != 'y') return std::nullopt;
  const std::string digits = name.substr(1, name.size() - 2);
  if (digits.find_first_not_of("0123456789") != std::string::npos || digits.front() == '0') return std::nullopt;
  return std::pair{static_cast<std::size_t>(std::stoul(digits)), name.back() == 'x' ? std::size_t{0} : std::size_t{1}};
}

using Names = std::vector<const char*>;  // spellings of one column

/// What the header holds, and what of it has been understood.
class Header {
 public:
  explicit Header(const CsvStream& table) : table_(table) {
    for (std::size_t i = 0; i < table.header().size(); ++i) column_.emplace(table.header()[i], i);
    is_used_.assign(table.header().size(), false);
  }

  [[nodiscard]] std::string at(const std::string& name) const {
    return CsvPlace{table_.name(), table_.header_line(), name}.text() + ": ";
  }

  /// The one of several spellings that is there.
  std::optional<std::size_t> find(const Names& spellings) {
    std::optional<std::size_t> found;
    for (const char* name : spellings) {
      known_.emplace_back(name);
      const auto it = column_.find(name);
      if (it == column_.end()) continue;
      if (found) throw InputError(at(name) + "duplicates '" + table_.header()[*found] + "', which means the same");
      found = it->second;
      is_used_[it->second] = true;
    }
    return found;
  }

  /// All of these or none: columns of those that are there, in this order. The last may be missing where
  /// `last_is_free`.
  std::vector<std::size_t> find_all(std::span<const Names> wanted, bool last_is_free) {
    std::vector<std::size_t> places;
    std::string missing;
    for (std::size_t i = 0; i < wanted.size(); ++i) {
      const std::optional<std::size_t> place = find(wanted[i]);
      if (place) places.push_back(*place);
      if (!place && !(last_is_free && i + 1 == wanted.size()) && missing.empty()) missing = wanted[i].front();
    }
    if (places.empty() || missing.empty()) return places;
    throw InputError(at(table_.header()[places.front()]) + "is there without '" + missing + "'");
  }

  std::vector<std::array<std::size_t, 2>> find_points() {
    constexpr std::size_t none = std::string::npos;
    std::map<std::size_t, std::array<std::size_t, 2>> points;
    for (const auto& [name, place] : column_) {
      const auto point = point_of(name);
      if (!point) continue;
      points.try_emplace(point->first, std::array{none, none}).first->second[point->second] = place;
      is_used_[place] = true;
    }
    std::vector<std::array<std::size_t, 2>> places;
    for (const auto& [number, place] : points) {
      const std::string p = fmt::format("p{}", number), next = fmt::format("p{}", places.size() + 1);
      if (place[0] == none) throw InputError(at(p + "y") + "is there without '" + p + "x'");
      if (place[1] == none) throw InputError(at(p + "x") + "is there without '" + p + "y'");
      if (number != places.size() + 1)
        throw InputError(at(p + "x") + "points are numbered 1, 2, 3, …; there is no '" + next + "x'");
      places.push_back(place);
    }
    return places;
  }

  /// Throws for the first column that was not requested.
  void refuse_rest() const {
    for (std::size_t i = 0; i < is_used_.size(); ++i) {
      if (is_used_[i]) continue;
      const std::string& name = table_.header()[i];
      throw InputError(at(name) + "is not known; " + meant_by(name));
    }
  }

 private:
  [[nodiscard]] std::string meant_by(const std::string& name) const {
    std::size_t nearest = 3;  // letters: beyond that it is another word
    std::string meant;
    for (const std::string& known : known_) {
      const std::size_t distance = edit_distance(lower(name), known);
      if (distance < std::min(nearest, known.size())) {
        nearest = distance;
        meant = known;
      }
    }
    const std::string small = lower(name);
    const bool is_like_point =
        small.size() > 1 && small[0] == 'p' && std::isdigit(static_cast<unsigned char>(small[1])) != 0;
    if (is_like_point) return "points are p1x, p1y, p2x, p2y, …";
    if (!meant.empty()) return "is '" + meant + "' meant?";
    return "a rotation log has t, omega_x, omega_y, omega_z or pan, tilt, roll or qw, qx, qy, qz, then p1x, p1y, …, "
           "and "
           "perhaps vx, vy, vz, range_m, frame, sigma_scale, sigma_parallax, fx, fy, cx, cy";
  }

  const CsvStream& table_;
  std::map<std::string, std::size_t> column_;
  std::vector<bool> is_used_;
  std::vector<std::string> known_;
};

std::vector<RotationLogColumns::Angle> find_head(Header& header, const std::vector<std::string>& names) {
  const std::array<Names, 3> wanted{
      {{"pan", "pan_rad", "pan_deg", "yaw", "yaw_rad", "yaw_deg", "azimuth", "azimuth_rad", "azimuth_deg"},
       {"tilt", "tilt_rad", "tilt_deg", "pitch", "pitch_rad", "pitch_deg", "elevation", "elevation_rad",
        "elevation_deg"},
       {"roll", "roll_rad", "roll_deg"}}};
  std::vector<RotationLogColumns::Angle> angles;
  for (const std::size_t column : header.find_all(wanted, true)) {
    const double unit_rad = names[column].ends_with("_deg") ? degree : 1.0;
    // An azimuth grows to the right, as a compass does; pan and yaw to the left.
    angles.push_back({column, names[column].starts_with("azimuth") ? -unit_rad : unit_rad});
  }
  if (angles.size() == 1) throw InputError(header.at(names[angles[0].column]) + "is there without 'pan' and 'tilt'");
  return angles;
}

void find_rotation(Header& header, const CsvStream& table, bool needs_rotation, RotationLogColumns& columns) {
  const std::array<Names, 3> rates{{{"omega_x"}, {"omega_y"}, {"omega_z"}}};
  const std::array<Names, 4> quaternion{{{"qw"}, {"qx"}, {"qy"}, {"qz"}}};
  columns.rate = header.find_all(rates, true);
  columns.head = find_head(header, columns.names);
  columns.quaternion = header.find_all(quaternion, false);
  std::vector<std::pair<RotationSource, std::string>> found;
  if (!columns.rate.empty()) found.emplace_back(RotationSource::rate, columns.names[columns.rate[0]]);
  if (!columns.head.empty()) found.emplace_back(RotationSource::head, columns.names[columns.head[0].column]);
  if (!columns.quaternion.empty()) found.emplace_back(RotationSource::attitude, columns.names[columns.quaternion[0]]);
  if (found.size() > 1)
    throw InputError(header.at(found[1].second) + "duplicates '" + found[0].second +
                     "'; leave one: angular rate, angles of the head or attitude");
  if (!found.empty()) columns.source = found[0].first;
  if (!found.empty() || !needs_rotation) return;
  header.refuse_rest();  // a misspelt column says more
  throw InputError(table.name() +
                   ": has no column 'omega_x', 'pan' or 'qw': how the camera turned; without it only "
                   "'--rotation free' can do");
}

/// Empty cells mean "not measured", all of them together.
template <typename Places>
bool is_measured(const CsvRow& row, const Places& places, const RotationLogColumns& columns, const std::string& file) {
  std::size_t empty = 0, first_empty = 0;
  for (const std::size_t place : places) {
    if (!row.cells[place].empty()) continue;
    if (empty++ == 0) first_empty = place;
  }
  if (empty == 0 || empty == places.size()) return empty == 0;
  throw InputError(CsvPlace{file, row.line, columns.names[first_empty]}.text() +
                   ": is empty, but what belongs to it is not");
}

/// Reads cells of one row; every error names its position.
struct Cells {
  const CsvRow& row;
  const RotationLogColumns& columns;
  const std::string& file;

  [[nodiscard]] CsvPlace place(std::size_t column) const { return {file, row.line, columns.names[column]}; }
  [[nodiscard]] const std::string& text(std::size_t column) const { return row.cells[column]; }
  [[nodiscard]] double number(std::size_t column) const { return csv_number(text(column), place(column)); }
  [[nodiscard]] std::string fault(std::size_t column) const {
    return place(column).text() + ": '" + text(column) + "' ";
  }
};

Eigen::Vector3d read_rate(const Cells& cells) {
  constexpr double fastest_rad_per_s = 100.0;  // 16 turns a second: nothing is visible at that rate
  Eigen::Vector3d rate = Eigen::Vector3d::Zero();
  for (std::size_t i = 0; i < cells.columns.rate.size(); ++i) {
    const std::size_t column = cells.columns.rate[i];
    rate[static_cast<Eigen::Index>(i)] = cells.number(column);
    if (std::abs(rate[static_cast<Eigen::Index>(i)]) > fastest_rad_per_s)
      throw InputError(cells.fault(column) + "is beyond 100 rad/s; rad/s are expected");
  }
  return rate;
}

Eigen::Vector3d read_head(const Cells& cells) {
  constexpr double max_rad = 4.0 * std::numbers::pi;  // two turns: no cable bears more
  Eigen::Vector3d angles = Eigen::Vector3d::Zero();
  for (std::size_t i = 0; i < cells.columns.head.size(); ++i) {
    const auto& [column, unit_rad] = cells.columns.head[i];
    const double angle = cells.number(column) * unit_rad;
    if (std::abs(angle) > max_rad)
      throw InputError(cells.fault(column) + "is more than two turns; " +
                       (std::abs(unit_rad) == 1.0
                            ? "rad expected (degrees: name the column '" +
                                  cells.columns.names[column].substr(0, cells.columns.names[column].find('_')) +
                                  "_deg')"
                            : "degrees expected"));
    angles[static_cast<Eigen::Index>(i)] = angle;
  }
  return angles;
}

Eigen::Quaterniond read_attitude(const Cells& cells) {
  constexpr double slack = 1e-3;
  std::array<double, 4> q{};
  for (std::size_t i = 0; i < 4; ++i) q[i] = cells.number(cells.columns.quaternion[i]);
  const Eigen::Quaterniond base_from_cam(q[0], q[1], q[2], q[3]);
  if (const double norm = base_from_cam.norm(); !(std::abs(norm - 1.0) <= slack))
    throw InputError(cells.place(cells.columns.quaternion[0]).text() + ": the quaternion's norm is " +
                     std::to_string(norm) + ", not 1");
  return base_from_cam.normalized();
}

std::vector<std::size_t> head_places(const RotationLogColumns& columns) {
  std::vector<std::size_t> places;
  for (const RotationLogColumns::Angle& angle : columns.head) places.push_back(angle.column);
  return places;
}

void read_rotation(const Cells& cells, RotationRow& row) {
  const RotationLogColumns& columns = cells.columns;
  const auto has = [&](const auto& places) { return is_measured(cells.row, places, columns, cells.file); };
  if (columns.source == RotationSource::rate && has(columns.rate)) row.rate_rad_per_s = read_rate(cells);
  if (columns.source == RotationSource::head && has(head_places(columns))) row.pan_tilt_roll_rad = read_head(cells);
  if (columns.source == RotationSource::attitude && has(columns.quaternion)) row.base_from_cam = read_attitude(cells);
}

/// By the column's name; 0: by how large the numbers are.
double time_unit_s(const std::string& name) {
  if (name.ends_with("_ms")) return 1e-3;
  if (name.ends_with("_us")) return 1e-6;
  if (name.ends_with("_ns")) return 1e-9;
  return name.ends_with("_s") ? 1.0 : 0.0;
}

double read_range(const Cells& cells, std::size_t column) {
  const double range_m = cells.number(column);
  if (!(range_m > 0.0)) throw InputError(cells.fault(column) + "is not above zero");
  return range_m;
}

}  // namespace

double csv_pixel(const std::string& cell, const CsvPlace& place) {
  constexpr double max_px = 1e6;
  const double px = csv_number(cell, place);
  if (std::abs(px) <= max_px) return px;
  throw InputError(place.text() + ": '" + cell + "' is out of range; pixels up to 1e6 are read");
}

RotationLogColumns rotation_log_columns(const CsvStream& table, bool needs_rotation, bool needs_points) {
  const std::array<Names, 3> velocity{{{"vx"}, {"vy"}, {"vz"}}};
  const std::array<Names, 4> truth{{{"fx"}, {"fy"}, {"cx", "u0"}, {"cy", "v0"}}};
  RotationLogColumns columns;
  columns.names = table.header();
  Header header(table);
  const std::optional<std::size_t> t =
      header.find({"t", "t_s", "time", "time_s", "timestamp", "timestamp_s", "t_ms", "time_ms", "timestamp_ms", "t_us",
                   "time_us", "timestamp_us", "t_ns", "time_ns", "timestamp_ns"});
  columns.points = header.find_points();
  columns.velocity = header.find_all(velocity, false);
  columns.truth = header.find_all(truth, false);
  columns.range = header.find({"range_m"});
  columns.sigma_scale = header.find({"sigma_scale"});
  columns.sigma_parallax = header.find({"sigma_parallax"});
  (void)header.find({"frame"});
  find_rotation(header, table, needs_rotation, columns);
  header.refuse_rest();
  if (!t) throw InputError(table.name() + ": has no column 't' (time, s)");
  columns.t = *t;
  columns.t_unit_s = time_unit_s(columns.names[*t]);
  if (needs_points && columns.points.empty())
    throw InputError(table.name() + ": has no points; columns p1x, p1y, … are needed");
  return columns;
}

RotationRow rotation_row(const CsvRow& row, const RotationLogColumns& columns, const std::string& file) {
  const Cells cells{row, columns, file};
  RotationRow read;
  read.t_s = csv_time_s(cells.text(columns.t), columns.t_unit_s, cells.place(columns.t));
  read_rotation(cells, read);
  for (std::size_t i = 0; i < columns.velocity.size(); ++i)
    read.velocity_m_per_s[static_cast<Eigen::Index>(i)] = cells.number(columns.velocity[i]);
  if (columns.range && !cells.text(*columns.range).empty()) read.range_m = read_range(cells, *columns.range);
  read.px.reserve(columns.points.size());
  for (const auto& place : columns.points) {
    const bool is_there = is_measured(row, place, columns, file);
    read.px.emplace_back(Eigen::Vector2d::Constant(not_seen));
    if (!is_there) continue;
    read.px.back() = {csv_pixel(cells.text(place[0]), cells.place(place[0])),
                      csv_pixel(cells.text(place[1]), cells.place(place[1]))};
  }
  return read;
}

std::optional<double> given_share(const CsvRow& row, const std::optional<std::size_t>& column,
                                  const RotationLogColumns& columns, const std::string& file) {
  if (!column) return std::nullopt;
  const Cells cells{row, columns, file};
  const double share = cells.number(*column);
  if (!(share >= 0.0 && share <= 1.0)) throw InputError(cells.fault(*column) + "is not a share from 0 to 1");
  return share;
}

std::optional<TrueIntrinsics> true_intrinsics(const CsvRow& row, const RotationLogColumns& columns,
                                              const std::string& file) {
  if (columns.truth.empty()) return std::nullopt;
  const Cells cells{row, columns, file};
  TrueIntrinsics truth{};
  for (std::size_t i = 0; i < truth.size(); ++i) {
    truth[i] = csv_pixel(cells.text(columns.truth[i]), cells.place(columns.truth[i]));
    if (i < 2 && !(truth[i] > 0.0)) throw InputError(cells.fault(columns.truth[i]) + "is not above zero");
  }
  return truth;
}

}  // namespace alidade
