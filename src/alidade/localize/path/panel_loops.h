#pragma once

#include <algorithm>
#include <cstddef>

#include "alidade/localize/filter/state_covariance.h"

// The inner loops of state_covariance.h and pose_chain.h, for matrices that stand column by column, `stride` apart, and
// for panels: eight rows together, column by column.

namespace alidade::panel_loops {

constexpr int panel = StateCovariance::panel, max_support = StateCovariance::max_support;

/// Two rows H, whose numbers that are not zero stand in few panels of W.
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

/// P(i, j) −= Σ_k a_k[i] b_k[j] of a tile of 8 × 4, and of its mirror. a, b: 8 numbers for each k.
void subtract_tile(const double* a, const double* b, int num, double* P, double* mirror, std::size_t stride);
/// Eight rows and four columns, written as rows where `mirror` stands.
void mirror_tile(const double* tile, double* mirror, std::size_t stride);
/// Three columns by a 3 × 3 block from the right, transposed; `block` has its columns `stride` apart.
void combine_columns(const double* block, std::size_t stride, double* columns, std::size_t num);
/// The rows from `first` to `end` of a column, each three by their block from the left.
void turn_rows(const double* blocks, std::size_t stride, double* column, int first, int end);
/// column += K u + U k, three components each of u and k.
void add_three(const double* K, const double* U, std::size_t stride, const double* u, const double* k, std::size_t num,
               double* column);
/// x −= Σ_k w_k h_k for a panel: four columns of x at a time, whose factors of each k stand together.
void subtract_products(const double* w, const double* h, int num, double* x);
/// x0, x1 = P Hᵀ of one measurement: columns of P, weighted, for 8 rows.
void weigh_panel(const double* P, std::size_t stride, const int* columns, int num, const double* h0, const double* h1,
                 double* x);
/// S −= H W Wᵀ Hᵀ.
void subtract_squares(const PanelWeights& weights, int num_columns, double& s00, double& s01, double& s11);
/// B(i, j) −= Σ_k a_k[i] b_k[j] of `dim` rows and columns, on and below the diagonal; of tiles on it all is written.
/// a, b: `num` columns in panels, zero beyond `dim`.
void subtract_lower(const double* a, const double* b, int num, int dim, double* B, std::size_t stride);
/// w = x M of a panel, M upper triangular, row-major.
void times_triangle(const double* x, const double* M, int num, double* w);

}  // namespace alidade::panel_loops
