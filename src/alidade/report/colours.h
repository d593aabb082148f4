#pragma once

#include <string>
#include <string_view>

namespace alidade::report {

struct Rgb {
  int red = 0, green = 0, blue = 0;
};

/// Cividis, share 0…1 (clamped): dark blue for small, yellow for large; readable for all colour visions.
/// Nuñez, Anderton & Renslow, PLoS ONE 13(7), 2018.
[[nodiscard]] Rgb cividis(double share);

/// Blue over grey to orange, share −1…1 (clamped), for values with a sign.
[[nodiscard]] Rgb diverging(double share);

/// The same colour for the same size in every report: px on a logarithmic scale, 0.05…10.
struct PixelColours {
  static constexpr double low_px = 0.05, high_px = 10.0;
  [[nodiscard]] static double share(double size_px);
};

/// Directions in the picture are drawn in this many colours, right (0), down, left, up, with hues between.
inline constexpr int num_directions = 16;
[[nodiscard]] int direction_class(double u, double v);
[[nodiscard]] Rgb direction_colour(int direction);

[[nodiscard]] std::string hex(Rgb colour);

}  // namespace alidade::report
