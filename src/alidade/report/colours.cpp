#include "alidade/report/colours.h"

#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <numbers>
#include <span>

namespace alidade::report {
namespace {

Rgb mixed(Rgb a, Rgb b, double share) {
  const auto mix = [share](int x, int y) { return static_cast<int>(std::lround(x + share * (y - x))); };
  return {mix(a.red, b.red), mix(a.green, b.green), mix(a.blue, b.blue)};
}

Rgb along(std::span<const Rgb> anchors, double share) {
  const double place =
      std::clamp(std::isfinite(share) ? share : 0.0, 0.0, 1.0) * static_cast<double>(anchors.size() - 1);
  const std::size_t below = std::min(static_cast<std::size_t>(place), anchors.size() - 2);
  return mixed(anchors[below], anchors[below + 1], place - static_cast<double>(below));
}

}  // namespace

Rgb cividis(double share) {
  static constexpr std::array<Rgb, 10> anchors{{{0, 34, 78},
                                                {18, 53, 112},
                                                {59, 73, 108},
                                                {87, 93, 109},
                                                {112, 113, 115},
                                                {138, 134, 120},
                                                {165, 156, 116},
                                                {195, 179, 105},
                                                {225, 204, 85},
                                                {254, 232, 56}}};
  return along(anchors, share);
}

Rgb diverging(double share) {
  static constexpr std::array<Rgb, 5> anchors{
      {{0, 74, 128}, {58, 146, 200}, {225, 226, 228}, {230, 159, 0}, {150, 62, 0}}};
  return along(anchors, 0.5 + 0.5 * share);
}

double PixelColours::share(double size_px) {
  if (!(size_px > 0.0)) return 0.0;
  return std::log(size_px / low_px) / std::log(high_px / low_px);
}

int direction_class(double u, double v) {
  const double turn = std::atan2(v, u) / (2.0 * std::numbers::pi);  // v points down: 1/4 turn is down
  const int nearest = static_cast<int>(std::lround(turn * num_directions));
  return (nearest + num_directions) % num_directions;
}

Rgb direction_colour(int direction) {
  static constexpr std::array<Rgb, 5> anchors{
      {{213, 94, 0}, {154, 91, 196}, {0, 114, 178}, {0, 158, 115}, {213, 94, 0}}};
  return along(anchors, static_cast<double>(direction) / num_directions);
}

std::string hex(Rgb colour) { return fmt::format("#{:02x}{:02x}{:02x}", colour.red, colour.green, colour.blue); }

}  // namespace alidade::report
