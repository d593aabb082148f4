#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <cmath>

#include "alidade/report/colours.h"
#include "alidade/report/figures.h"
#include "alidade/report/markup.h"
#include "alidade/report/svg.h"

namespace alidade::report {
namespace {

std::string last_part(const std::string& path) { return path.substr(path.find_last_of('.') + 1); }

// Units are in the names (`origin_m`, `rms_px`), except of a lens, whose parameters have the names of its literature.
std::string unit_of(const std::string& path) {
  const std::string name = path.substr(0, path.find('['));
  static constexpr std::array<std::string_view, 7> lens_px{"fx", "fy", "cx", "cy", "skew", "width", "height"};
  if ((name.find("camera") != std::string::npos || name.starts_with("bound.") || name.starts_with("error.")) &&
      std::find(lens_px.begin(), lens_px.end(), last_part(name)) != lens_px.end())
    return "px";
  using Ending = std::pair<std::string_view, std::string_view>;
  static constexpr std::array<Ending, 6> endings{Ending{"_px", "px"}, Ending{"_m", "m"},   Ending{"_rad", "rad"},
                                                 Ending{"_s", "s"},   Ending{"_deg", "°"}, Ending{"_m_s", "m/s"}};
  std::string unit;
  for (const auto& [ending, word] : endings)
    if (name.size() > ending.size() && name.compare(name.size() - ending.size(), ending.size(), ending) == 0)
      unit = word;
  return unit;
}

// What the run was given and what it counted stand in the header and in the tables.
bool is_shown_elsewhere(const std::string& path) {
  for (const char* beginning : {"photos", "board.", "corners_", "events["})
    if (path.rfind(beginning, 0) == 0) return true;
  return false;
}

// The unit has its own column: `transfer_rms_px` reads "transfer rms".
std::string shown_name(const std::string& path, const std::string& unit) {
  std::string name = path.rfind("camera.", 0) == 0 ? last_part(path) : path;
  if (const std::size_t at = name.rfind("_" + unit); at != std::string::npos && at > 0 && !unit.empty())
    name.erase(at, unit.size() + 1);
  std::replace(name.begin(), name.end(), '_', ' ');
  return name;
}

std::string row_of(const Quantity& quantity, bool has_sigmas) {
  const bool is_lens = quantity.path.rfind("camera.", 0) == 0;
  const std::string name = shown_name(quantity.path, unit_of(quantity.path));
  if (!quantity.text.empty() || !std::isfinite(quantity.value))
    return fmt::format("<tr><th>{}</th><td colspan=\"3\" class=\"word\">{}</td></tr>", escaped(name),
                       quantity.text.empty() ? "–" : escaped(quantity.text));
  const ValueText words = value_text(quantity.value, quantity.sigma);
  const bool is_size = name == "width" || name == "height";
  const std::string behind = !words.plus_minus.empty()           ? "± " + words.plus_minus
                             : is_lens && !is_size && has_sigmas ? "held"
                                                                 : "";
  return fmt::format("<tr><th>{}</th><td class=\"value\">{}</td><td>{}</td><td class=\"unit\">{}</td></tr>",
                     escaped(name), words.value, behind, unit_of(quantity.path));
}

struct Correlations {
  std::vector<std::string> names;
  std::vector<double> rho;  // row-major, NaN where there is no variance
};

Correlations correlations(const std::vector<std::string>& names, const std::vector<double>& upper) {
  Correlations result{names, {}};
  for (std::string& name : result.names)
    if (name.starts_with("camera.")) name = last_part(name);
  const std::size_t n = result.names.size();
  if (n < 2 || upper.size() != n * (n + 1) / 2) return {};
  std::vector<double> cov(n * n);
  std::size_t at = 0;
  for (std::size_t i = 0; i < n; ++i)
    for (std::size_t j = i; j < n; ++j) cov[i * n + j] = cov[j * n + i] = upper[at++];
  result.rho.resize(n * n);
  for (std::size_t i = 0; i < n; ++i)
    for (std::size_t j = 0; j < n; ++j) {
      const double scale = std::sqrt(cov[i * n + i] * cov[j * n + j]);
      result.rho[i * n + j] = scale > 0.0 ? cov[i * n + j] / scale : std::nan("");
    }
  // A parameter that was held has no variance and no correlations to show.
  for (std::size_t i = n; i-- > 0;) {
    if (std::isfinite(result.rho[i * n + i])) continue;
    Correlations kept;
    for (std::size_t a = 0; a < n; ++a)
      for (std::size_t b = 0; b < n; ++b)
        if (std::isfinite(result.rho[a * n + a]) && std::isfinite(result.rho[b * n + b]))
          kept.rho.push_back(result.rho[a * n + b]);
    for (std::size_t a = 0; a < n; ++a)
      if (std::isfinite(result.rho[a * n + a])) kept.names.push_back(result.names[a]);
    return kept;
  }
  return result;
}

std::string correlation_words(double rho) {
  const int hundredths = static_cast<int>(std::lround(100.0 * std::abs(rho)));
  const char* sign = rho < 0.0 ? "−" : "";
  return hundredths >= 100 ? fmt::format("{}1", sign) : fmt::format("{}.{:02d}", sign, hundredths);
}

void draw_cell(Svg& svg, Place corner, double size, double rho, bool is_diagonal) {
  const Rgb colour = diverging(-rho);  // blue for alike, orange for opposed
  const bool is_strong = !is_diagonal && std::abs(rho) > 0.6;
  svg.rect(
      corner, size - 1.5, size - 1.5, is_diagonal ? "diagonal" : "",
      is_diagonal ? "" : fmt::format("fill=\"{}\" fill-opacity=\"{:.2f}\"", hex(colour), 0.1 + 0.9 * std::abs(rho)));
  if (!is_strong) return;
  const bool is_dark = std::abs(rho) > 0.8;
  svg.text({corner.x + 0.5 * size, corner.y + 0.5 * size + 4.0}, correlation_words(rho),
           is_dark ? "on-dark" : "on-light", "middle");
}

std::string correlation_matrix(const Correlations& matrix) {
  constexpr double size = 28.0, left = 34.0;
  const std::size_t n = std::min<std::size_t>(matrix.names.size(), 24);
  double strongest = 0.0;
  std::string words = "no strong correlation";
  const double side = left + size * static_cast<double>(n);
  for (std::size_t i = 0; i < n; ++i)
    for (std::size_t j = 0; j < i; ++j)
      if (const double rho = matrix.rho[i * matrix.names.size() + j]; std::abs(rho) > std::max(0.6, strongest)) {
        strongest = std::abs(rho);
        words =
            fmt::format("strongest between {} and {}: {}", matrix.names[j], matrix.names[i], correlation_words(rho));
      }
  Svg svg(std::max(side, 340.0), side - left + 22.0, "Correlation of the estimates; " + words, "matrix");
  for (std::size_t i = 0; i < n; ++i) {
    const double middle = size * (static_cast<double>(i) + 0.5);
    svg.text({left - 6.0, middle + 4.0}, shortened(matrix.names[i], 5), "tick", "end");
    svg.text({left + middle, side - left + 14.0}, shortened(matrix.names[i], 5), "tick", "middle");
    for (std::size_t j = 0; j < n; ++j)
      draw_cell(svg, {left + size * static_cast<double>(j), size * static_cast<double>(i)}, size,
                matrix.rho[i * matrix.names.size() + j], i == j);
  }
  return svg.str() + "<p class=\"good\">" + escaped(words) + "; a number where it is above 0.6</p>";
}

}  // namespace

std::string correlation_markup(const std::vector<std::string>& names, const std::vector<double>& upper) {
  const Correlations matrix = correlations(names, upper);
  return matrix.names.size() > 1 ? "<h3>correlation</h3>" + correlation_matrix(matrix) : "";
}

MaybeFigure figure_estimate(const Document& document) {
  Figure figure{.id = "estimate", .title = "Estimate", .note = "value ± 3σ", .span = 6};
  std::string lens, rest;
  const bool has_sigmas =
      std::any_of(document.estimate.begin(), document.estimate.end(), [](const Quantity& q) { return q.sigma > 0.0; });
  for (const Quantity& quantity : document.estimate) {
    if (is_shown_elsewhere(quantity.path)) continue;
    (quantity.path.rfind("camera.", 0) == 0 ? lens : rest) += row_of(quantity, has_sigmas);
    ++figure.marks;
  }
  if (figure.marks == 0) return std::nullopt;
  figure.body = "<table class=\"estimate\">" + lens + rest + "</table>";
  figure.body += correlation_markup(document.covariance_names, document.covariance_upper);
  return figure;
}

}  // namespace alidade::report
