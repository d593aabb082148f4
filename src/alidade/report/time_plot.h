#pragma once

#include <string>
#include <vector>

#include "alidade/report/observe_scene.h"
#include "alidade/report/scale.h"
#include "alidade/report/svg.h"

namespace alidade::report {

/// A panel with time to the right, in a drawing that may hold several. Long columns are thinned as they are drawn.
class TimePlot {
 public:
  static constexpr double width = 460.0, left = 52.0, right = width - 10.0;

  /// The panel with lines and numbers of the values.
  TimePlot(Svg& svg, const ObserveScene& scene, const Scale& y, int wanted_ticks);

  void time_axis(const std::string& words = "");  ///< Numbers below, and what they are.
  /// Zooms shaded; the others marked in a strip above the panel, by shape, with a hairline each where they are few.
  void event_marks(bool with_strip);
  /// What is drawn from here to `end` is cut off at the panel. `clip_id` must be unique in the page.
  void begin(const std::string& clip_id);
  void band(const std::vector<double>& low, const std::vector<double>& high, const char* css_class);
  void curve(const std::vector<double>& values, const char* css_class);
  void dots(const std::vector<double>& values, const char* css_class);
  void level(double value, const char* css_class);
  void end();

 private:
  void zoom_spans();
  [[nodiscard]] std::vector<double> places(const Scale& scale, const std::vector<double>& values) const;

  Svg& svg_;
  const ObserveScene& scene_;
  Scale x_, y_;
  std::vector<double> x_places_;
};

/// "time, s", or from when.
[[nodiscard]] std::string time_words(const ObserveScene& scene);

/// A number on an axis whose ticks are `step` apart.
[[nodiscard]] std::string tick_text(double value, double step);

/// The same on a logarithmic axis: 0.01, 10⁻⁵.
[[nodiscard]] std::string power_text(double value);

/// Appends the shape of an event: ▼ burst, ◆ slip, ● start, ■ restart, ❙❙ gap, ▬ zoom.
void append_event_shape(std::string& d, const std::string& kind, Place centre, double size);

}  // namespace alidade::report
