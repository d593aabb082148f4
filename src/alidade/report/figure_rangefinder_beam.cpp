#include <fmt/format.h>

#include <Eigen/Geometry>
#include <algorithm>
#include <array>
#include <cmath>

#include "alidade/beam/unit_direction.h"
#include "alidade/report/ellipse.h"
#include "alidade/report/figures.h"
#include "alidade/report/markup.h"
#include "alidade/report/picture_map.h"
#include "alidade/report/scale.h"
#include "alidade/report/view3.h"

namespace alidade::report {
namespace {

using Points = std::vector<Eigen::Vector3d>;

constexpr std::size_t most_shots = 400;  // beyond that only used ones, evenly chosen

struct BeamScene {
  const RangefinderScene& scene;
  std::vector<std::size_t> shown;  // shots with something to draw
  Points frustum;                  // four corners of the picture
  double longest_m = 0.0;          // how far the beam is drawn
  Points everything;
};

/// Corners of the board's paper, one square beyond the outermost; else a patch of the plane around the hit.
Points outline_of(const RangefinderScene& scene, const ShotMark& shot, double patch_m) {
  Points outline;
  if (shot.has_pose && scene.has_board()) {
    const double a = -scene.square_m, x = scene.board_cols * scene.square_m, y = scene.board_rows * scene.square_m;
    for (const Eigen::Vector3d& corner : {Eigen::Vector3d(a, a, 0.0), Eigen::Vector3d(x, a, 0.0),
                                          Eigen::Vector3d(x, y, 0.0), Eigen::Vector3d(a, y, 0.0)})
      outline.push_back(shot.cam_from_board * corner);
    return outline;
  }
  if (!shot.has_plane) return outline;
  // Without a hit, the plane's point that is nearest to the camera's axis.
  const double depth = -shot.d_m / shot.normal_in_cam.z();
  const Eigen::Vector3d near = shot.hit_in_cam.allFinite() ? shot.hit_in_cam : Eigen::Vector3d(0.0, 0.0, depth);
  if (!near.allFinite() || near.norm() > 1e3) return outline;
  const double off = (shot.normal_in_cam.dot(near) + shot.d_m) / shot.normal_in_cam.squaredNorm();
  const Eigen::Vector3d middle = near - off * shot.normal_in_cam;
  const Eigen::Matrix<double, 3, 2> side = patch_m * tangent_basis(shot.normal_in_cam.normalized());
  for (const auto& [right, down] : {std::pair{-1, -1}, std::pair{1, -1}, std::pair{1, 1}, std::pair{-1, 1}})
    outline.push_back(middle + right * side.col(0) + down * side.col(1));
  return outline;
}

double patch_of(const RangefinderScene& scene) {
  const double longest = scene.longest_m();
  return longest > 0.0 ? 0.04 * longest : 0.1;
}

/// As a hand's width beside the nearest boards.
void add_frustum(BeamScene& beams, const std::vector<double>& distances) {
  const RangefinderScene& scene = beams.scene;
  if (!scene.camera) return;
  const double near = quantile(distances, 0.0), half = quantile(distances, 0.5);
  const double depth_m = distances.empty() ? 0.3 : std::max(0.1 * half, std::min(0.3 * half, 0.8 * near));
  const double width = scene.camera->width_px, height = scene.camera->height_px;
  for (const auto& [u, v] : {std::pair{-0.5, -0.5}, std::pair{width - 0.5, -0.5}, std::pair{width - 0.5, height - 0.5},
                             std::pair{-0.5, height - 0.5}}) {
    // Straight through the principal point: a lens may see corners that it cannot unproject.
    const double fx = scene.document.estimated("camera.fx"), fy = scene.document.estimated("camera.fy"),
                 cx = scene.document.estimated("camera.cx"), cy = scene.document.estimated("camera.cy");
    const Eigen::Vector3d corner = depth_m * Eigen::Vector3d((u - cx) / fx, (v - cy) / fy, 1.0);
    if (!corner.allFinite()) return beams.frustum.clear();
    beams.frustum.push_back(corner);
  }
  beams.everything.insert(beams.everything.end(), beams.frustum.begin(), beams.frustum.end());
}

BeamScene beam_scene(const RangefinderScene& scene) {
  BeamScene beams{.scene = scene, .shown = {}, .frustum = {}, .everything = {Eigen::Vector3d::Zero()}};
  const std::size_t every = scene.shots.size() / most_shots + 1;
  std::vector<double> distances;
  for (std::size_t i = 0; i < scene.shots.size(); ++i) {
    const ShotMark& shot = scene.shots[i];
    const Points outline = outline_of(scene, shot, patch_of(scene));
    if ((outline.empty() && !shot.hit_in_cam.allFinite()) || (shot.is_used && i % every != 0)) continue;
    beams.shown.push_back(i);
    // What is not used may lie anywhere; it must not shrink the rest.
    if (!shot.is_used && scene.longest_m() > 0.0) continue;
    beams.everything.insert(beams.everything.end(), outline.begin(), outline.end());
    if (shot.hit_in_cam.allFinite()) beams.everything.push_back(shot.hit_in_cam);
    distances.push_back(shot.hit_in_cam.allFinite() ? shot.hit_in_cam.norm() : outline[0].norm());
  }
  add_frustum(beams, distances);
  beams.longest_m = scene.longest_m() > 0.0 ? 1.04 * scene.longest_m() : 4.0;
  if (scene.beam) {
    beams.everything.push_back(scene.beam->origin_in_cam);
    beams.everything.push_back(scene.beam->at(beams.longest_m));
  }
  return beams;
}

Eigen::Matrix<double, 2, 3> paper_from_cam(const View3& view) {
  Eigen::Matrix<double, 2, 3> onto_paper;
  onto_paper << view.scale * view.right_in_cam.transpose(), view.scale * view.down_in_cam.transpose();
  return onto_paper;
}

Eigen::Matrix2d on_paper(const View3& view, const Eigen::Matrix3d& cov) {
  const Eigen::Matrix<double, 2, 3> onto_paper = paper_from_cam(view);
  return onto_paper * cov * onto_paper.transpose();
}

/// σ across the beam as seen on the paper, and which way is across.
struct Across {
  Eigen::Vector2d side = Eigen::Vector2d::Zero();  ///< Zero where the beam points at the eye.
  std::vector<double> ranges_m, sigmas;
};

Across across_of(const View3& view, const BeamMark& beam, double longest_m) {
  constexpr int steps = 24;
  Across across;
  const Eigen::Vector2d along = paper_from_cam(view) * beam.direction_in_cam;
  if (!(along.norm() > 0.05 * view.scale)) return across;
  across.side = Eigen::Vector2d(-along.y(), along.x()).normalized();
  for (int i = 0; i <= steps; ++i) {
    across.ranges_m.push_back(longest_m * i / steps);
    const Eigen::Matrix2d cov = on_paper(view, beam.cov_at(across.ranges_m.back()));
    across.sigmas.push_back(std::sqrt(std::max(0.0, across.side.dot(cov * across.side))));
  }
  return across;
}

/// A round factor that makes 3σ about so large on the paper; 1 where it is large by itself.
double magnification(double three_sigma, double wanted) {
  if (!(three_sigma > 1e-9)) return 1.0;
  return std::max(1.0, round_down_125(wanted / three_sigma));
}

double magnification_of(const View3& view, const BeamMark& beam, double longest_m) {
  double largest = larger_sigma(on_paper(view, beam.cov_origin()));
  for (const double sigma : across_of(view, beam, longest_m).sigmas) largest = std::max(largest, sigma);
  return magnification(3.0 * largest, 24.0);
}

void draw_cone(Svg& svg, const View3& view, const BeamMark& beam, double longest_m, double factor) {
  constexpr int rings = 4;
  const Across across = across_of(view, beam, longest_m);
  std::vector<Place> outline;
  for (const double sign : {1.0, -1.0})
    for (std::size_t k = 0; k < across.sigmas.size(); ++k) {
      const std::size_t i = sign > 0.0 ? k : across.sigmas.size() - 1 - k;
      const Place at = view.at(beam.at(across.ranges_m[i]));
      const Eigen::Vector2d off = sign * 3.0 * factor * across.sigmas[i] * across.side;
      if (off.allFinite() && off.norm() < 1e4) outline.push_back({at.x + off.x(), at.y + off.y()});
    }
  std::string cone, ellipses, origin;
  append_polyline(cone, outline, true);
  svg.path(cone, "beam-cone");
  const Eigen::Matrix3d off_beam =
      Eigen::Matrix3d::Identity() - beam.direction_in_cam * beam.direction_in_cam.transpose();
  for (int i = 1; i <= rings; ++i) {
    const double range_m = longest_m * i / rings;
    append_ellipse(ellipses, view.at(beam.at(range_m)), on_paper(view, off_beam * beam.cov_at(range_m) * off_beam),
                   3.0 * factor);
  }
  svg.path(ellipses, "beam-ring");
  append_ellipse(origin, view.at(beam.origin_in_cam), on_paper(view, beam.cov_origin()), 3.0 * factor);
  svg.path(origin, "origin-ellipsoid");
}

void draw_beam(Svg& svg, const View3& view, const BeamScene& beams, double factor) {
  if (!beams.scene.beam) return;
  const BeamMark& beam = *beams.scene.beam;
  if (beam.has_cov()) draw_cone(svg, view, beam, beams.longest_m, factor);
  svg.line(view.at(beam.origin_in_cam), view.at(beam.at(beams.longest_m)), "beam");
  svg.circle(view.at(beam.origin_in_cam), 3.4, "beam-origin");
}

void draw_camera(Svg& svg, const View3& view, const BeamScene& beams, double axes_paper) {
  std::string d;
  std::vector<Place> outline;
  for (const Eigen::Vector3d& corner : beams.frustum) {
    outline.push_back(view.at(corner));
    append_polyline(d, {view.at(Eigen::Vector3d::Zero()), view.at(corner)}, false);
  }
  append_polyline(d, outline, true);
  svg.path(d, "frustum");
  const Place origin = view.at(Eigen::Vector3d::Zero());
  const std::array<std::pair<Eigen::Vector3d, const char*>, 3> axes{
      {{Eigen::Vector3d::UnitX(), "x"}, {Eigen::Vector3d::UnitY(), "y"}, {Eigen::Vector3d::UnitZ(), "z"}}};
  for (const auto& [direction, name] : axes) {
    const double length_m = axes_paper / view.scale;
    const Place tip = view.at(length_m * direction), beyond = view.at(1.25 * length_m * direction);
    if (std::hypot(tip.x - origin.x, tip.y - origin.y) < 2.0) continue;  // points at the eye
    svg.line(origin, tip, std::string("axis-") + name);
    svg.text({beyond.x, beyond.y + 4.0}, name, std::string("axis-name-") + name, "middle");
  }
}

std::string title_of(const ShotMark& shot) {
  std::string words = shot.name + ": " + number_text(shot.range_m, 4) + " m";
  if (!shot.is_used) words += ", not used" + (shot.reason.empty() ? "" : ": " + shot.reason);
  return "<title>" + escaped(words) + "</title>";
}

void draw_shots(Svg& svg, const View3& view, const BeamScene& beams) {
  const RangefinderScene& scene = beams.scene;
  std::vector<std::size_t> order = beams.shown;
  const auto depth = [&](std::size_t i) {
    const ShotMark& shot = scene.shots[i];
    return shot.hit_in_cam.allFinite() ? view.depth(shot.hit_in_cam) : 0.0;
  };
  std::ranges::stable_sort(order, [&](std::size_t a, std::size_t b) { return depth(a) > depth(b); });
  for (const std::size_t index : order) {
    const ShotMark& shot = scene.shots[index];
    svg.raw(fmt::format("<g class=\"board pick{}\" data-photo=\"{}\">{}", index == scene.chosen ? " chosen" : "", index,
                        title_of(shot)));
    std::vector<Place> outline;
    for (const Eigen::Vector3d& corner : outline_of(scene, shot, patch_of(scene))) outline.push_back(view.at(corner));
    std::string d;
    append_polyline(d, outline, true);
    svg.path(d, shot.is_used ? "plane" : "plane-unused");
    if (shot.hit_in_cam.allFinite()) svg.circle(view.at(shot.hit_in_cam), 3.2, shot.is_used ? "hit" : "hit-unused");
    svg.raw("</g>");
  }
}

void begin_clip(Svg& svg, const std::string& id, Place corner, double width, double height) {
  svg.raw(fmt::format("<clipPath id=\"{}\">", id));
  svg.rect(corner, width, height, "");
  svg.raw(fmt::format("</clipPath><g clip-path=\"url(#{})\">", id));
}

struct Panel {
  std::string id, name;
  Place corner;
  double width, height;
};

void fit(View3& view, const BeamScene& beams, const Panel& panel) {
  view.fit(beams.everything, {panel.corner.x + 20.0, panel.corner.y + 28.0}, panel.width - 40.0, panel.height - 66.0);
}

/// One view of everything with its scale bar.
void draw_view(Svg& svg, View3 view, const BeamScene& beams, const Panel& panel, double factor, bool has_ground) {
  svg.rect(panel.corner, panel.width, panel.height, "panel");
  begin_clip(svg, panel.id, panel.corner, panel.width, panel.height);
  fit(view, beams, panel);
  if (has_ground) {
    std::string d;
    double low = 0.0, depth = 0.0;
    for (const Eigen::Vector3d& point : beams.everything) {
      low = std::max(low, point.y());
      depth = std::max(depth, point.z());
    }
    const double step = round_down_125(0.25 * depth);
    for (double z = 0.0; z <= depth; z += step)
      append_polyline(d, {view.at({-step, low, z}), view.at({step, low, z})}, false);
    for (const double x : {-step, 0.0, step})
      append_polyline(d, {view.at({x, low, 0.0}), view.at({x, low, depth})}, false);
    svg.path(d, "gridline");
  }
  draw_shots(svg, view, beams);
  draw_camera(svg, view, beams, has_ground ? 36.0 : 24.0);
  draw_beam(svg, view, beams, factor);
  svg.raw("</g>");
  const double bar_m = round_down_125(0.2 * panel.width / view.scale);
  draw_scale_bar(svg, {panel.corner.x + 14.0, panel.corner.y + panel.height - 14.0}, bar_m * view.scale,
                 number_text(bar_m, 2) + " m", false);
  svg.text({panel.corner.x + 8.0, panel.corner.y + 17.0}, panel.name, "small");
}

/// The camera's centre and the beam's origin from near: in a view of metres they are one dot.
void draw_near(Svg& svg, const BeamScene& beams, const Panel& panel) {
  const BeamMark& beam = *beams.scene.beam;
  View3 view = View3::three_quarter();
  const double size_m = std::max(1e-3, beam.origin_in_cam.norm());
  view.fit({Eigen::Vector3d::Zero(), beam.origin_in_cam, beam.origin_in_cam + 0.9 * size_m * beam.direction_in_cam,
            0.5 * size_m * Eigen::Vector3d::UnitZ()},
           {panel.corner.x + 40.0, panel.corner.y + 44.0}, panel.width - 80.0, panel.height - 122.0);
  const double factor =
      beam.has_cov() ? magnification(3.0 * larger_sigma(on_paper(view, beam.cov_origin())), 36.0) : 1.0;
  svg.rect(panel.corner, panel.width, panel.height, "panel");
  begin_clip(svg, panel.id, panel.corner, panel.width, panel.height);
  draw_camera(svg, view, BeamScene{.scene = beams.scene, .shown = {}, .frustum = {}, .everything = {}}, 30.0);
  svg.line(view.at(Eigen::Vector3d::Zero()), view.at(beam.origin_in_cam), "dashed");
  if (beam.has_cov()) draw_cone(svg, view, beam, 6.0 * size_m, factor);
  svg.line(view.at(beam.origin_in_cam), view.at(beam.at(20.0 * size_m)), "beam");
  svg.circle(view.at(beam.origin_in_cam), 3.8, "beam-origin");
  svg.raw("</g>");
  svg.text({panel.corner.x + 8.0, panel.corner.y + 17.0},
           fmt::format("at the camera: {} mm from its centre{}", number_text(1e3 * beam.origin_in_cam.norm(), 3),
                       beam.has_cov() ? fmt::format("; 3σ ×{:.0f}", factor) : ""),
           "small");
  const double bar_m = round_down_125(0.2 * panel.width / view.scale);
  draw_scale_bar(svg, {panel.corner.x + 14.0, panel.corner.y + panel.height - 14.0}, bar_m * view.scale,
                 number_text(1e3 * bar_m, 2) + " mm", false);
}

std::string sample(const char* shape, const char* css_class, const std::string& words) {
  return fmt::format(
      "<span><svg class=\"sample\" viewBox=\"0 0 26 12\" aria-hidden=\"true\"><path d=\"{}\" class=\"{}\"/></svg>{}"
      "</span>",
      shape, css_class, escaped(words));
}

std::string legend(const BeamScene& beams) {
  std::string out = "<p class=\"legend\">";
  const auto any = [&](bool is_used) {
    return std::ranges::any_of(beams.shown, [&](std::size_t i) { return beams.scene.shots[i].is_used == is_used; });
  };
  if (beams.scene.beam) {
    out += sample("M1 6L25 6", "beam", "beam");
    if (beams.scene.beam->has_cov())
      out += sample("M1 1L25 1L25 11L1 11Z", "beam-cone", "its 3σ and the origin's, magnified as stated");
  }
  if (any(true)) out += sample("M4 1L22 1L22 11L4 11Z", "plane", "board and hit, used");
  if (any(false)) out += sample("M4 1L22 1L22 11L4 11Z", "plane-unused", "not used");
  return out + "</p>";
}

std::string conclusion(const BeamScene& beams) {
  const std::size_t used = static_cast<std::size_t>(
      std::ranges::count_if(beams.shown, [&](std::size_t i) { return beams.scene.shots[i].is_used; }));
  const std::string shots = fmt::format("{} shots of which {} used", beams.shown.size(), used);
  if (!beams.scene.beam) return "No beam could be told; the boards of " + shots + ", in three views";
  const Eigen::Vector3d mm = 1e3 * beams.scene.beam->origin_in_cam;
  return fmt::format("The beam starts at {}, {}, {} mm from the camera's centre; {}, in three views",
                     number_text(mm.x(), 3), number_text(mm.y(), 3), number_text(mm.z(), 3), shots);
}

/// Panels side by side; on narrow pages and on paper one below the other.
std::string drawing(const BeamScene& beams, bool is_narrow) {
  constexpr double gap = 10.0, main_width = 600.0, side_width = 450.0;
  const std::string suffix = is_narrow ? "-narrow" : "";
  const int num_sides = beams.scene.beam ? 3 : 2;
  const double main_height = is_narrow ? 440.0 : 660.0;
  const double left = is_narrow ? 0.0 : main_width + gap, first = is_narrow ? main_height + gap : 0.0;
  const double width = is_narrow ? main_width : side_width,
               height = is_narrow ? 190.0 : (main_height - (num_sides - 1) * gap) / num_sides;
  const auto side_panel = [&](const char* id, const char* name, int place) {
    return Panel{id + suffix, name, {left, first + place * (height + gap)}, width, height};
  };
  View3 view = View3::three_quarter();
  Panel main_panel{"clip-beam" + suffix, "", {0.0, 0.0}, main_width, main_height};
  fit(view, beams, main_panel);
  const bool has_cov = beams.scene.beam && beams.scene.beam->has_cov();
  const double factor = has_cov ? magnification_of(view, *beams.scene.beam, beams.longest_m) : 1.0;
  Svg svg(left + (is_narrow ? main_width : side_width),
          is_narrow ? first + num_sides * (height + gap) - gap : main_height, conclusion(beams),
          is_narrow ? "narrow" : "wide");
  if (has_cov)
    main_panel.name =
        factor > 1.0 ? fmt::format("3σ of beam and origin ×{:.0f}", factor) : "3σ of beam and origin, true to scale";
  draw_view(svg, view, beams, main_panel, factor, true);
  draw_view(svg, View3::from_above(), beams, side_panel("clip-above", "from above", 0), factor, false);
  draw_view(svg, View3::from_side(), beams, side_panel("clip-side", "from the side", 1), factor, false);
  if (beams.scene.beam) draw_near(svg, beams, side_panel("clip-near", "", 2));
  return svg.str();
}

}  // namespace

MaybeFigure figure_rangefinder_beam(const RangefinderScene& scene) {
  const BeamScene beams = beam_scene(scene);
  if (beams.shown.empty() && !scene.beam) return std::nullopt;
  Figure figure{.id = "beam", .title = "Where is the beam?", .note = "camera frame, m · click a shot", .span = 18};
  figure.body = legend(beams) + drawing(beams, false) + drawing(beams, true);
  figure.good =
      scene.document.is_answer()
          ? "Good: hits from near to far, boards tilted to all sides; a thin cone and a small ellipsoid."
          : "No answer: what the shots leave open shows as a long ellipsoid, or as boards that are all alike.";
  figure.marks = beams.shown.size();
  return figure;
}

}  // namespace alidade::report
