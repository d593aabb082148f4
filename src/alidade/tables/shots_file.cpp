#include "alidade/tables/shots_file.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <iterator>
#include <set>

#include "alidade/files/table_rows.h"

namespace alidade {
namespace {

/// ShotColumns of one table by what they mean; empty: not there.
struct ShotColumns {
  std::string u, v, d;
};

std::string either(const Csv& csv, const char* first, const char* second) {
  return csv.has(first) ? first : csv.has(second) ? second : "";
}

ShotColumns shot_columns_of(const Csv& csv) {
  if (!csv.has("range_m")) csv.refuse_missing("range_m");
  const ShotColumns columns{either(csv, "u", "u_px"), either(csv, "v", "v_px"), either(csv, "d", "d_m")};
  if (columns.u.empty() != columns.v.empty())
    throw InputError(csv.name() + ": has one of 'u' and 'v', a spot needs both");
  const int num_of_plane = csv.has("nx") + csv.has("ny") + csv.has("nz") + !columns.d.empty();
  if (num_of_plane != 0 && num_of_plane != 4)
    throw InputError(csv.name() + ": a plane needs all of 'nx', 'ny', 'nz' and 'd'");
  if (columns.u.empty() && num_of_plane == 0 && !csv.has("photo"))
    throw InputError(csv.name() + ": has ranges alone; 'u,v', 'photo' or 'nx,ny,nz,d' must say what was hit");
  return columns;
}

bool is_given(const Csv& csv, std::size_t row, const std::string& column) {
  return !column.empty() && csv.has(column) && !csv.is_empty(row, column);
}

double above_zero(const Csv& csv, std::size_t row, const std::string& column) {
  const double value = csv.number(row, column);
  if (!(value > 0.0)) throw InputError(csv.where(row, column) + ": '" + csv.text(row, column) + "' is not above zero");
  return value;
}

/// Metres: what is beyond 1 km is millimetres.
double range_of(const Csv& csv, std::size_t row) {
  constexpr double max_m = 1000.0;
  const double range_m = above_zero(csv, row, "range_m");
  if (range_m > max_m)
    throw InputError(csv.where(row, "range_m") + ": '" + csv.text(row, "range_m") +
                     "' is beyond 1000 m; ranges are metres");
  return range_m;
}

Spot spot_of(const Csv& csv, std::size_t row, const ShotColumns& columns) {
  constexpr double max_px = 1e6;
  for (const std::string& name : {columns.u, columns.v}) {
    if (csv.is_empty(row, name)) throw InputError(csv.where(row, name) + ": is empty; a spot needs u and v");
    if (std::abs(csv.number(row, name)) > max_px)
      throw InputError(csv.where(row, name) + ": '" + csv.text(row, name) + "' is in no image");
  }
  Spot spot{.px = {csv.number(row, columns.u), csv.number(row, columns.v)}};
  if (is_given(csv, row, "sigma_px")) spot.sigma_px = above_zero(csv, row, "sigma_px");
  return spot;
}

Plane plane_of_row(const Csv& csv, std::size_t row, const ShotColumns& columns) {
  for (const std::string& name : {std::string("nx"), std::string("ny"), std::string("nz"), columns.d}) {
    if (csv.is_empty(row, name)) throw InputError(csv.where(row, name) + ": is empty; a plane needs nx, ny, nz and d");
  }
  Plane plane;
  plane.normal_in_cam = {csv.number(row, "nx"), csv.number(row, "ny"), csv.number(row, "nz")};
  plane.d_m = csv.number(row, columns.d);
  const double length = plane.normal_in_cam.norm();
  if (!(std::abs(length - 1.0) < 1e-3))
    throw InputError(csv.where(row, "nx") + fmt::format(": the normal's length is {:.6g}, not 1", length));
  plane.normal_in_cam /= length;
  if (std::abs(plane.d_m) < 1e-3)
    throw InputError(csv.where(row, columns.d) + ": the plane passes through the camera's centre");
  if (plane.d_m > 0.0) {
    plane.normal_in_cam = -plane.normal_in_cam;
    plane.d_m = -plane.d_m;
  }
  return plane;
}

Shot shot_of_row(const Csv& csv, std::size_t row, const ShotColumns& columns) {
  Shot read;
  read.table = csv.name();
  read.line = csv.line(row);
  read.range_m = range_of(csv, row);
  if (is_given(csv, row, "sigma_range_m")) read.sigma_range_m = above_zero(csv, row, "sigma_range_m");
  if (is_given(csv, row, columns.u) || is_given(csv, row, columns.v)) read.spot = spot_of(csv, row, columns);
  if (is_given(csv, row, "nx") || is_given(csv, row, "ny") || is_given(csv, row, "nz") ||
      is_given(csv, row, columns.d)) {
    read.plane = plane_of_row(csv, row, columns);
  }
  if (is_given(csv, row, "photo")) read.photo = csv.text(row, "photo");
  if (is_given(csv, row, "photo_off")) read.photo_off = csv.text(row, "photo_off");
  if (!read.photo_off.empty() && read.photo.empty())
    throw InputError(csv.where(row, "photo") + ": is empty, but there is a 'photo_off'");
  if (!read.spot && !read.plane && read.photo.empty())
    throw InputError(csv.where(row, "range_m") + ": nothing says what this range hit: a spot, a photo or a plane");
  read.name = read.photo.empty() ? fmt::format("row {}", read.line) : read.photo;
  return read;
}

/// Where the camera looks at none of several boards, the distances have the other sign. Planes here have d < 0.
void refuse_planes_behind(const Csv& csv, std::span<const Shot> shots) {
  constexpr std::ptrdiff_t several = 3;
  const auto has_plane = [](const Shot& shot) { return shot.plane.has_value(); };
  const auto is_behind = [](const Shot& shot) { return shot.plane && shot.plane->normal_in_cam.z() < 0.0; };
  const auto num = std::ranges::count_if(shots, has_plane);
  if (num >= several && std::ranges::count_if(shots, is_behind) == num)
    throw InputError(
        csv.name() +
        ": all planes are behind the camera: a board's points x have n·x + d = 0, is 'd' of the other sign?");
}

/// Corners of other photos than the shots': of another folder, or named otherwise.
[[noreturn]] void refuse_foreign_corners(const std::filesystem::path& corners, const std::string& photo,
                                         std::span<const Shot> shots) {
  const auto named = std::ranges::find_if(shots, [](const Shot& shot) { return !shot.photo.empty(); });
  throw InputError(
      corners.string() + ": has corners of no shot's photo: '" + photo + "' is none of them" +
      (named != shots.end() ? ", they are named as '" + named->photo + "'" : "; the shots need a column 'photo'"));
}

std::string number(double value) { return fmt::format("{:.9g}", value); }

}  // namespace

ShotsFile read_shots(const std::filesystem::path& file, const ShotsOptions& options) {
  return read_shots(Csv::read(file, options.skip_bad), options);
}

ShotsFile read_shots(const Csv& csv, const ShotsOptions& options) {
  const ShotColumns columns = shot_columns_of(csv);
  ShotsFile read;
  std::set<std::string> seen;  // a duplicate measurement would be counted twice
  for_each_row(csv, options.skip_bad, read.skipped, [&](std::size_t row) {
    Shot shot = shot_of_row(csv, row, columns);
    std::string cells;
    for (const std::string& name : csv.header()) cells += csv.text(row, name) + ",";
    if (!seen.insert(std::move(cells)).second)
      throw InputError(csv.where(row, "range_m") + ": the same shot is in an earlier row");
    read.shots.push_back(std::move(shot));
  });
  if (read.shots.empty()) throw InputError(csv.name() + ": has no shots; at least one row is needed");
  refuse_planes_behind(csv, read.shots);
  return read;
}

std::map<std::string, std::string> photo_roles(std::span<const Shot> shots) {
  std::map<std::string, std::string> roles;
  for (const Shot& shot : shots)
    if (!shot.photo_off.empty()) roles[shot.photo_off] = "photo_off";
  return roles;
}

std::vector<SkippedInput> add_corners(const std::filesystem::path& corners, std::span<const BoardView> views,
                                      std::vector<Shot>& shots) {
  if (views.empty()) throw InputError(corners.string() + ": has no corners");
  std::vector<SkippedInput> foreign;
  for (const BoardView& view : views) {
    bool is_of_a_shot = false;
    for (Shot& shot : shots) {
      if (shot.photo != view.photo) continue;
      shot.board = view;
      is_of_a_shot = true;
    }
    if (!is_of_a_shot)
      foreign.push_back(
          {corners.string(), 0,
           fmt::format("no shot has the photo '{}': its {} corners are not used", view.photo, view.corners.size())});
  }
  if (foreign.size() == views.size()) refuse_foreign_corners(corners, views.front().photo, shots);
  for (Shot& shot : shots)
    if (!shot.photo.empty() && !shot.board) shot.no_board = "has no corners in " + corners.string();
  return foreign;
}

void refuse_photo_of(const Shot& shot, const std::string& reason) {
  // Simulated and measured elsewhere: shots name photos that do not exist, and their corners are in a file beside them.
  const std::filesystem::path corners = std::filesystem::path(shot.table).parent_path() / "corners.csv";
  std::string what = fmt::format("{}:{}: photo '{}': {}", shot.table, shot.line, shot.photo, reason);
  if (std::filesystem::exists(corners)) what += "; for the corners in its stead: --corners " + corners.string();
  throw InputError(what);
}

std::string shots_csv(std::span<const Shot> shots, bool with_photos) {
  std::string text = "range_m,u,v,nx,ny,nz,d";
  text += with_photos ? ",photo\n" : "\n";
  for (const Shot& shot : shots) {
    text += number(shot.range_m);
    text += shot.spot ? fmt::format(",{:.4f},{:.4f}", shot.spot->px.x(), shot.spot->px.y()) : ",,";
    if (shot.plane) {
      const Eigen::Vector3d& n = shot.plane->normal_in_cam;
      text += "," + number(n.x()) + "," + number(n.y()) + "," + number(n.z()) + "," + number(shot.plane->d_m);
    } else {
      text += ",,,,";
    }
    text += with_photos ? "," + csv_cell(shot.name) + "\n" : "\n";
  }
  return text;
}

}  // namespace alidade
