#pragma once

#include <string>
#include <string_view>
#include <vector>

namespace alidade::report {

struct Place {
  double x = 0.0, y = 0.0;
};

/// Builds one SVG drawing. Looks come from CSS classes (page_style.cpp), so that dark and light need one drawing.
class Svg {
 public:
  /// `label` says the conclusion in words, for those who cannot see the drawing.
  Svg(double width, double height, std::string_view label, std::string_view css_class = "");

  void line(Place a, Place b, std::string_view css_class);
  void rect(Place corner, double width, double height, std::string_view css_class, std::string_view more = "");
  void circle(Place centre, double radius, std::string_view css_class, std::string_view more = "");
  void polyline(const std::vector<Place>& places, std::string_view css_class);
  void path(std::string_view d, std::string_view css_class, std::string_view more = "");
  /// `anchor`: start, middle or end; `text` is escaped here.
  void text(Place place, std::string_view text, std::string_view css_class, std::string_view anchor = "start",
            std::string_view more = "");
  /// White on dark, so that it can be read on any map.
  void badge(Place centre, std::string_view text);
  void image(Place corner, double width, double height, std::string_view data_uri, std::string_view more = "");
  void raw(std::string_view markup) { out_ += markup; }

  [[nodiscard]] std::string str() const { return out_ + "</svg>"; }

 private:
  std::string out_;
};

/// `x="1" y="2"`-like attribute.
[[nodiscard]] std::string attribute(std::string_view name, double value);

/// Appends `M x y h0`: with round line ends this is a dot, the shortest way to draw thousands.
void append_dot(std::string& d, Place place);
/// Appends `M a L b` with a small head at b.
void append_arrow(std::string& d, Place a, Place b, double head);
/// Appends a polygon or polyline.
void append_polyline(std::string& d, const std::vector<Place>& places, bool closed);

/// Estimated width of a text at a font size; close enough to keep labels apart.
[[nodiscard]] double text_width(std::string_view text, double font_size);

}  // namespace alidade::report
