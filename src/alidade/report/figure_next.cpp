#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <numbers>

#include "alidade/report/figures.h"
#include "alidade/report/markup.h"
#include "alidade/report/picture_map.h"
#include "alidade/report/scale.h"

namespace alidade::report {
namespace {

constexpr double width = 460.0;

// A sketch: the lens' distortion is left out.
struct Pinhole {
  double fx, fy, cx, cy;
  [[nodiscard]] bool project(const Eigen::Vector3d& point_in_cam, double& u, double& v) const {
    if (!(point_in_cam.z() > 1e-6)) return false;
    u = fx * point_in_cam.x() / point_in_cam.z() + cx;
    v = fy * point_in_cam.y() / point_in_cam.z() + cy;
    return std::abs(u) < 1e5 && std::abs(v) < 1e5;
  }
};

bool append_board(std::string& d, const CalibrateScene& scene, const PicturePanel& panel, const Pinhole& lens,
                  const Rigid3& cam_from_board, Eigen::Vector4d box) {
  std::vector<Place> places;
  for (const auto& [x, y] :
       {std::pair{box[0], box[1]}, std::pair{box[2], box[1]}, std::pair{box[2], box[3]}, std::pair{box[0], box[3]}}) {
    double u = 0.0, v = 0.0;
    if (!lens.project(cam_from_board * Eigen::Vector3d(scene.square_m * x, scene.square_m * y, 0.0), u, v))
      return false;
    places.push_back(panel.at(u, v));
  }
  append_polyline(d, places, true);
  return true;
}

std::string board_sketch(const CalibrateScene& scene, const Rigid3& cam_from_board) {
  const Document& document = scene.document;
  const Pinhole lens{document.estimated("camera.fx"), document.estimated("camera.fy"), document.estimated("camera.cx"),
                     document.estimated("camera.cy")};
  if (!scene.has_picture_size() || !(scene.square_m > 0.0) || scene.board_cols < 2 || !(lens.fx > 0.0) ||
      !(lens.fy > 0.0))
    return "";
  const PicturePanel panel = PicturePanel::fitting(scene.width_px, scene.height_px, width, 320.0);
  std::string outline, squares;
  if (!append_board(outline, scene, panel, lens, cam_from_board,
                    {-1.0, -1.0, scene.board_cols + 0.0, scene.board_rows + 0.0}))
    return "";
  for (int row = -1; row < scene.board_rows; ++row)
    for (int col = row % 2 == 0 ? 0 : -1; col < scene.board_cols; col += 2)
      append_board(squares, scene, panel, lens, cam_from_board, {col + 0.0, row + 0.0, col + 1.0, row + 1.0});
  Svg svg(width, panel.height(), "Sketch of the best next photo");
  svg.raw("<clipPath id=\"clip-next\">");
  svg.rect({panel.left, panel.top}, panel.width(), panel.height(), "");
  svg.raw("</clipPath>");
  panel.frame(svg, "panel");
  svg.raw("<g clip-path=\"url(#clip-next)\">");
  svg.path(outline, "next-sheet");
  svg.path(squares, "next-square");
  svg.raw("</g>");
  return svg.str();
}

std::string pose_words(const CalibrateScene& scene, const Rigid3& cam_from_board) {
  const Eigen::Vector3d middle = cam_from_board * Eigen::Vector3d(0.5 * scene.square_m * (scene.board_cols - 1),
                                                                  0.5 * scene.square_m * (scene.board_rows - 1), 0.0);
  const Eigen::Vector3d normal = cam_from_board.rotation * Eigen::Vector3d::UnitZ();
  const double tilt_deg = std::acos(std::min(1.0, std::abs(normal.z()))) * 180.0 / std::numbers::pi;
  return fmt::format("Board {} m away, tilted {:.0f}° from the picture plane, where the sketch shows it.",
                     number_text(middle.norm(), 2), tilt_deg);
}

double worst_now(const Document& document) {
  for (const char* name : {"sigma_infinity", "sigma_working"})
    if (const Grid* grid = document.grid(name))
      if (const double worst = 3.0 * largest_size(grid->value("sigma_px")); worst > 0.0) return worst;
  return std::nan("");
}

std::string gain_bars(double now, const Table& next) {
  std::vector<std::pair<std::string, double>> bars;
  if (std::isfinite(now)) bars.emplace_back("now", now);
  for (std::size_t row = 0; row < std::min<std::size_t>(next.num_rows, 5); ++row)
    if (const double worst = next.number("worst_3sigma_px", row); std::isfinite(worst))
      bars.emplace_back(row == 0 ? "with the best" : fmt::format("with choice {}", row + 1), worst);
  if (bars.empty()) return "";
  double highest = 0.0;
  for (const auto& bar : bars) highest = std::max(highest, bar.second);
  const double left = 110.0, bottom = 22.0 + 22.0 * static_cast<double>(bars.size());
  const Scale x{0.0, std::max(highest, 1e-9), left, width - 66.0};
  Svg svg(width, bottom + 4.0, "Worst 3σ in the picture now and after the next photo");
  svg.text({8.0, 13.0}, "worst 3σ in the picture, px", "small");
  for (std::size_t i = 0; i < bars.size(); ++i) {
    const double y = 22.0 + 22.0 * static_cast<double>(i);
    svg.text({left - 8.0, y + 13.0}, bars[i].first, "tick", "end");
    svg.rect({left, y}, x(bars[i].second) - left, 16.0, i == 0 && std::isfinite(now) ? "bar-muted" : "bar-fill");
    svg.text({x(bars[i].second) + 6.0, y + 13.0}, number_text(bars[i].second, 2) + " px", "tick");
  }
  return svg.str();
}

}  // namespace

MaybeFigure figure_next(const CalibrateScene& scene) {
  const Table* next = scene.document.table("next");
  if (!next) return std::nullopt;
  Figure figure{.id = "next", .title = "What next?", .note = "the photo that would help most", .span = 7};
  figure.body = gain_bars(worst_now(scene.document), *next);
  Rigid3 cam_from_board;
  if (read_pose(*next, "cam_from_board", 0, cam_from_board)) {
    figure.body += board_sketch(scene, cam_from_board);
    figure.good = pose_words(scene, cam_from_board);
  }
  if (figure.body.empty()) return std::nullopt;
  figure.marks = next->num_rows;
  return figure;
}

}  // namespace alidade::report
