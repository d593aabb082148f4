#include "alidade/report/calibrate_scene.h"

#include <algorithm>
#include <cmath>
#include <cstdio>
#include <cstdlib>
#include <unordered_map>

#include "alidade/report/jpeg_size.h"

namespace alidade::report {
namespace {

void read_photos(const Table& table, CalibrateScene& scene) {
  for (std::size_t row = 0; row < table.num_rows; ++row) {
    PhotoMark photo;
    photo.name = table.text("name", row);
    photo.reason = table.text("reason", row);
    photo.is_used = table.number("used", row) == 1.0;
    photo.rms_px = table.number("rms_px", row);
    photo.has_pose = read_pose(table, "cam_from_board", row, photo.cam_from_board);
    scene.photos.push_back(photo);
  }
}

// `photo` of a corner is a row of `photos` or a name; corners of a photo that is not listed belong to none.
std::vector<std::size_t> photo_of_corner(const Table& corners, const CalibrateScene& scene) {
  std::unordered_map<std::string, std::size_t> by_name;
  for (std::size_t i = 0; i < scene.photos.size(); ++i) by_name.emplace(scene.photos[i].name, i);
  const Column* column = corners.find("photo");
  std::vector<std::size_t> photos(corners.num_rows, scene.photos.size());
  for (std::size_t row = 0; column && row < corners.num_rows; ++row) {
    if (!column->texts.empty()) {
      const auto found = by_name.find(column->texts[row]);
      if (found != by_name.end()) photos[row] = found->second;
    } else if (column->numbers[row] >= 0.0 && column->numbers[row] < static_cast<double>(scene.photos.size())) {
      photos[row] = static_cast<std::size_t>(column->numbers[row]);
    }
  }
  return photos;
}

void read_corners(const Table& table, CalibrateScene& scene) {
  const std::vector<std::size_t> photo = photo_of_corner(table, scene);
  const auto u = table.numbers("u_px"), v = table.numbers("v_px"), residual_u = table.numbers("residual_u_px"),
             residual_v = table.numbers("residual_v_px"), sigma_u = table.numbers("sigma_u_px"),
             sigma_v = table.numbers("sigma_v_px"), corr = table.numbers("corr_uv"), weight = table.numbers("weight");
  for (std::size_t row = 0; row < table.num_rows; ++row) {
    if (!std::isfinite(u[row]) || !std::isfinite(v[row])) continue;
    if (photo[row] < scene.photos.size()) scene.photos[photo[row]].corners.push_back(scene.corners.size());
    scene.corners.push_back({photo[row], u[row], v[row], residual_u[row], residual_v[row], sigma_u[row], sigma_v[row],
                             std::isfinite(corr[row]) ? corr[row] : 0.0, !(weight[row] == 0.0)});
  }
}

void rank_photos(CalibrateScene& scene) {
  for (std::size_t i = 0; i < scene.photos.size(); ++i)
    (scene.photos[i].is_used && std::isfinite(scene.photos[i].rms_px) ? scene.worst_first : scene.unused).push_back(i);
  std::stable_sort(scene.worst_first.begin(), scene.worst_first.end(),
                   [&](std::size_t a, std::size_t b) { return scene.photos[a].rms_px > scene.photos[b].rms_px; });
  if (!scene.worst_first.empty()) scene.chosen = scene.worst_first.front();
}

// A word behind an option of the command line, for documents that do not repeat it elsewhere.
std::string option(const Document& document, const std::string& name) {
  for (std::size_t i = 0; i < document.argv.size(); ++i) {
    if (document.argv[i] == name && i + 1 < document.argv.size()) return document.argv[i + 1];
    if (document.argv[i].rfind(name + "=", 0) == 0) return document.argv[i].substr(name.size() + 1);
  }
  return "";
}

// One more than the largest index.
int count_up_to(const std::vector<double>& indices) {
  int count = 0;
  for (const double index : indices)
    if (index >= 0.0 && index < 1e4) count = std::max(count, static_cast<int>(index) + 1);
  return count;
}

void read_board(CalibrateScene& scene) {
  const Document& document = scene.document;
  scene.square_m = document.estimated("board.square_m");
  if (!(scene.square_m > 0.0)) scene.square_m = std::strtod(option(document, "--square").c_str(), nullptr);
  if (!(scene.square_m > 0.0) || !std::isfinite(scene.square_m)) scene.square_m = 0.0;
  if (const Table* corners = document.table("corners")) {
    scene.board_cols = count_up_to(corners->numbers("col"));
    scene.board_rows = count_up_to(corners->numbers("row"));
  }
  int cols = 0, rows = 0;
  if (std::sscanf(option(document, "--board").c_str(), "%dx%d", &cols, &rows) == 2 && cols < 1000 && rows < 1000) {
    scene.board_cols = std::max(scene.board_cols, cols);
    scene.board_rows = std::max(scene.board_rows, rows);
  }
}

// Without a camera in the document the first picture tells at least the shape. Corners are then not drawn: the picture
// may be smaller than the photo, and they would stand in wrong places.
void read_picture_size(const Pictures& pictures, CalibrateScene& scene) {
  const double width = scene.document.estimated("camera.width"), height = scene.document.estimated("camera.height");
  if (width >= 1.0 && height >= 1.0) {
    scene.width_px = width;
    scene.height_px = height;
    return;
  }
  scene.corners.clear();
  for (PhotoMark& photo : scene.photos) photo.corners.clear();
  for (const auto& [name, bytes] : pictures)
    if (const auto size = jpeg_size(bytes)) {
      scene.width_px = size->width_px;
      scene.height_px = size->height_px;
      return;
    }
}

}  // namespace

bool read_pose(const Table& table, const std::string& prefix, std::size_t row, Rigid3& pose) {
  const auto part = [&](const char* name) { return table.number(prefix + name, row); };
  pose.translation = {part("_x_m"), part("_y_m"), part("_z_m")};
  pose.rotation = Eigen::Quaterniond(part("_qw"), part("_qx"), part("_qy"), part("_qz"));
  const double norm = pose.rotation.norm();
  if (!pose.translation.allFinite() || !(norm > 0.5) || !(norm < 2.0)) return false;
  pose.rotation.normalize();
  return true;
}

CalibrateScene calibrate_scene(const Document& document, const Pictures& pictures) {
  CalibrateScene scene{.document = document};
  if (const Table* photos = document.table("photos")) read_photos(*photos, scene);
  if (const Table* corners = document.table("corners")) read_corners(*corners, scene);
  rank_photos(scene);
  read_board(scene);
  read_picture_size(pictures, scene);
  return scene;
}

}  // namespace alidade::report
