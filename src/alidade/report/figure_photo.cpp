#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <numbers>

#include "alidade/report/colours.h"
#include "alidade/report/figures.h"
#include "alidade/report/markup.h"
#include "alidade/report/picture_map.h"
#include "alidade/report/scale.h"

namespace alidade::report {
namespace {

constexpr std::size_t most_ellipses = 5000;  // beyond that they would be most of the page
constexpr std::size_t most_coloured_photos = 60;

bool has_residual(const CornerMark& corner) {
  return std::isfinite(corner.residual_u_px) && std::isfinite(corner.residual_v_px);
}

// The same in all photos, so that they can be compared.
ArrowScale arrow_scale(const CalibrateScene& scene) {
  std::vector<double> sizes;
  for (const CornerMark& corner : scene.corners)
    if (corner.is_used) sizes.push_back(std::hypot(corner.residual_u_px, corner.residual_v_px));
  return ArrowScale::fitting(scene.panel(photo_width), quantile(sizes, 0.95), 36.0);
}

// The 3σ ellipse of where the corner was found, magnified like the arrows.
void append_ellipse(std::string& d, const CornerMark& corner, Place centre, double magnified) {
  const double a = corner.sigma_u_px * corner.sigma_u_px, b = corner.sigma_v_px * corner.sigma_v_px;
  const double c = corner.corr_uv * corner.sigma_u_px * corner.sigma_v_px;
  const double half = 0.5 * (a + b), spread = std::hypot(0.5 * (a - b), c);
  const double major = 3.0 * std::sqrt(half + spread) * magnified;
  const double minor = 3.0 * std::sqrt(std::max(0.0, half - spread)) * magnified;
  if (!(major > 0.5) || !(major < 1e4)) return;
  const double turn = 0.5 * std::atan2(2.0 * c, a - b), dx = major * std::cos(turn), dy = major * std::sin(turn);
  d += fmt::format("M{:.1f} {:.1f}a{:.1f} {:.1f} {:.0f} 1 0 {:.1f} {:.1f}a{:.1f} {:.1f} {:.0f} 1 0 {:.1f} {:.1f}",
                   centre.x - dx, centre.y - dy, major, minor, turn * 180.0 / std::numbers::pi, 2.0 * dx, 2.0 * dy,
                   major, minor, turn * 180.0 / std::numbers::pi, -2.0 * dx, -2.0 * dy);
}

struct PhotoPaths {
  std::string arrows, ellipses, rejected;
  std::array<std::string, num_directions> dots;
};

PhotoPaths photo_paths(const CalibrateScene& scene, const PhotoMark& photo, const ArrowScale& scale,
                       bool with_ellipses) {
  const PicturePanel panel = scene.panel(photo_width);
  PhotoPaths paths;
  for (const std::size_t index : photo.corners) {
    const CornerMark& corner = scene.corners[index];
    const Place at = panel.at(corner.u_px, corner.v_px);
    if (!corner.is_used || !has_residual(corner)) {
      append_polyline(paths.rejected, {{at.x - 4.0, at.y - 4.0}, {at.x + 4.0, at.y + 4.0}}, false);
      append_polyline(paths.rejected, {{at.x - 4.0, at.y + 4.0}, {at.x + 4.0, at.y - 4.0}}, false);
      continue;
    }
    const int direction = direction_class(corner.residual_u_px, corner.residual_v_px);
    append_dot(paths.dots[static_cast<std::size_t>(direction)], at);
    append_arrow(paths.arrows, at, scale.tip(panel, at, corner.residual_u_px, corner.residual_v_px), 5.0);
    if (with_ellipses) append_ellipse(paths.ellipses, corner, at, scale.magnification * panel.scale);
  }
  return paths;
}

// id="marks-7": what is drawn over photo 7.
std::string photo_marks(const CalibrateScene& scene, std::size_t index, const ArrowScale& scale) {
  const bool is_coloured = scene.photos.size() <= most_coloured_photos;
  const PhotoPaths paths = photo_paths(scene, scene.photos[index], scale, scene.corners.size() <= most_ellipses);
  std::string out = fmt::format("<g id=\"marks-{}\">", index);
  const auto path = [&out](const std::string& d, const std::string& look) {
    if (!d.empty()) out += fmt::format("<path class=\"{}\" d=\"{}\"/>", look, d);
  };
  path(paths.ellipses, "ellipse");
  if (!paths.arrows.empty())
    out += fmt::format(
        "<defs><path id=\"arrows-{0}\" d=\"{1}\"/></defs><use href=\"#arrows-{0}\" class=\"photo-arrow\"/>"
        "<use href=\"#arrows-{0}\" class=\"photo-arrow-top\"/>",
        index, paths.arrows);
  std::string all_dots;
  for (int direction = 0; direction < num_directions; ++direction) {
    const std::string& dots = paths.dots[static_cast<std::size_t>(direction)];
    if (is_coloured)
      path(dots, fmt::format("photo-dots d{}", direction));
    else
      all_dots += dots;
  }
  path(all_dots, "photo-dots d0");
  path(paths.rejected, "rejected");
  return out + "</g>";
}

std::string picture(const CalibrateScene& scene, std::size_t index, const Pictures& pictures) {
  const PicturePanel panel = scene.panel(photo_width);
  std::string out = fmt::format("<g id=\"picture-{}\">", index);
  const auto found = pictures.find(scene.photos[index].name);
  if (found != pictures.end())
    out += "<image" + attribute("x", panel.left) + attribute("width", panel.width()) +
           attribute("height", panel.height()) + " preserveAspectRatio=\"none\" href=\"data:image/jpeg;base64," +
           base64(found->second) + "\"/>";
  else
    out += "<rect class=\"no-picture\"" + attribute("x", panel.left) + attribute("width", panel.width()) +
           attribute("height", panel.height()) + "/>";
  return out + "</g>";
}

// Photos that have something to look at: used ones, worst first, then those where no board was found.
std::vector<std::size_t> shown_photos(const CalibrateScene& scene, const Pictures& pictures) {
  std::vector<std::size_t> shown;
  for (const std::size_t index : scene.worst_first)
    if (!scene.photos[index].corners.empty() || pictures.contains(scene.photos[index].name)) shown.push_back(index);
  for (const std::size_t index : scene.unused)
    if (!scene.photos[index].corners.empty() || pictures.contains(scene.photos[index].name)) shown.push_back(index);
  return shown;
}

std::string caption(const PhotoMark& photo) {
  if (photo.is_used && std::isfinite(photo.rms_px)) return photo.name + " · " + rounded_text(photo.rms_px, 3) + " px";
  return photo.name + " · " + (photo.reason.empty() ? "not used" : "not used: " + photo.reason);
}

std::string thumbnail(const CalibrateScene& scene, std::size_t index, double height) {
  return fmt::format(
      "<figure class=\"thumb pick{4}\" data-photo=\"{0}\" data-caption=\"{3}\"><svg viewBox=\"0 0 {1:.0f} {2:.0f}\" "
      "role=\"img\" "
      "aria-label=\"{3}\"><use href=\"#picture-{0}\"/><use "
      "href=\"#marks-{0}\"/></svg><figcaption>{3}</figcaption></figure>",
      index, photo_width, height, escaped(caption(scene.photos[index])), index == scene.chosen ? " chosen" : "");
}

}  // namespace

std::string shared_drawings(const CalibrateScene& scene, const Pictures& pictures) {
  if (!scene.has_picture_size()) return "";
  const PicturePanel panel = scene.panel(map_width);
  std::array<std::string, num_directions> dots;
  for (const CornerMark& corner : scene.corners)
    if (corner.is_used && has_residual(corner))
      append_dot(dots[static_cast<std::size_t>(direction_class(corner.residual_u_px, corner.residual_v_px))],
                 panel.at(corner.u_px, corner.v_px));
  std::string out = "<svg class=\"shared\" aria-hidden=\"true\"><defs>", uses;
  for (int direction = 0; direction < num_directions; ++direction) {
    out += fmt::format("<path id=\"corners-{}\" d=\"{}\"/>", direction, dots[static_cast<std::size_t>(direction)]);
    uses += fmt::format("<use href=\"#corners-{}\"/>", direction);
  }
  out += "<g id=\"all-corners\">" + uses + "</g>";
  const ArrowScale scale = arrow_scale(scene);
  for (const std::size_t index : shown_photos(scene, pictures))
    out += picture(scene, index, pictures) + photo_marks(scene, index, scale);
  return out + "</defs></svg>";
}

MaybeFigure figure_photo(const CalibrateScene& scene, const Pictures& pictures) {
  const std::vector<std::size_t> shown = shown_photos(scene, pictures);
  if (!scene.has_picture_size() || shown.empty()) return std::nullopt;
  const std::size_t first =
      std::find(shown.begin(), shown.end(), scene.chosen) != shown.end() ? scene.chosen : shown.front();
  const PicturePanel panel = scene.panel(photo_width);
  const ArrowScale scale = arrow_scale(scene);
  Figure figure{.id = "photo", .title = "This photo: how far off is each corner?", .span = 12};
  if (!scene.corners.empty()) figure.note = "found → predicted " + scale.text();
  Svg svg(photo_width, panel.height(), "Residual arrows in the photo " + caption(scene.photos[first]), "stage");
  svg.raw(fmt::format(
      "<use data-part=\"picture\" href=\"#picture-{0}\"/><use data-part=\"marks\" href=\"#marks-{0}\"/>", first));
  if (!scene.corners.empty())
    draw_scale_bar(svg, {panel.left + 20.0, panel.bottom() - 24.0}, scale.bar_length(panel),
                   number_text(scale.bar_px, 2) + " px", true);
  figure.body =
      "<p class=\"caption\" data-part=\"caption\">" + escaped(caption(scene.photos[first])) + "</p>" + svg.str();
  figure.good = scene.corners.empty()
                    ? "No corners are drawn: this run has no camera to draw them by."
                    : "Good: arrows of no common direction, within their 3σ ellipses. Crosses: dropped corners.";
  figure.marks = scene.photos[first].corners.size();
  return figure;
}

MaybeFigure figure_all_photos(const CalibrateScene& scene, const Pictures& pictures) {
  const std::vector<std::size_t> shown = shown_photos(scene, pictures);
  if (!scene.has_picture_size() || shown.size() < 2) return std::nullopt;
  const double height = scene.panel(photo_width).height();
  Figure figure{.id = "all-photos",
                .title = "Is it the same in every photo?",
                .note = "click to choose · worst first",
                .span = 24};
  std::string thumbs;
  for (const std::size_t index : shown) thumbs += thumbnail(scene, index, height);
  figure.body = fmt::format(
      "<details class=\"thumbs\"{}><summary>{} photos with their residuals</summary><div>{}</div></details>",
      shown.size() <= 24 ? " open" : "", shown.size(), thumbs);
  figure.marks = shown.size();
  return figure;
}

MaybeFigure figure_undistorted(const CalibrateScene& scene, const Pictures& pictures) {
  static const std::string prefix = "undistorted:";
  const auto found = pictures.lower_bound(prefix);
  if (found == pictures.end() || found->first.rfind(prefix, 0) != 0) return std::nullopt;
  const std::string name = found->first.substr(prefix.size());
  Figure figure{.id = "undistorted", .title = "Are straight lines straight?", .span = 10};
  figure.note = name + " as taken, and undistorted";
  const auto original = pictures.find(name);
  figure.body = "<div class=\"pair\">";
  for (const auto& [picture, words] : {std::pair{original, "as taken"}, std::pair{found, "undistorted"}})
    if (picture != pictures.end())
      figure.body += fmt::format(
          "<figure><img alt=\"{0} {1}\" src=\"data:image/jpeg;base64,{2}\"><figcaption>{1}</figcaption></figure>",
          escaped(name), words, base64(picture->second));
  figure.body += "</div>";
  figure.good = "Good: edges that are straight in the world are straight on the right, out to the corners.";
  figure.marks = scene.photos.empty() ? 0 : 1;
  return figure;
}

}  // namespace alidade::report
