#pragma once

#include <algorithm>
#include <cstddef>

#include "alidade/localize/filter/state_covariance.h"

// The inner loops of state_covariance.h and pose_chain.h, for column-major matrices with column stride `stride`, and
// for panels: blocks of eight rows, column-major.

namespace alidade::panel_loops {

constexpr int panel = StateCovariance::panel, max_support = StateCovariance::max_support;

/// Two rows H, whose non-zero entries lie in few panels of W.
struct PanelWeights {
  const double* panels[max_support];
  double h0[max_support][panel], h1[max_support][panel];
  int num = 0;

  void add(const double* first_of_panel, int row, double weight0, double weight1) {
    int at = num - 1;
    while (at >= 0 && panels[at] != first_of_panel) --at;
    if (at < 0) {
      at = num++;
      panels[at] = first_of_panel;
      std::fill_n(h0[at], panel, 0.0);
      std::fill_n(h1[at], panel, 0.0);
    }
    h0[at][row] = weight0;
    h1[at][row] = weight1;
  }
};

/// P(i, j) −= Σ_k a_k[i] b_k[j] for a tile of 8 × 4, and its mirror image. a, b: 8 values for each k.
void subtract_tile(const double* a, const double* b, int num, double* P, double* mirror, std::size_t stride);
/// Transposes a tile of eight rows and four columns to `mirror`.
void mirror_tile(const double* tile, double* mirror, std::size_t stride);
/// Multiplies three columns from the right by a transposed 3 × 3 block; the columns of `block` are `stride` apart.
void combine_columns(const double* block, std::size_t stride, double* columns, std::size_t num);
/// Multiplies the rows from `first` to `end` of a column, three at a time, from the left by their blocks.
void turn_rows(const double* blocks, std::size_t stride, double* column, int first, int end);
/// column += K u + U k, three components each of u and k.
void add_three(const double* K, const double* U, std::size_t stride, const double* u, const double* k, std::size_t num,
               double* column);
/// x −= Σ_k w_k h_k for a panel: four columns of x at a time, whose factors h_k are contiguous.
void subtract_products(const double* w, const double* h, int num, double* x);
/// x0, x1 = P Hᵀ for one measurement: weighted sums of columns of P, for 8 rows.
void weigh_panel(const double* P, std::size_t stride, const int* columns, int num, const double* h0, const double* h1,
                 double* x);
/// S −= H W Wᵀ Hᵀ.
void subtract_squares(const PanelWeights& weights, int num_columns, double& s00, double& s01, double& s11);
/// B(i, j) −= Σ_k a_k[i] b_k[j] for `dim` rows and columns, on and below the diagonal; tiles on the diagonal are
/// written completely. a, b: `num` columns in panels, zero beyond `dim`.
void subtract_lower(const double* a, const double* b, int num, int dim, double* B, std::size_t stride);
/// w = x M for a panel, M upper triangular, row-major.
void times_triangle(const double* x, const double* M, int num, double* w);

}  // namespace alidade::panel_loops
