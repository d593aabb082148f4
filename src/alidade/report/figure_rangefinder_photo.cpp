#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <cmath>

#include "alidade/report/ellipse.h"
#include "alidade/report/figures.h"
#include "alidade/report/markup.h"
#include "alidade/report/picture_map.h"
#include "alidade/report/scale.h"

namespace alidade::report {
namespace {

constexpr std::size_t most_shots = 300;  // those beyond cannot be chosen
constexpr double inset_share = 0.3;      // of the picture's width

/// Where the beam's points are seen, from near to far.
struct BeamLine {
  std::vector<Eigen::Vector2d> px;
  std::vector<std::pair<double, Eigen::Vector2d>> marks;  ///< Round ranges.
};

bool is_near(const Camera& camera, const Eigen::Vector2d& px) {
  return px.allFinite() && std::abs(px.x()) < 3.0 * camera.width_px && std::abs(px.y()) < 3.0 * camera.height_px;
}

BeamLine beam_line(const RangefinderScene& scene) {
  constexpr int steps = 160;
  constexpr double first_m = 0.1, last_m = 100.0;
  BeamLine line;
  if (!scene.beam || !scene.camera) return line;
  const auto seen = [&](double range_m) { return project(*scene.camera, scene.beam->at(range_m)); };
  for (int i = 0; i <= steps; ++i)
    if (const auto px = seen(first_m * std::pow(last_m / first_m, static_cast<double>(i) / steps));
        px && is_near(*scene.camera, *px))
      line.px.push_back(*px);
  for (const double range_m : {0.5, 1.0, 2.0, 4.0})
    if (const auto px = seen(range_m); px && is_near(*scene.camera, *px)) line.marks.emplace_back(range_m, *px);
  return line;
}

PicturePanel panel_of(const RangefinderScene& scene) {
  return PicturePanel::fitting(scene.camera->width_px, scene.camera->height_px, photo_width, photo_width);
}

Place at(const PicturePanel& panel, const Eigen::Vector2d& px) { return panel.at(px.x(), px.y()); }

bool has_picture(const ShotMark& shot, const Pictures& pictures) { return pictures.contains(shot.name); }

std::vector<std::size_t> shown_shots(const RangefinderScene& scene, const Pictures& pictures) {
  std::vector<std::size_t> shown;
  if (!scene.camera) return shown;
  for (const std::size_t index : scene.worst_first)
    if ((scene.shots[index].has_spot() || has_picture(scene.shots[index], pictures)) && shown.size() < most_shots)
      shown.push_back(index);
  return shown;
}

std::string caption(const ShotMark& shot) {
  std::string words = shot.name + " · " + number_text(shot.range_m, 4) + " m";
  if (shot.has_spot_residual())
    words += fmt::format(" · spot predicted {} px from where it was seen", number_text(shot.residual_px.norm(), 2));
  if (!shot.is_used) words += " · not used" + (shot.reason.empty() ? "" : ": " + shot.reason);
  return words;
}

std::string label(const ShotMark& shot) { return "The spot and the beam's line in " + caption(shot); }

void append_cross(std::string& d, Place centre, double inner, double outer) {
  for (const auto& [x, y] : {std::pair{1.0, 0.0}, std::pair{-1.0, 0.0}, std::pair{0.0, 1.0}, std::pair{0.0, -1.0}})
    append_polyline(d, {{centre.x + inner * x, centre.y + inner * y}, {centre.x + outer * x, centre.y + outer * y}},
                    false);
}

/// Seen spot as a cross, predicted as a ring with the 3σ of their difference.
std::string spot_marks(const ShotMark& shot, Place seen, double scale, double size) {
  std::string cross, ring;
  append_cross(cross, seen, 0.35 * size, size);
  std::string out = fmt::format("<path class=\"spot-halo\" d=\"{0}\"/><path class=\"spot-seen\" d=\"{0}\"/>", cross);
  if (!shot.has_spot_residual()) return out;
  const Place predicted{seen.x + scale * shot.residual_px.x(), seen.y + scale * shot.residual_px.y()};
  append_ellipse(ring, predicted, 0.25 * size * size * Eigen::Matrix2d::Identity() / 9.0, 3.0);
  out += fmt::format("<path class=\"spot-halo\" d=\"{0}\"/><path class=\"spot-predicted\" d=\"{0}\"/>", ring);
  return out;
}

/// Half of the inset's width in pixels of the photo.
double inset_reach(const ShotMark& shot) {
  double reach = 1.0;
  if (shot.has_spot_residual())
    reach = std::max({reach, 2.0 * shot.residual_px.norm(), 4.5 * std::sqrt(std::max(0.0, shot.cov_px.trace()))});
  return std::isfinite(reach) ? std::min(round_up_125(reach), 500.0) : 5.0;
}

std::string line_path(const PicturePanel& panel, const BeamLine& line) {
  std::vector<Place> places;
  for (const Eigen::Vector2d& px : line.px) places.push_back(at(panel, px));
  std::string d;
  append_polyline(d, places, false);
  return d;
}

/// The stretch of the line that passes a pixel, magnified about it: the line of the whole picture is too coarse here.
std::string near_line(const BeamLine& line, const Eigen::Vector2d& px, Place middle, double scale) {
  const auto nearest = std::ranges::min_element(
      line.px, [&](const auto& a, const auto& b) { return (a - px).squaredNorm() < (b - px).squaredNorm(); });
  const std::ptrdiff_t at = nearest - line.px.begin(), last = std::ssize(line.px) - 1;
  std::vector<Place> places;
  for (std::ptrdiff_t i = std::max<std::ptrdiff_t>(0, at - 4); i <= std::min(last, at + 4); ++i) {
    const Eigen::Vector2d off = scale * (line.px[static_cast<std::size_t>(i)] - px);
    places.push_back({middle.x + off.x(), middle.y + off.y()});
  }
  std::string d;
  append_polyline(d, places, false);
  return d.empty() ? d : "<path class=\"beam-line\" d=\"" + d + "\"/>";
}

/// Magnified neighbourhood of the spot in the corner that is farthest from it.
std::string inset(const RangefinderScene& scene, const BeamLine& line, std::size_t index, const PicturePanel& panel) {
  const ShotMark& shot = scene.shots[index];
  const Place seen = at(panel, shot.seen_px);
  const double size = inset_share * panel.width(), reach = inset_reach(shot), zoom = 0.5 * size / (reach * panel.scale);
  const double x =
      seen.x < panel.left + 0.5 * panel.width() ? panel.left + panel.width() - size - 6.0 : panel.left + 6.0;
  const double y = seen.y < 0.5 * panel.height() ? panel.height() - size - 6.0 : 6.0;
  const Place middle{0.5 * size, 0.5 * size};
  std::string out = fmt::format("<svg x=\"{0:.1f}\" y=\"{1:.1f}\" width=\"{2:.1f}\" height=\"{2:.1f}\">", x, y, size);
  out += fmt::format("<rect width=\"{0:.1f}\" height=\"{0:.1f}\" class=\"inset\"/>", size);
  const std::string onto = fmt::format("transform=\"translate({:.2f} {:.2f}) scale({:.3f})\"", middle.x - zoom * seen.x,
                                       middle.y - zoom * seen.y, zoom);
  out += fmt::format("<use href=\"#picture-{}\" {}/>", index, onto);
  out += near_line(line, shot.seen_px, middle, zoom * panel.scale);
  if (shot.has_spot_residual()) {
    const double scale = zoom * panel.scale;
    std::string d;
    append_ellipse(d, {middle.x + scale * shot.residual_px.x(), middle.y + scale * shot.residual_px.y()},
                   scale * scale * shot.cov_px, 3.0);
    if (!d.empty()) out += "<path class=\"ellipse\" d=\"" + d + "\"/>";
  }
  out += spot_marks(shot, middle, zoom * panel.scale, 11.0);
  for (const char* look : {"inset-halo", "inset-frame"})
    out += fmt::format("<rect width=\"{0:.1f}\" height=\"{0:.1f}\" class=\"{1}\"/>", size, look);
  const std::string words = number_text(2.0 * reach, 3) + " px across";
  out += fmt::format(
      "<rect x=\"4\" y=\"4\" width=\"{:.0f}\" height=\"18\" rx=\"3\" class=\"badge\"/><text x=\"9\" y=\"17\" "
      "class=\"badge-text\">{}</text>",
      text_width(words, 12.0) + 8.0, words);
  return out + "</svg>";
}

std::string marks_of(const RangefinderScene& scene, const BeamLine& line, std::size_t index,
                     const PicturePanel& panel) {
  const ShotMark& shot = scene.shots[index];
  std::string out = fmt::format("<g id=\"marks-{}\">", index);
  const bool is_inside = scene.camera && is_near(*scene.camera, shot.seen_px);
  if (is_inside) out += spot_marks(shot, at(panel, shot.seen_px), panel.scale, 13.0) + inset(scene, line, index, panel);
  return out + "</g>";
}

std::string picture_of(const RangefinderScene& scene, std::size_t index, const Pictures& pictures,
                       const PicturePanel& panel) {
  const std::string box =
      attribute("x", panel.left) + attribute("width", panel.width()) + attribute("height", panel.height());
  const auto found = pictures.find(scene.shots[index].name);
  std::string out = fmt::format("<g id=\"picture-{}\">", index);
  out += found == pictures.end() ? "<rect class=\"empty-picture\"" + box + "/>"
                                 : "<image" + box + " preserveAspectRatio=\"none\" href=\"data:image/jpeg;base64," +
                                       base64(found->second) + "\"/>";
  return out + "</g>";
}

/// The beam's line with its ranges and, faintly, all spots: the same under every photo.
std::string common_marks(const RangefinderScene& scene, const BeamLine& line, const PicturePanel& panel,
                         bool with_others) {
  std::string out = "<g id=\"beam-marks\">", dots;
  if (with_others)
    for (const ShotMark& shot : scene.shots)
      if (shot.is_used && is_near(*scene.camera, shot.seen_px)) append_dot(dots, at(panel, shot.seen_px));
  if (line.px.size() > 1)
    out += "<use href=\"#beam-line\" class=\"beam-line-halo\"/><use href=\"#beam-line\" class=\"beam-line\"/>";
  if (!dots.empty()) out += "<path class=\"spot-other\" d=\"" + dots + "\"/>";
  Place last{-1e9, -1e9};
  double side = -1.0;
  for (const auto& [range_m, px] : line.marks) {
    const Place place = at(panel, px);
    out += "<circle class=\"beam-mark\"" + attribute("cx", place.x) + attribute("cy", place.y) + " r=\"3.4\"/>";
    if (std::hypot(place.x - last.x, place.y - last.y) < 20.0) continue;
    last = place;
    side = -side;  // they come closer and closer: on both sides of the line by turns
    const std::string words = number_text(range_m, 2) + " m";
    const double width = text_width(words, 12.0) + 8.0, middle = place.x + side * (0.5 * width + 22.0);
    out += "<rect class=\"badge\" rx=\"3\" height=\"18\"" + attribute("x", middle - 0.5 * width) +
           attribute("y", place.y - 9.0) + attribute("width", width) +
           "/><text class=\"badge-text\" text-anchor=\"middle\"" + attribute("x", middle) +
           attribute("y", place.y + 4.0) + ">" + words + "</text>";
  }
  return out + "</g>";
}

std::string thumb_of(const RangefinderScene& scene, std::size_t index, bool has_pictures, double height) {
  const ShotMark& shot = scene.shots[index];
  const std::string words = escaped(caption(shot));
  const std::string picture = has_pictures
                                  ? fmt::format(
                                        "<svg viewBox=\"0 0 {0:.0f} {1:.0f}\" role=\"img\" aria-label=\"{3}\"><use "
                                        "href=\"#picture-{2}\"/><use href=\"#marks-{2}\"/></svg>",
                                        photo_width, height, index, words)
                                  : "";
  return fmt::format(
      "<figure class=\"thumb pick{}\" data-photo=\"{}\" data-caption=\"{}\" data-label=\"{}\">{}<figcaption>{}"
      "</figcaption></figure>",
      index == scene.chosen ? " chosen" : "", index, words, escaped(label(shot)), picture,
      has_pictures ? words : escaped(shot.name));
}

bool has_pictures(const RangefinderScene& scene, const Pictures& pictures) {
  return std::ranges::any_of(scene.shots, [&](const ShotMark& shot) { return has_picture(shot, pictures); });
}

}  // namespace

std::string shared_rangefinder_drawings(const RangefinderScene& scene, const Pictures& pictures) {
  const std::vector<std::size_t> shown = shown_shots(scene, pictures);
  if (shown.empty()) return "";
  const PicturePanel panel = panel_of(scene);
  const BeamLine line = beam_line(scene);
  std::string out =
      "<svg class=\"shared\" aria-hidden=\"true\"><defs><path id=\"beam-line\" d=\"" + line_path(panel, line) + "\"/>";
  out += common_marks(scene, line, panel, !has_pictures(scene, pictures));
  for (const std::size_t index : shown)
    out += picture_of(scene, index, pictures, panel) + marks_of(scene, line, index, panel);
  return out + "</defs></svg>";
}

MaybeFigure figure_rangefinder_photo(const RangefinderScene& scene, const Pictures& pictures) {
  const std::vector<std::size_t> shown = shown_shots(scene, pictures);
  if (shown.empty()) return std::nullopt;
  const std::size_t first = std::ranges::find(shown, scene.chosen) != shown.end() ? scene.chosen : shown.front();
  const ShotMark& shot = scene.shots[first];
  const PicturePanel panel = panel_of(scene);
  Figure figure{
      .id = "photo", .title = "Is the spot where the beam puts it?", .note = "px · ← → other shots", .span = 10};
  Svg svg(photo_width, panel.height(), label(shot), "stage");
  svg.raw(fmt::format("<clipPath id=\"clip-photo\"><rect{}{}{}/></clipPath><g clip-path=\"url(#clip-photo)\">",
                      attribute("x", panel.left), attribute("width", panel.width()),
                      attribute("height", panel.height())));
  svg.raw(
      fmt::format("<use data-part=\"picture\" href=\"#picture-{0}\"/><use href=\"#beam-marks\"/><use "
                  "data-part=\"marks\" href=\"#marks-{0}\"/></g>",
                  first));
  figure.body = "<p class=\"caption\" data-part=\"caption\">" + escaped(caption(shot)) + "</p>" + svg.str();
  figure.good =
      scene.beam ? "Good: the seen spot (cross) inside the yellow 3σ ellipse of the predicted one (ring), on the line."
                 : "No beam could be told: the spots as they were seen.";
  if (!has_pictures(scene, pictures)) figure.good += " Without photos: the camera's frame with all spots.";
  figure.marks = shown.size();
  return figure;
}

MaybeFigure figure_rangefinder_all_photos(const RangefinderScene& scene, const Pictures& pictures) {
  std::vector<std::size_t> shown = shown_shots(scene, pictures);
  if (shown.size() < 2) return std::nullopt;
  const bool with_pictures = has_pictures(scene, pictures);
  Figure figure{.id = "all-photos",
                .title = "Is it the same in every photo?",
                .note = "click to choose · worst first",
                .span = 24};
  std::string thumbs;
  for (const std::size_t index : shown) thumbs += thumb_of(scene, index, with_pictures, panel_of(scene).height());
  figure.body =
      fmt::format("<details class=\"{}\"{}><summary>{} shots</summary><div>{}</div></details>",
                  with_pictures ? "thumbs" : "chips", shown.size() <= 40 ? " open" : "", shown.size(), thumbs);
  if (!with_pictures) figure.title = "Which shots are there?";
  figure.marks = shown.size();
  return figure;
}

}  // namespace alidade::report
