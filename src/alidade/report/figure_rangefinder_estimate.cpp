#include <fmt/format.h>

#include <array>
#include <cmath>
#include <numbers>

#include "alidade/report/figures.h"
#include "alidade/report/markup.h"

namespace alidade::report {
namespace {

constexpr double degrees = 180.0 / std::numbers::pi;

double sigma_of(const Document& document, const std::string& path) {
  for (const Quantity& quantity : document.estimate)
    if (quantity.path == path) return quantity.sigma;
  return std::nan("");
}

/// Rows of the table, and how many.
struct Rows {
  std::string markup;
  std::size_t count = 0;

  void add(const std::string& name, const ValueText& words, const std::string& unit, const std::string& behind = "") {
    markup += fmt::format("<tr><th>{}</th><td class=\"value\">{}</td><td>{}</td><td class=\"unit\">{}</td></tr>",
                          escaped(name), words.value,
                          words.plus_minus.empty() ? escaped(behind) : "± " + words.plus_minus, unit);
    ++count;
  }
  void add_word(const std::string& name, const std::string& word) {
    if (word.empty()) return;
    markup += fmt::format("<tr><th>{}</th><td colspan=\"3\" class=\"word\">{}</td></tr>", escaped(name), escaped(word));
    ++count;
  }
};

struct Wanted {
  const char *path, *name;
  double factor;
  const char* unit;
};

void add_beam(const Document& document, Rows& rows) {
  constexpr std::array<Wanted, 9> wanted{{{"origin_m[0]", "origin x", 1e3, "mm"},
                                          {"origin_m[1]", "origin y", 1e3, "mm"},
                                          {"origin_m[2]", "origin z", 1e3, "mm"},
                                          {"direction[0]", "direction x", 1.0, ""},
                                          {"direction[1]", "direction y", 1.0, ""},
                                          {"direction[2]", "direction z", 1.0, ""},
                                          {"theta_x_rad", "angle to the x axis", degrees, "°"},
                                          {"theta_y_rad", "angle to the y axis", degrees, "°"},
                                          {"scale", "scale of the readings", 1.0, ""}}};
  for (const Wanted& each : wanted) {
    const double value = document.estimated(each.path), sigma = sigma_of(document, each.path);
    const bool is_scale = std::string_view(each.path) == "scale";
    if (!std::isfinite(value)) continue;
    rows.add(each.name, value_text(each.factor * value, sigma > 0.0 ? each.factor * sigma : std::nan("")), each.unit,
             is_scale ? "held" : "");
  }
}

void add_fit(const Document& document, Rows& rows) {
  const auto number = [&](const char* path, const char* name, double factor, const char* unit,
                          const std::string& behind = "") {
    if (const double value = document.estimated(path); value > 0.0)  // 0: of none
      rows.add(name, {number_text(factor * value, 3), ""}, unit, behind);
  };
  number("rms_px", "spots, RMS", 1.0, "px");
  number("rms_range_m", "ranges, RMS", 1e3, "mm");
  number("left_out.rms_px", "spots of left-out shots, RMS", 1.0, "px");
  number("left_out.rms_range_m", "ranges of left-out shots, RMS", 1e3, "mm");
  const auto origin_of = [&](const char* path) {
    const std::string word = document.estimated_text(path);
    return word == "residuals" ? std::string("told") : word;
  };
  number("noise.sigma_range_m", "σ of a reading", 1e3, "mm", origin_of("noise.range_from"));
  number("noise.sigma_spot_px", "σ of a spot", 1.0, "px", origin_of("noise.spot_from"));
  number("noise.sigma_corner_px", "σ of a corner", 1.0, "px");
  rows.add_word("method", document.estimated_text("method"));
}

/// The direction's third coordinate follows from the other two: it has no row.
std::string correlations(const Document& document) {
  const std::vector<double>& upper = document.covariance_upper;
  if (document.covariance_names.size() != 7 || upper.size() != 28)
    return correlation_markup(document.covariance_names, upper);
  std::vector<double> kept;
  std::size_t at = 0;
  for (int i = 0; i < 7; ++i)
    for (int j = i; j < 7; ++j, ++at)
      if (i != 5 && j != 5) kept.push_back(upper[at]);
  return correlation_markup({"x", "y", "z", "dx", "dy", "scale"}, kept);
}

struct Look {
  const char *state, *symbol, *word;
};

Look look_of(const std::string& state) {
  if (state == "good") return {"good", "●", "good"};
  if (state == "care") return {"care", "◆", "care"};
  if (state == "bad") return {"bad", "▲", "bad"};
  return {state == "refused" ? "refused" : "unknown", state == "refused" ? "■" : "○",
          state == "refused" ? "decides" : "not graded"};
}

}  // namespace

MaybeFigure figure_rangefinder_estimate(const RangefinderScene& scene) {
  Figure figure{.id = "estimate", .title = "Estimate", .note = "camera frame, value ± 3σ", .span = 6};
  Rows rows;
  add_beam(scene.document, rows);
  const bool has_beam = rows.count > 0;
  add_fit(scene.document, rows);
  if (rows.count == 0) return std::nullopt;
  figure.body = "<table class=\"estimate\">" + rows.markup + "</table>" + correlations(scene.document);
  if (!has_beam)
    figure.good = "No origin and no direction: these shots cannot tell them.";
  else if (!scene.document.is_answer())
    figure.good = "No answer: these values are where the search ended, and not to be used.";
  else
    figure.good = "The origin is where a reading would be zero.";
  figure.marks = rows.count;
  return figure;
}

MaybeFigure figure_rangefinder_refusal(const RangefinderScene& scene) {
  const Document& document = scene.document;
  if (document.sentence.empty() && document.checks.empty()) return std::nullopt;
  Figure figure{.id = "refusal", .title = "What cannot be told?", .note = "value beside its limit", .span = 18};
  figure.body = "<p class=\"caption\">" + escaped(document.sentence) + "</p>";
  std::string rows;
  for (const CheckLine& check : document.checks) {
    const Look look = look_of(check.state);
    const std::string unit = check.unit.empty() ? "" : " " + check.unit;
    rows += fmt::format(
        "<tr><td><span class=\"state-{}\">{} {}</span></td><th>{}</th><td class=\"value\">{}</td><td>{}"
        "</td></tr>",
        look.state, look.symbol, look.word, escaped(check.text),
        std::isfinite(check.value) && check.limit != 0.0 ? number_text(check.value, 3) + escaped(unit) : "",
        std::isfinite(check.limit) && check.limit != 0.0 ? "limit " + number_text(check.limit, 3) + escaped(unit) : "");
  }
  if (!rows.empty()) figure.body += "<div class=\"scroll\"><table class=\"estimate\">" + rows + "</table></div>";
  if (!document.to_add.empty()) figure.good = "What to add: " + document.to_add + ".";
  figure.marks = document.checks.size();
  return figure;
}

}  // namespace alidade::report
