#include "alidade/report/svg.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>

#include "alidade/report/markup.h"

namespace alidade::report {
namespace {

void append_pair(std::string& out, char command, Place place) {
  out += command;
  append_coordinate(out, place.x);
  out += ' ';
  append_coordinate(out, place.y);
}

std::string class_attribute(std::string_view css_class) {
  return css_class.empty() ? std::string() : fmt::format(" class=\"{}\"", css_class);
}

}  // namespace

std::string attribute(std::string_view name, double value) {
  std::string out = fmt::format(" {}=\"", name);
  append_coordinate(out, value, 2);
  return out + '"';
}

Svg::Svg(double width, double height, std::string_view label, std::string_view css_class)
    : out_(fmt::format("<svg viewBox=\"0 0 {:.0f} {:.0f}\" role=\"img\" aria-label=\"{}\"{}>", width, height,
                       escaped(label), class_attribute(css_class))) {}

void Svg::line(Place a, Place b, std::string_view css_class) {
  out_ += "<line" + attribute("x1", a.x) + attribute("y1", a.y) + attribute("x2", b.x) + attribute("y2", b.y) +
          class_attribute(css_class) + "/>";
}

void Svg::rect(Place corner, double width, double height, std::string_view css_class, std::string_view more) {
  out_ += "<rect" + attribute("x", corner.x) + attribute("y", corner.y) + attribute("width", std::max(0.0, width)) +
          attribute("height", std::max(0.0, height)) + class_attribute(css_class);
  out_ += fmt::format(" {}/>", more);
}

void Svg::circle(Place centre, double radius, std::string_view css_class, std::string_view more) {
  out_ += "<circle" + attribute("cx", centre.x) + attribute("cy", centre.y) + attribute("r", radius) +
          class_attribute(css_class);
  out_ += fmt::format(" {}/>", more);
}

void Svg::polyline(const std::vector<Place>& places, std::string_view css_class) {
  std::string d;
  append_polyline(d, places, false);
  path(d, css_class);
}

void Svg::path(std::string_view d, std::string_view css_class, std::string_view more) {
  if (!d.empty()) out_ += fmt::format("<path d=\"{}\"{} {}/>", d, class_attribute(css_class), more);
}

void Svg::text(Place place, std::string_view text, std::string_view css_class, std::string_view anchor,
               std::string_view more) {
  out_ += "<text" + attribute("x", place.x) + attribute("y", place.y) + class_attribute(css_class);
  if (anchor != "start") out_ += fmt::format(" text-anchor=\"{}\"", anchor);
  out_ += fmt::format(" {}>{}</text>", more, escaped(text));
}

void Svg::badge(Place centre, std::string_view words) {
  const double width = text_width(words, 12.0) + 8.0;
  rect({centre.x - width / 2.0, centre.y - 9.0}, width, 18.0, "badge", "rx=\"3\"");
  text({centre.x, centre.y + 4.0}, words, "badge-text", "middle");
}

void Svg::image(Place corner, double width, double height, std::string_view data_uri, std::string_view more) {
  out_ += "<image" + attribute("x", corner.x) + attribute("y", corner.y) + attribute("width", width) +
          attribute("height", height);
  out_ += fmt::format(" preserveAspectRatio=\"none\" href=\"{}\" {}/>", data_uri, more);
}

void append_dot(std::string& d, Place place) {
  append_pair(d, 'M', place);
  d += "h0";
}

void append_arrow(std::string& d, Place a, Place b, double head) {
  append_pair(d, 'M', a);
  append_pair(d, 'L', b);
  const double length = std::hypot(b.x - a.x, b.y - a.y);
  head = std::min(head, 0.5 * length);
  if (!(head > 0.4)) return;
  const double ux = (b.x - a.x) / length * head, uy = (b.y - a.y) / length * head;
  append_pair(d, 'm', {-ux + 0.5 * uy, -uy - 0.5 * ux});
  append_pair(d, 'L', b);
  append_pair(d, 'l', {-ux - 0.5 * uy, -uy + 0.5 * ux});
}

void append_polyline(std::string& d, const std::vector<Place>& places, bool closed) {
  for (std::size_t i = 0; i < places.size(); ++i) append_pair(d, i == 0 ? 'M' : 'L', places[i]);
  if (closed && !places.empty()) d += 'Z';
}

double text_width(std::string_view text, double font_size) {
  const auto characters = std::count_if(text.begin(), text.end(), [](char c) { return (c & 0xC0) != 0x80; });
  return 0.6 * font_size * static_cast<double>(characters);
}

}  // namespace alidade::report
