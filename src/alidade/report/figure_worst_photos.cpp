#include <fmt/format.h>

#include <algorithm>
#include <cmath>

#include "alidade/report/figures.h"
#include "alidade/report/markup.h"
#include "alidade/report/scale.h"
#include "alidade/report/svg.h"

namespace alidade::report {
namespace {

// Names without what all of them share in front, so that the end that tells them apart is seen.
std::string bar_name(const std::string& name, double pitch) {
  const std::string stem = name.substr(0, name.find_last_of('.'));
  const auto room = static_cast<std::size_t>(std::max(0.0, pitch / 6.6));
  return room < 3 ? "" : shortened(stem, room);
}

std::string title_of(const PhotoMark& photo) {
  const std::string words =
      std::isfinite(photo.rms_px) && photo.is_used ? number_text(photo.rms_px, 3) + " px" : "unused: " + photo.reason;
  return "<title>" + escaped(photo.name + ": " + words) + "</title>";
}

std::string bars(const CalibrateScene& scene, double width, const char* css_class) {
  constexpr double left = 48.0, top = 20.0, bottom = 130.0;
  const double right = width - 8.0, all = scene.document.estimated("rms_px");
  double highest = all > 0.0 ? all : 0.0;
  if (!scene.worst_first.empty()) highest = std::max(highest, scene.photos[scene.worst_first.front()].rms_px);
  const double step = round_up_125(highest / 3.5);
  const Scale y{0.0, std::max(step, 1.02 * highest), bottom, top};
  const std::size_t count = scene.worst_first.size() + scene.unused.size();
  const double pitch = std::min(110.0, (right - left) / static_cast<double>(std::max<std::size_t>(1, count)));
  const std::string label =
      scene.worst_first.empty()
          ? "No photo was used"
          : fmt::format("RMS per corner of {} photos, worst first: {} with {} px", scene.worst_first.size(),
                        scene.photos[scene.worst_first.front()].name, number_text(highest, 3));
  Svg svg(width, bottom + 40.0, label, css_class);
  for (const double tick : linear_ticks(0.0, y.high, 4)) {
    svg.line({left, y(tick)}, {right, y(tick)}, "gridline");
    svg.text({left - 6.0, y(tick) + 4.0}, number_text(tick, 2), "tick", "end");
  }
  std::size_t place = 0;
  const double gap = pitch > 12.0 ? 3.0 : pitch > 4.0 ? 1.0 : 0.0;
  const auto draw = [&](std::size_t index, double value, const char* look, const std::string& words) {
    const double x = left + pitch * static_cast<double>(place++);
    const PhotoMark& photo = scene.photos[index];
    svg.raw(fmt::format("<g class=\"pick{}\" data-photo=\"{}\">",
                        index == scene.chosen && photo.is_used ? " chosen" : "", index) +
            title_of(photo));
    svg.rect({x, y(value)}, std::max(0.5, pitch - gap), bottom - y(value), look);
    const bool is_bar = bottom - y(value) > 22.0 && photo.is_used;
    if (pitch > 34.0)
      svg.text({x + 0.5 * (pitch - gap), y(value) + (is_bar ? 14.0 : -4.0)}, words, is_bar ? "on-bar" : "tick",
               "middle");
    svg.text({x + 0.5 * (pitch - gap), bottom + 15.0}, bar_name(photo.name, pitch), "tick", "middle");
    svg.raw("</g>");
  };
  for (const std::size_t index : scene.worst_first)
    draw(index, scene.photos[index].rms_px, "photo-bar", rounded_text(scene.photos[index].rms_px, 3));
  for (const std::size_t index : scene.unused) draw(index, 0.12 * y.high, "unused-bar", "unused");
  if (all > 0.0) {
    svg.line({left, y(all)}, {right, y(all)}, "dashed");
    svg.text({right, y(all) - 5.0}, "all " + rounded_text(all, 3), "label", "end");
  }
  svg.text({0.5 * (left + right), bottom + 34.0}, "photos, worst first", "tick", "middle");
  return svg.str();
}

std::string reasons(const CalibrateScene& scene) {
  if (scene.unused.empty()) return "";
  constexpr std::size_t most = 200;
  std::string items;
  for (std::size_t i = 0; i < std::min(most, scene.unused.size()); ++i) {
    const PhotoMark& photo = scene.photos[scene.unused[i]];
    items += "<li><b>" + escaped(photo.name.empty() ? "–" : photo.name) + "</b> " +
             escaped(photo.reason.empty() ? "no reason given" : photo.reason) + "</li>";
  }
  if (scene.unused.size() > most) items += fmt::format("<li>… and {} more</li>", scene.unused.size() - most);
  return fmt::format("<details class=\"reasons\"{}><summary>{} not used, and why</summary><ul>{}</ul></details>",
                     scene.unused.size() <= 6 ? " open" : "", scene.unused.size(), items);
}

}  // namespace

MaybeFigure figure_worst_photos(const CalibrateScene& scene) {
  if (scene.photos.empty()) return std::nullopt;
  Figure figure{.id = "photos",
                .title = "Which photos fit worst?",
                .note = "RMS per corner, px · click a bar, or ← →",
                .span = 24};
  if (!scene.worst_first.empty())
    figure.body = bars(scene, 1440.0, "wide") + bars(scene, 560.0, "narrow");
  else
    figure.body = "<p>None was used.</p>";
  figure.body += reasons(scene);
  if (!scene.worst_first.empty())
    figure.good =
        "Good: all about alike. A bar that stands out is a blurred photo, a bent board or a wrong corner: look at it "
        "below.";
  figure.marks = scene.photos.size();
  return figure;
}

}  // namespace alidade::report
