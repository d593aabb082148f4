#include "alidade/tables/views_file.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <map>
#include <numbers>

#include "alidade/files/table_rows.h"

namespace alidade {
namespace {

constexpr long max_views = 1'000'000;

/// ViewColumns of one table by what they mean; empty: not there.
struct ViewColumns {
  std::string u, v;
  bool has_photo = false;
};

ViewColumns view_columns_of(const Csv& csv) {
  csv.require(std::vector<std::string>{"pan_rad", "tilt_rad", "view", "board", "head"});
  ViewColumns columns{csv.has("u") ? "u" : "u_px", csv.has("v") ? "v" : "v_px", csv.has("photo")};
  if (columns.has_photo) return columns;
  for (const std::string& name : {std::string("corner"), columns.u, columns.v}) {
    if (csv.has(name)) continue;
    throw InputError(csv.name() + ": has no column '" + (name.size() > 1 && name[1] == '_' ? name.substr(0, 1) : name) +
                     "'; corners 'corner,u,v' or a 'photo' must say what was seen");
  }
  return columns;
}

double angle_of(const Csv& csv, std::size_t row, const std::string& column) {
  const double angle = csv.number(row, column);
  if (!(std::abs(angle) <= 2.0 * std::numbers::pi))
    throw InputError(csv.where(row, column) + ": '" + csv.text(row, column) +
                     "' is more than a turn; angles are radians");
  return angle;
}

/// What a row says of its view.
HeadView view_of(const Csv& csv, std::size_t row, const ViewColumns& columns) {
  HeadView view;
  const long number = csv.integer(row, "view", 0, max_views);
  view.board = static_cast<int>(csv.integer(row, "board", 0, max_views));
  view.head = static_cast<int>(csv.integer(row, "head", 0, max_views));
  view.pan_tilt_rad = {angle_of(csv, row, "pan_rad"), angle_of(csv, row, "tilt_rad")};
  view.seen.photo = columns.has_photo ? csv.text(row, "photo") : fmt::format("view {}", number);
  if (columns.has_photo && view.seen.photo.empty()) throw InputError(csv.where(row, "photo") + ": is empty");
  return view;
}

Corner corner_of(const Csv& csv, std::size_t row, const ViewColumns& columns, int num_points) {
  constexpr double max_px = 1e6;
  Corner corner;
  const long index = csv.integer(row, "corner", 0, 1'000'000);
  if (index >= num_points)
    throw InputError(csv.where(row, "corner") +
                     fmt::format(": '{}' is not a corner of a board of {}", index, num_points));
  corner.index = static_cast<int>(index);
  corner.px = {csv.number(row, columns.u), csv.number(row, columns.v)};
  for (int axis = 0; axis < 2; ++axis) {
    const std::string& name = axis == 0 ? columns.u : columns.v;
    if (!(std::abs(corner.px[axis]) <= max_px)) throw InputError(csv.where(row, name) + ": is in no image");
  }
  return corner;
}

/// Adds a row to its view, which is made with its first row.
void add_row(const Csv& csv, std::size_t row, const ViewColumns& columns, int num_points,
             std::map<long, std::size_t>& index, ViewsFile& read) {
  const HeadView given = view_of(csv, row, columns);
  const long number = csv.integer(row, "view", 0, max_views);
  const auto found = index.find(number);
  if (found == index.end()) {
    HeadView view = given;
    if (!columns.has_photo) view.seen.corners.push_back(corner_of(csv, row, columns, num_points));
    index.emplace(number, read.views.size());
    read.views.push_back(std::move(view));
    return;
  }
  HeadView& view = read.views[found->second];
  if (columns.has_photo) throw InputError(csv.where(row, "view") + fmt::format(": {} appears twice", number));
  const auto must_be = [&](const char* column, bool is_same) {
    if (!is_same)
      throw InputError(csv.where(row, column) +
                       fmt::format(": '{}' differs from the first row of view {}", csv.text(row, column), number));
  };
  must_be("board", view.board == given.board);
  must_be("head", view.head == given.head);
  must_be("pan_rad", view.pan_tilt_rad.x() == given.pan_tilt_rad.x());
  must_be("tilt_rad", view.pan_tilt_rad.y() == given.pan_tilt_rad.y());
  const Corner corner = corner_of(csv, row, columns, num_points);
  if (std::ranges::any_of(view.seen.corners, [&](const Corner& other) { return other.index == corner.index; }))
    throw InputError(csv.where(row, "corner") + fmt::format(": {} appears twice in view {}", corner.index, number));
  view.seen.corners.push_back(corner);
}

}  // namespace

ViewsFile read_views(const std::filesystem::path& file, const ViewsOptions& options) {
  return read_views(Csv::read(file, options.skip_bad), options);
}

ViewsFile read_views(const Csv& csv, const ViewsOptions& options) {
  const ViewColumns columns = view_columns_of(csv);
  ViewsFile read{{}, {}, columns.has_photo};
  std::map<long, std::size_t> index;
  for_each_row(csv, options.skip_bad, read.skipped,
               [&](std::size_t row) { add_row(csv, row, columns, options.num_points, index, read); });
  if (read.views.empty()) throw InputError(csv.name() + ": has no views; at least one row is needed");
  return read;
}

void require_corners_inside(const std::filesystem::path& file, std::span<const HeadView> views,
                            const std::map<int, Camera>& cameras) {
  const std::string fault = image_fault(views, cameras);
  if (!fault.empty()) throw InputError(file.string() + ": " + fault);
}

void refuse_photo(const std::filesystem::path& file, const SkippedInput& photo) {
  throw InputError(fmt::format("{}: photo '{}': {}", file.string(), photo.file, photo.reason));
}

std::string views_csv(std::span<const HeadView> views) {
  std::string text = "view,board,head,pan_rad,tilt_rad,corner,u,v\n";
  for (std::size_t i = 0; i < views.size(); ++i) {
    const HeadView& view = views[i];
    for (const Corner& corner : view.seen.corners)
      text += fmt::format("{},{},{},{},{},{},{:.4f},{:.4f}\n", i, view.board, view.head, view.pan_tilt_rad.x(),
                          view.pan_tilt_rad.y(), corner.index, corner.px.x(), corner.px.y());
  }
  return text;
}

}  // namespace alidade
