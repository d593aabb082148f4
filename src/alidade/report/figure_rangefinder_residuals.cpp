#include <fmt/format.h>

#include <algorithm>
#include <cmath>

#include "alidade/report/figures.h"
#include "alidade/report/markup.h"
#include "alidade/report/observe_scene.h"
#include "alidade/report/scale.h"
#include "alidade/report/svg.h"
#include "alidade/report/thin.h"
#include "alidade/report/time_plot.h"

namespace alidade::report {
namespace {

constexpr double width = 820.0, left = 54.0, right = width - 8.0;
constexpr double range_top = 26.0, between = 36.0;

/// One coordinate of the residuals, in the unit that is drawn.
struct Values {
  std::vector<double> residual, sigma, left_out;  ///< One a shot; NaN where there is none.
};

template <typename Residual, typename Sigma, typename LeftOut>
Values values_of(const RangefinderScene& scene, Residual residual, Sigma sigma, LeftOut left_out) {
  Values values;
  for (const ShotMark& shot : scene.shots) {
    values.residual.push_back(residual(shot));
    values.sigma.push_back(sigma(shot));
    values.left_out.push_back(left_out(shot));
  }
  return values;
}

Values ranges_mm(const RangefinderScene& scene) {
  return values_of(
      scene, [](const ShotMark& s) { return 1e3 * s.residual_range_m; },
      [](const ShotMark& s) { return 1e3 * s.sigma_range_m; },
      [](const ShotMark& s) { return 1e3 * s.left_out_range_m; });
}

Values spots_px(const RangefinderScene& scene, int axis) {
  return values_of(
      scene, [axis](const ShotMark& s) { return s.residual_px[axis]; },
      [axis](const ShotMark& s) { return std::sqrt(s.cov_px(axis, axis)); },
      [axis](const ShotMark& s) { return s.left_out_px[axis]; });
}

bool has_numbers(const std::vector<double>& values) {
  return std::ranges::any_of(values, [](double value) { return std::isfinite(value); });
}

/// Holds what was used; what was not may lie beyond.
double limit_of(const RangefinderScene& scene, std::initializer_list<const Values*> all) {
  std::vector<double> reach, bars, beside;
  for (const Values* values : all)
    for (std::size_t i = 0; i < scene.shots.size(); ++i) {
      if (!scene.shots[i].is_used) continue;
      reach.push_back(std::abs(values->residual[i]));
      bars.push_back(3.0 * values->sigma[i]);
      beside.push_back(std::abs(values->left_out[i]));
    }
  double limit = 0.0;
  for (const double size : {quantile(reach, 1.0), quantile(bars, 0.9), quantile(beside, 0.95)})
    if (std::isfinite(size)) limit = std::max(limit, size);
  if (!(limit > 0.0))
    for (const Values* values : all) limit = std::max(limit, largest_size(values->residual));
  return limit > 0.0 ? 1.15 * limit : 1.0;
}

struct Panel {
  Scale y;
  double top = 0.0, bottom = 0.0, slot = 1.0;
  const char* unit = "";
  [[nodiscard]] double x(std::size_t place, double share) const {
    return left + slot * (static_cast<double>(place) + 0.5 + share);
  }
};

/// At the edge, pointing outwards, with its value; how far out it lies would hide the rest.
void draw_beyond(Svg& svg, const Panel& panel, double x, double value, const char* look, bool with_words) {
  const bool is_up = value > 0.0;
  const double tip = is_up ? panel.top + 2.0 : panel.bottom - 2.0, foot = is_up ? tip + 9.0 : tip - 9.0;
  std::string d;
  append_polyline(d, {{x - 4.5, foot}, {x, tip}, {x + 4.5, foot}}, true);
  svg.path(d, look);
  if (!with_words) return;
  const std::string words = number_text(value, 3) + " " + panel.unit;
  const bool is_right = x + 10.0 + text_width(words, 11.5) > right;
  svg.text({x + (is_right ? -8.0 : 8.0), tip + (is_up ? 10.0 : -2.0)}, words, "small", is_right ? "end" : "start");
}

void draw_value(Svg& svg, const Panel& panel, const Values& values, std::size_t shot, double x, bool is_used,
                const char* colour) {
  const double value = values.residual[shot], sigma = values.sigma[shot], other = values.left_out[shot];
  const double half = std::clamp(0.16 * panel.slot, 1.2, 6.0);
  if (std::isfinite(sigma) && sigma > 0.0) {
    const double high = panel.y(std::min(3.0 * sigma, panel.y.high)),
                 low = panel.y(std::max(-3.0 * sigma, panel.y.low));
    svg.rect({x - half, high}, 2.0 * half, low - high, "expected");
  }
  if (!std::isfinite(value)) return;
  const std::string look = std::string("mark ") + colour;
  if (!panel.y.holds(value)) return draw_beyond(svg, panel, x, value, is_used ? look.c_str() : "mark ink", !is_used);
  const Place at{x, panel.y(value)};
  if (std::isfinite(other) && panel.y.holds(other))
    svg.circle({x, panel.y(other)}, std::min(5.2, 0.2 * panel.slot + 2.2), "left-ring");
  const double size = std::clamp(0.14 * panel.slot, 1.6, 3.8);
  if (!is_used) {
    std::string d;
    append_polyline(d, {{at.x - 4.5, at.y - 4.5}, {at.x + 4.5, at.y + 4.5}}, false);
    append_polyline(d, {{at.x - 4.5, at.y + 4.5}, {at.x + 4.5, at.y - 4.5}}, false);
    svg.path(d, "cross-mark");
  } else if (std::string_view(colour) == "orange") {
    svg.rect({at.x - 0.9 * size, at.y - 0.9 * size}, 1.8 * size, 1.8 * size, look);
  } else {
    svg.circle(at, size, look);
  }
}

void draw_axes(Svg& svg, const Panel& panel, const std::string& words) {
  svg.text({left, panel.top - 9.0}, words, "label");
  const std::vector<double> ticks = linear_ticks(panel.y.low, panel.y.high, 5);
  const double step = ticks.size() > 1 ? ticks[1] - ticks[0] : 0.0;
  for (const double tick : ticks) {
    svg.line({left, panel.y(tick)}, {right, panel.y(tick)}, tick == 0.0 ? "axis" : "gridline");
    svg.text({left - 6.0, panel.y(tick) + 4.0}, tick_text(tick, step), "tick", "end");
  }
}

void draw_shot_axis(Svg& svg, const RangefinderScene& scene, const std::vector<std::size_t>& shown,
                    const Panel& panel) {
  const bool has_room = panel.slot >= 30.0;
  const std::size_t every = std::max<std::size_t>(1, static_cast<std::size_t>(std::ceil(26.0 / panel.slot)));
  for (std::size_t i = 0; i < shown.size(); i += every) {
    svg.text({panel.x(i, 0.0), panel.bottom + 16.0}, std::to_string(shown[i] + 1), "tick", "middle");
    if (has_room)
      svg.text({panel.x(i, 0.0), panel.bottom + 31.0}, number_text(scene.shots[shown[i]].range_m, 3), "tick", "middle");
  }
  svg.text({left - 6.0, panel.bottom + 16.0}, "shot", "tick", "end");
  if (has_room) svg.text({left - 6.0, panel.bottom + 31.0}, "m", "tick", "end");
}

std::string hover_words(const ShotMark& shot) {
  std::string words = shot.name + " · " + number_text(shot.range_m, 4) + " m";
  if (shot.has_range_residual())
    words += fmt::format(" · range {} ± {} mm", number_text(1e3 * shot.residual_range_m, 3),
                         number_text(3e3 * shot.sigma_range_m, 2));
  if (shot.has_spot_residual())
    words +=
        fmt::format(" · spot {}, {} px", number_text(shot.residual_px.x(), 2), number_text(shot.residual_px.y(), 2));
  if (!shot.is_used) words += " · not used" + (shot.reason.empty() ? "" : ": " + shot.reason);
  return words;
}

/// Shots with a residual; of very many the worst of each stretch and all that were not used.
std::vector<std::size_t> shown_shots(const RangefinderScene& scene) {
  constexpr std::size_t most = 300;
  std::vector<std::size_t> with;
  std::vector<double> severity;
  std::vector<bool> keep;
  for (std::size_t i = 0; i < scene.shots.size(); ++i) {
    const ShotMark& shot = scene.shots[i];
    if (!shot.has_range_residual() && !shot.has_spot_residual()) continue;
    with.push_back(i);
    severity.push_back(shot.severity());
    keep.push_back(!shot.is_used);
  }
  std::vector<std::size_t> shown;
  for (const std::size_t row : thinned_rows(with.size(), {severity}, keep, most)) shown.push_back(with[row]);
  return shown;
}

struct Inside {
  std::size_t known = 0, inside = 0;
};

Inside inside_of(const RangefinderScene& scene, const Values& values) {
  Inside count;
  for (std::size_t i = 0; i < scene.shots.size(); ++i) {
    if (!scene.shots[i].is_used || !std::isfinite(values.residual[i]) || !(values.sigma[i] > 0.0)) continue;
    ++count.known;
    count.inside += std::abs(values.residual[i]) <= 3.0 * values.sigma[i] ? 1U : 0U;
  }
  return count;
}

std::string reasons(const RangefinderScene& scene) {
  constexpr std::size_t most = 200;
  std::string items;
  std::size_t count = 0;
  for (std::size_t i = 0; i < scene.shots.size(); ++i) {
    const ShotMark& shot = scene.shots[i];
    if (shot.is_used || ++count > most) continue;
    items += fmt::format("<li>shot {} <b>{}</b>: {}</li>", i + 1, escaped(shot.name),
                         shot.reason.empty() ? "not used" : escaped(shot.reason));
  }
  if (count == 0) return "";
  if (count > most) items += fmt::format("<li>… and {} more: the table has them all</li>", count - most);
  return fmt::format("<details class=\"reasons\"{}><summary>{} shot{} not used</summary><ul>{}</ul></details>",
                     count <= 6 ? " open" : "", count, count == 1 ? "" : "s", items);
}

std::string legend(const RangefinderScene& scene, bool has_range, bool has_spot) {
  const auto sample = [](const std::string& shape, const std::string& words) {
    return "<span><svg class=\"sample-mark\" viewBox=\"0 0 12 12\" aria-hidden=\"true\">" + shape + "</svg>" + words +
           "</span>";
  };
  std::string out = "<p class=\"legend\">";
  out += sample("<rect x=\"3\" y=\"0\" width=\"6\" height=\"12\" class=\"expected\"/>", "± 3σ");
  if (has_range) out += sample("<circle cx=\"6\" cy=\"6\" r=\"3.6\" class=\"mark ink\"/>", "range");
  if (has_spot)
    out += sample("<circle cx=\"6\" cy=\"6\" r=\"3.6\" class=\"mark blue\"/>", "spot u") +
           sample("<rect x=\"2.6\" y=\"2.6\" width=\"6.8\" height=\"6.8\" class=\"mark orange\"/>", "spot v");
  if (scene.document.table("left_out"))
    out += sample("<circle cx=\"6\" cy=\"6\" r=\"4.6\" class=\"left-ring\"/>", "as the other shots predict it");
  if (std::ranges::any_of(scene.shots, [](const ShotMark& shot) { return !shot.is_used; }))
    out += sample("<path d=\"M2 2L10 10M2 10L10 2\" class=\"cross-mark\"/>", "not used");
  return out + "</p>";
}

/// The drawing with its panels: ranges above spots, either may be missing.
struct Drawing {
  Values range, u, v;
  bool has_range = false, has_spot = false;
  Panel range_panel, spot_panel;
  double bottom = 0.0;
};

Drawing drawing_of(const RangefinderScene& scene, std::size_t num_shown) {
  Drawing drawing{
      .range = ranges_mm(scene), .u = spots_px(scene, 0), .v = spots_px(scene, 1), .range_panel = {}, .spot_panel = {}};
  drawing.has_range = has_numbers(drawing.range.residual);
  drawing.has_spot = has_numbers(drawing.u.residual);
  const double slot = (right - left) / static_cast<double>(std::max<std::size_t>(1, num_shown));
  const double panel_height = drawing.has_range && drawing.has_spot ? 150.0 : 250.0;
  const auto panel_at = [&](double top, double limit, const char* unit) {
    return Panel{{-limit, limit, top + panel_height, top}, top, top + panel_height, slot, unit};
  };
  drawing.range_panel = panel_at(range_top, limit_of(scene, {&drawing.range}), "mm");
  drawing.spot_panel = panel_at(drawing.has_range ? range_top + panel_height + between : range_top,
                                limit_of(scene, {&drawing.u, &drawing.v}), "px");
  drawing.bottom = drawing.has_spot ? drawing.spot_panel.bottom : drawing.range_panel.bottom;
  return drawing;
}

void draw_shot(Svg& svg, const RangefinderScene& scene, const Drawing& drawing, std::size_t place, std::size_t index) {
  const ShotMark& shot = scene.shots[index];
  svg.raw(fmt::format("<g class=\"pick{}\" data-photo=\"{}\"><title>{}</title>", index == scene.chosen ? " chosen" : "",
                      index, escaped(hover_words(shot))));
  const double slot = drawing.range_panel.slot;
  svg.rect({drawing.range_panel.x(place, -0.5), range_top}, slot, drawing.bottom - range_top,
           shot.is_used ? "slot" : "unused-span");
  if (drawing.has_range)
    draw_value(svg, drawing.range_panel, drawing.range, index, drawing.range_panel.x(place, 0.0), shot.is_used, "ink");
  if (drawing.has_spot) {
    draw_value(svg, drawing.spot_panel, drawing.u, index, drawing.spot_panel.x(place, -0.2), shot.is_used, "blue");
    draw_value(svg, drawing.spot_panel, drawing.v, index, drawing.spot_panel.x(place, 0.2), shot.is_used, "orange");
  }
  svg.raw("</g>");
}

}  // namespace

MaybeFigure figure_rangefinder_residuals(const RangefinderScene& scene) {
  const std::vector<std::size_t> shown = shown_shots(scene);
  if (shown.empty()) return std::nullopt;
  const Drawing drawing = drawing_of(scene, shown.size());
  Inside inside;
  for (const Values* values : {&drawing.range, &drawing.u, &drawing.v}) {
    const Inside part = inside_of(scene, *values);
    inside.known += part.known;
    inside.inside += part.inside;
  }
  const std::string share = share_text(inside.inside, inside.known);
  Svg svg(width, drawing.bottom + 40.0,
          fmt::format("Range and spot residuals of {} shots; {} of those used are inside 3σ", shown.size(), share));
  if (drawing.has_range) draw_axes(svg, drawing.range_panel, "range as the board says − as read, mm");
  if (drawing.has_spot) draw_axes(svg, drawing.spot_panel, "spot predicted − seen, px");
  for (std::size_t place = 0; place < shown.size(); ++place) draw_shot(svg, scene, drawing, place, shown[place]);
  draw_shot_axis(svg, scene, shown, drawing.has_spot ? drawing.spot_panel : drawing.range_panel);
  Figure figure{
      .id = "residuals", .title = "Does each shot fit?", .note = "mm and px, ± 3σ · click a shot", .span = 14};
  figure.body = legend(scene, drawing.has_range, drawing.has_spot) + svg.str() + reasons(scene);
  figure.good = "Good: marks inside their bars, on both sides of zero; rings hardly further out.";
  if (inside.known > 0) figure.good += " Of the residuals of used shots " + share + " are inside (99.7 % expected).";
  if (!scene.document.is_answer())
    figure.good = "No answer: shots may fit each other and still not tell where the beam is.";
  figure.marks = shown.size();
  return figure;
}

}  // namespace alidade::report
