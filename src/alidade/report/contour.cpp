#include "alidade/report/contour.h"

#include <array>
#include <cmath>
#include <cstddef>
#include <optional>

namespace alidade::report {
namespace {

constexpr std::size_t no_edge = static_cast<std::size_t>(-1);

// A cell side is numbered 2·(row·cols + col) from its top-left grid point: + 0 to the right of it, + 1 below it.
class Tracer {
 public:
  Tracer(int cols, int rows, const std::vector<double>& values, double level)
      : cols_(static_cast<std::size_t>(cols)),
        rows_(static_cast<std::size_t>(rows)),
        values_(values),
        level_(level),
        neighbours_(2 * cols_ * rows_, {no_edge, no_edge}),
        is_done_(2 * cols_ * rows_, false) {}

  std::vector<Contour> trace() {
    for (std::size_t row = 0; row + 1 < rows_; ++row)
      for (std::size_t col = 0; col + 1 < cols_; ++col) add_cell(col, row);
    std::vector<Contour> contours;
    for (const bool open_only : {true, false})  // open lines first, from their ends
      for (std::size_t edge = 0; edge < neighbours_.size(); ++edge)
        if (!is_done_[edge] && neighbours_[edge][0] != no_edge && (!open_only || neighbours_[edge][1] == no_edge))
          contours.push_back(follow(edge));
    return contours;
  }

 private:
  [[nodiscard]] double value(std::size_t col, std::size_t row) const { return values_[row * cols_ + col]; }
  [[nodiscard]] bool is_above(std::size_t col, std::size_t row) const { return value(col, row) >= level_; }

  void join(std::size_t a, std::size_t b) {
    for (const auto& [from, to] : {std::pair{a, b}, std::pair{b, a}})
      neighbours_[from][neighbours_[from][0] == no_edge ? 0 : 1] = to;
  }

  void add_cell(std::size_t col, std::size_t row) {
    const double mean = 0.25 * (value(col, row) + value(col + 1, row) + value(col, row + 1) + value(col + 1, row + 1));
    if (!std::isfinite(mean)) return;
    const std::size_t top = 2 * (row * cols_ + col), left = top + 1, right = top + 3, bottom = top + 2 * cols_;
    const std::array<bool, 4> above{is_above(col, row), is_above(col + 1, row), is_above(col + 1, row + 1),
                                    is_above(col, row + 1)};
    const std::array<std::size_t, 4> side_after{top, right, bottom, left};  // between corner i and i + 1
    std::array<std::size_t, 4> crossed{};
    std::size_t count = 0;
    for (std::size_t i = 0; i < 4; ++i)
      if (above[i] != above[(i + 1) % 4]) crossed[count++] = side_after[i];
    if (count == 2) join(crossed[0], crossed[1]);
    if (count != 4) return;
    // A saddle: the corner that disagrees with the mean is cut off.
    const bool cuts_first = above[0] != (mean >= level_);
    join(cuts_first ? left : top, cuts_first ? top : right);
    join(cuts_first ? right : bottom, cuts_first ? bottom : left);
  }

  [[nodiscard]] GridPoint point(std::size_t edge) const {
    const std::size_t at = edge / 2, col = at % cols_, row = at / cols_;
    const bool goes_down = edge % 2 == 1;
    const double a = value(col, row), b = goes_down ? value(col, row + 1) : value(col + 1, row);
    const double share = (level_ - a) / (b - a);
    return {static_cast<double>(col) + (goes_down ? 0.0 : share), static_cast<double>(row) + (goes_down ? share : 0.0)};
  }

  Contour follow(std::size_t start) {
    Contour contour;
    std::size_t edge = start, from = no_edge;
    while (edge != no_edge && !is_done_[edge]) {
      is_done_[edge] = true;
      contour.points.push_back(point(edge));
      const auto& next = neighbours_[edge];
      const std::size_t onward = next[0] == from ? next[1] : next[0];
      from = edge;
      edge = onward;
    }
    if (edge == start && contour.points.size() > 2) contour.points.push_back(contour.points.front());
    return contour;
  }

  std::size_t cols_, rows_;
  const std::vector<double>& values_;
  double level_;
  std::vector<std::array<std::size_t, 2>> neighbours_;
  std::vector<bool> is_done_;
};

}  // namespace

bool Contour::is_closed() const {
  return points.size() > 2 && points.front().col == points.back().col && points.front().row == points.back().row;
}

std::vector<Contour> trace_contours(int cols, int rows, const std::vector<double>& values, double level) {
  if (cols < 2 || rows < 2 || values.size() != static_cast<std::size_t>(cols) * static_cast<std::size_t>(rows))
    return {};
  return Tracer(cols, rows, values, level).trace();
}

}  // namespace alidade::report
