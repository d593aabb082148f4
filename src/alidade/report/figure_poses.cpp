#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <cmath>

#include "alidade/report/colours.h"
#include "alidade/report/figures.h"
#include "alidade/report/markup.h"
#include "alidade/report/picture_map.h"
#include "alidade/report/scale.h"
#include "alidade/report/view3.h"

namespace alidade::report {
namespace {

using Points = std::vector<Eigen::Vector3d>;

// RMS colours mean the same in every report.
constexpr double rms_low_px = 0.05, rms_high_px = 5.0;

std::string rms_colour(double rms_px) {
  if (!(rms_px > 0.0)) return "#888888";
  return hex(cividis(std::log(rms_px / rms_low_px) / std::log(rms_high_px / rms_low_px)));
}

// The paper around the corners: one square beyond the outermost.
Points board_outline(const CalibrateScene& scene, const Rigid3& cam_from_board) {
  const double a = -scene.square_m, x = scene.board_cols * scene.square_m, y = scene.board_rows * scene.square_m;
  Points outline;
  for (const Eigen::Vector3d& corner :
       {Eigen::Vector3d(a, a, 0.0), Eigen::Vector3d(x, a, 0.0), Eigen::Vector3d(x, y, 0.0), Eigen::Vector3d(a, y, 0.0)})
    outline.push_back(cam_from_board * corner);
  return outline;
}

struct PoseScene {
  const CalibrateScene& scene;
  std::vector<std::size_t> posed;  // used photos with a pose
  double frustum_m = 0.0;          // where the picture is shown
  Points frustum;                  // its four corners
  Points everything;
};

PoseScene pose_scene(const CalibrateScene& scene) {
  PoseScene poses{.scene = scene, .posed = {}, .frustum = {}, .everything = {Eigen::Vector3d::Zero()}};
  std::vector<double> distances;
  for (std::size_t i = 0; i < scene.photos.size(); ++i) {
    if (!scene.photos[i].is_used || !scene.photos[i].has_pose) continue;
    poses.posed.push_back(i);
    const Rigid3& cam_from_board = scene.photos[i].cam_from_board;
    distances.push_back(cam_from_board.translation.norm());
    for (const Eigen::Vector3d& point : board_outline(scene, cam_from_board)) poses.everything.push_back(point);
  }
  const double fx = scene.document.estimated("camera.fx"), fy = scene.document.estimated("camera.fy"),
               cx = scene.document.estimated("camera.cx"), cy = scene.document.estimated("camera.cy");
  if (poses.posed.empty() || !(fx > 0.0) || !(fy > 0.0) || !std::isfinite(cx) || !std::isfinite(cy)) return poses;
  if (!scene.has_picture_size()) return poses;
  // As large as an outstretched hand beside the boards, but not beyond them.
  poses.frustum_m = std::min(0.45 * quantile(distances, 0.5), 0.8 * quantile(distances, 0.0));
  for (const auto& [u, v] :
       {std::pair{-0.5, -0.5}, std::pair{scene.width_px - 0.5, -0.5},
        std::pair{scene.width_px - 0.5, scene.height_px - 0.5}, std::pair{-0.5, scene.height_px - 0.5}})
    poses.frustum.push_back(poses.frustum_m * Eigen::Vector3d((u - cx) / fx, (v - cy) / fy, 1.0));
  poses.everything.insert(poses.everything.end(), poses.frustum.begin(), poses.frustum.end());
  return poses;
}

std::string outline_path(const View3& view, const Points& points) {
  std::vector<Place> places;
  for (const Eigen::Vector3d& point : points) places.push_back(view.at(point));
  std::string d;
  append_polyline(d, places, true);
  return d;
}

// An affine map (x, y) → origin + x·a + y·b on the paper.
std::string matrix(Place origin, Place a, Place b) {
  return fmt::format("matrix({:.5f} {:.5f} {:.5f} {:.5f} {:.2f} {:.2f})", a.x, a.y, b.x, b.y, origin.x, origin.y);
}

Place difference(Place a, Place b, double divisor) { return {(a.x - b.x) / divisor, (a.y - b.y) / divisor}; }

void draw_frustum(Svg& svg, const View3& view, const PoseScene& poses, bool with_picture) {
  if (poses.frustum.empty()) return;
  const CalibrateScene& scene = poses.scene;
  if (with_picture && !scene.photos[scene.chosen].corners.empty()) {
    const PicturePanel panel = scene.panel(photo_width);
    const Place top_left = view.at(poses.frustum[0]);
    const Place along = difference(view.at(poses.frustum[1]), top_left, panel.width());
    const Place down = difference(view.at(poses.frustum[3]), top_left, panel.height());
    const Place origin{top_left.x - along.x * panel.left, top_left.y - along.y * panel.left};
    svg.raw(fmt::format("<g transform=\"{}\"><use data-part=\"picture\" href=\"#picture-{}\"/></g>",
                        matrix(origin, along, down), scene.chosen));
  }
  std::string d = outline_path(view, poses.frustum);
  for (const Eigen::Vector3d& corner : poses.frustum)
    append_polyline(d, {view.at(Eigen::Vector3d::Zero()), view.at(corner)}, false);
  svg.path(d, "frustum");
}

void draw_axes(Svg& svg, const View3& view, double length_m) {
  const Place origin = view.at(Eigen::Vector3d::Zero());
  const std::array<std::pair<Eigen::Vector3d, const char*>, 3> axes{
      {{Eigen::Vector3d::UnitX(), "x"}, {Eigen::Vector3d::UnitY(), "y"}, {Eigen::Vector3d::UnitZ(), "z"}}};
  for (const auto& [direction, name] : axes) {
    const Place tip = view.at(length_m * direction), beyond = view.at(1.22 * length_m * direction);
    if (std::hypot(tip.x - origin.x, tip.y - origin.y) < 2.0) continue;  // points at the eye
    svg.line(origin, tip, std::string("axis-") + name);
    svg.text({beyond.x, beyond.y + 4.0}, name, std::string("axis-name-") + name, "middle");
  }
}

// Chequers and the rays to the corners of a board; shown for the chosen photo.
std::string board_details(const View3& view, const PoseScene& poses, const Points& outline) {
  const CalibrateScene& scene = poses.scene;
  const Place origin = view.at(outline[0]);
  const Place along = difference(view.at(outline[1]), origin, scene.board_cols + 1.0);
  const Place down = difference(view.at(outline[3]), origin, scene.board_rows + 1.0);
  std::string rays;
  for (const Eigen::Vector3d& corner : outline)
    append_polyline(rays, {view.at(Eigen::Vector3d::Zero()), view.at(corner)}, false);
  return fmt::format(
      "<g class=\"when-chosen\"><path class=\"rays\" d=\"{}\"/><use href=\"#chequers\" transform=\"{}\"/></g>", rays,
      matrix(origin, along, down));
}

void draw_boards(Svg& svg, const View3& view, const PoseScene& poses, bool with_details) {
  std::vector<std::size_t> order = poses.posed;
  const auto depth = [&](std::size_t i) { return view.depth(poses.scene.photos[i].cam_from_board.translation); };
  std::sort(order.begin(), order.end(), [&](std::size_t a, std::size_t b) { return depth(a) > depth(b); });
  const auto chosen = std::find(order.begin(), order.end(), poses.scene.chosen);
  if (chosen != order.end()) std::rotate(chosen, chosen + 1, order.end());  // on top
  for (const std::size_t index : order) {
    const PhotoMark& photo = poses.scene.photos[index];
    const Points outline = board_outline(poses.scene, photo.cam_from_board);
    svg.raw(fmt::format("<g class=\"board pick{}\" data-photo=\"{}\"><title>{}</title>",
                        index == poses.scene.chosen ? " chosen" : "", index,
                        escaped(photo.name + ": " + number_text(photo.rms_px, 3) + " px")));
    if (with_details && poses.scene.photos.size() <= 200) svg.raw(board_details(view, poses, outline));
    svg.path(outline_path(view, outline), "sheet", fmt::format("fill=\"{}\"", rms_colour(photo.rms_px)));
    svg.raw("</g>");
  }
}

// A table top below everything, so that the eye finds the ground.
void draw_ground(Svg& svg, const View3& view, const Points& everything, double step_m) {
  Eigen::Vector3d low = Eigen::Vector3d::Zero(), high = Eigen::Vector3d::Zero();
  for (const Eigen::Vector3d& point : everything) {
    low = low.cwiseMin(point);
    high = high.cwiseMax(point);
  }
  const double y = high.y() + 0.08 * (high.y() - low.y());
  const auto first = [step_m](double value) { return std::floor(value / step_m) * step_m; };
  const auto last = [step_m](double value) { return std::ceil(value / step_m) * step_m; };
  std::string d;
  for (double x = first(low.x()); x <= last(high.x()) + 0.01 * step_m; x += step_m)
    append_polyline(d, {view.at({x, y, first(low.z())}), view.at({x, y, last(high.z())})}, false);
  for (double z = first(low.z()); z <= last(high.z()) + 0.01 * step_m; z += step_m)
    append_polyline(d, {view.at({first(low.x()), y, z}), view.at({last(high.x()), y, z})}, false);
  svg.path(d, "gridline");
}

std::string chequers(const CalibrateScene& scene) {
  std::string d;
  for (int row = 0; row <= scene.board_rows; ++row)
    for (int col = (row % 2); col <= scene.board_cols; col += 2) d += fmt::format("M{} {}h1v1h-1z", col, row);
  return "<defs><path id=\"chequers\" class=\"chequers\" d=\"" + d + "\"/></defs>";
}

void draw_rms_bar(Svg& svg, double left, double right, double top) {
  constexpr int pieces = 48;
  const double width = (right - left) / pieces;
  for (int i = 0; i < pieces; ++i)
    svg.rect({left + width * i, top}, width + 0.4, 8.0, "",
             fmt::format("fill=\"{}\"", hex(cividis((i + 0.5) / pieces))));
  const Scale x{rms_low_px, rms_high_px, left, right, true};
  for (const double tick : {0.05, 0.2, 0.5, 1.0, 2.0, 5.0})
    svg.text({x(tick), top + 22.0}, number_text(tick, 2), "tick", "middle");
  svg.text({left - 8.0, top + 9.0}, "RMS, px", "tick", "end");
}

void draw_side_view(Svg& svg, View3 view, const PoseScene& poses, Place corner, double width, double height,
                    const char* name) {
  svg.rect(corner, width, height, "panel");
  view.fit(poses.everything, {corner.x + 14.0, corner.y + 24.0}, width - 28.0, height - 38.0);
  draw_frustum(svg, view, poses, false);
  draw_boards(svg, view, poses, false);
  draw_axes(svg, view, 26.0 / view.scale);
  svg.text({corner.x + 8.0, corner.y + 16.0}, name, "small");
}

}  // namespace

MaybeFigure figure_poses(const CalibrateScene& scene, const Pictures&) {
  const bool is_known = scene.square_m > 0.0 && scene.board_cols > 0 && scene.board_rows > 0;
  const PoseScene poses = pose_scene(scene);
  if (!is_known || poses.posed.empty()) return std::nullopt;
  constexpr double width = 700.0, height = 520.0, main_width = 500.0;
  View3 view = View3::three_quarter();
  Points fitted = poses.everything;
  view.fit(fitted, {16.0, 16.0}, main_width - 32.0, height - 96.0);
  const double bar_m = round_down_125(110.0 / view.scale);
  Svg svg(width, height, fmt::format("{} board poses in front of the camera, in three views", poses.posed.size()));
  svg.raw(chequers(scene));
  draw_ground(svg, view, poses.everything, bar_m);
  draw_boards(svg, view, poses, true);
  draw_frustum(svg, view, poses, true);
  draw_axes(svg, view, 42.0 / view.scale);
  draw_scale_bar(svg, {16.0, height - 14.0}, bar_m * view.scale, number_text(bar_m, 2) + " m", false);
  draw_rms_bar(svg, 270.0, main_width - 20.0, height - 28.0);
  const double side = 0.5 * (height - 12.0);
  draw_side_view(svg, View3::from_above(), poses, {main_width + 8.0, 0.0}, width - main_width - 8.0, side,
                 "from above");
  draw_side_view(svg, View3::from_side(), poses, {main_width + 8.0, side + 12.0}, width - main_width - 8.0, side,
                 "from the side");
  Figure figure{.id = "poses",
                .title = "Where was the board?",
                .note = "camera frame, m · click a board",
                .body = svg.str(),
                .span = 12};
  figure.good = "Good: boards tilted all ways, near and far, out to the picture's corners.";
  figure.marks = poses.posed.size();
  return figure;
}

}  // namespace alidade::report
