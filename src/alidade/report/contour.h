#pragma once

#include <vector>

namespace alidade::report {

struct GridPoint {
  double col = 0.0, row = 0.0;
};

/// A connected piece of a level line, in grid coordinates (col, row); closed if it ends where it begins.
struct Contour {
  std::vector<GridPoint> points;
  [[nodiscard]] bool is_closed() const;
};

/// The lines where row-major `values` equal `level`, linear along the cell sides. Cells with a missing value have none.
/// Marching squares; saddles are resolved by the mean of the cell's corners.
[[nodiscard]] std::vector<Contour> trace_contours(int cols, int rows, const std::vector<double>& values, double level);

}  // namespace alidade::report
