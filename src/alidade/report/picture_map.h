#pragma once

#include <string>
#include <vector>

#include "alidade/report/document.h"
#include "alidade/report/svg.h"

namespace alidade::report {

/// The picture's place on the paper: pixel (0,0) is the centre of the top-left pixel.
struct PicturePanel {
  double width_px = 0.0, height_px = 0.0;  ///< Of the photo.
  double left = 0.0, top = 0.0, scale = 1.0;

  /// The picture as large as fits into `width` × `max_height`, centred.
  static PicturePanel fitting(double width_px, double height_px, double width, double max_height);

  [[nodiscard]] Place at(double u_px, double v_px) const {
    return {left + (u_px + 0.5) * scale, top + (v_px + 0.5) * scale};
  }
  [[nodiscard]] double width() const { return width_px * scale; }
  [[nodiscard]] double height() const { return height_px * scale; }
  [[nodiscard]] double bottom() const { return top + height(); }
  void frame(Svg& svg, const char* css_class = "panel") const { svg.rect({left, top}, width(), height(), css_class); }
};

/// Sizes [px] over the picture in PixelColours. `clip_id` must be unique in the page.
void draw_heat(Svg& svg, const PicturePanel& panel, const Grid& grid, const std::vector<double>& sizes_px,
               const std::string& clip_id);

/// Labelled lines of equal size [px], from `smallest_share` of the largest on. Returns the number of levels drawn.
int draw_contours(Svg& svg, const PicturePanel& panel, const Grid& grid, const std::vector<double>& sizes_px,
                  double smallest_share = 1e-3);

/// Magnified arrows at (u, v): how many times longer than in the picture, a round number, the same for all of them.
struct ArrowScale {
  double magnification = 1.0;
  double bar_px = 1.0;  ///< What the scale bar stands for.

  /// So that a vector of `typical_px` becomes about `length` long on the paper.
  static ArrowScale fitting(const PicturePanel& panel, double typical_px, double length);
  [[nodiscard]] double bar_length(const PicturePanel& panel) const { return bar_px * magnification * panel.scale; }
  [[nodiscard]] Place tip(const PicturePanel& panel, Place from, double du_px, double dv_px) const {
    const double factor = magnification * panel.scale;
    return {from.x + du_px * factor, from.y + dv_px * factor};
  }
  [[nodiscard]] std::string text() const;
};

/// "├─┤ 0.5 px" with its left end at `left_middle`.
void draw_scale_bar(Svg& svg, Place left_middle, double length, const std::string& words, bool on_picture);

/// Arrows of a vector field on the grid, thinned to about `across` columns. Those longer than two steps of the grid are
/// left to the colours. Returns their number. `clip_id`: of the
/// heat below.
int draw_field(Svg& svg, const PicturePanel& panel, const Grid& grid, const std::string& u_name,
               const std::string& v_name, const ArrowScale& scale, int across, const std::string& clip_id);

/// The colour bar of PixelColours with ticks, from `left` to `right`, its top at `top`.
void draw_pixel_colour_bar(Svg& svg, double left, double right, double top, const std::string& words);

/// √(u² + v²) row by row.
[[nodiscard]] std::vector<double> lengths(const std::vector<double>& u, const std::vector<double>& v);
[[nodiscard]] std::vector<double> times(double factor, std::vector<double> values);

}  // namespace alidade::report
