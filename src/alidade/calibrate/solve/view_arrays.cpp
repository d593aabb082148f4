#include "alidade/calibrate/solve/view_arrays.h"

#include <cmath>

namespace alidade {

ViewArrays make_arrays(const BoardView& view) {
  ViewArrays arrays;
  const std::size_t n = view.corners.size();
  arrays.index.reserve(n);
  arrays.u_px.reserve(n);
  arrays.v_px.reserve(n);
  for (const Corner& corner : view.corners) {
    arrays.index.push_back(corner.index);
    arrays.u_px.push_back(corner.px.x());
    arrays.v_px.push_back(corner.px.y());
  }
  arrays.white_a.assign(n, 1.0);
  arrays.white_b.assign(n, 0.0);
  arrays.white_c.assign(n, 1.0);
  return arrays;
}

void set_whitener(ViewArrays& view, std::size_t i, const Eigen::Matrix2d& cov, double weight) {
  // Inverse of (p q; q s) is WᵀW with W = (a b; 0 c), c = 1/√s, a = √(s/det), b = −a q/s.
  const double p = cov(0, 0), q = 0.5 * (cov(0, 1) + cov(1, 0)), s = cov(1, 1);
  const double det = p * s - q * q, root = std::sqrt(weight);
  const double a = std::sqrt(s / det);
  view.white_a[i] = root * a;
  view.white_b[i] = -root * a * q / s;
  view.white_c[i] = root / std::sqrt(s);
}

}  // namespace alidade
