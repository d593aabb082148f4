#include "alidade/localize/path/panel_loops.h"

#include "alidade/geometry/vector_clones.h"

namespace alidade::panel_loops {
namespace {

using Four = double __attribute__((vector_size(32)));

/// Four doubles in memory with the alignment of a double.
struct [[gnu::packed, gnu::aligned(8), gnu::may_alias]] InMemory {
  Four four;
};

const InMemory& at(const double* from) { return *reinterpret_cast<const InMemory*>(from); }
void store(const Four& four, double* to) { reinterpret_cast<InMemory*>(to)->four = four; }

/// Eight rows and four columns. Filled entry by entry: g++ 12 clears an array slowly, in memory.
struct Tile {
  Four low[4], high[4];
  Tile() {
    for (int j = 0; j < 4; ++j) low[j] = high[j] = Four{0.0, 0.0, 0.0, 0.0};
  }
};

/// Transposes a 4 × 4 block given by its columns.
void transpose(Four (&block)[4]) {
  const Four a = __builtin_shufflevector(block[0], block[1], 0, 4, 2, 6),
             b = __builtin_shufflevector(block[0], block[1], 1, 5, 3, 7),
             c = __builtin_shufflevector(block[2], block[3], 0, 4, 2, 6),
             d = __builtin_shufflevector(block[2], block[3], 1, 5, 3, 7);
  block[0] = __builtin_shufflevector(a, c, 0, 1, 4, 5);
  block[1] = __builtin_shufflevector(b, d, 0, 1, 4, 5);
  block[2] = __builtin_shufflevector(a, c, 2, 3, 6, 7);
  block[3] = __builtin_shufflevector(b, d, 2, 3, 6, 7);
}

ALIDADE_VECTOR_CLONES void loop_subtract_tile(const double* a, const double* b, int num, double* P, double* mirror,
                                              std::size_t stride) {
  Tile tile;
  for (int k = 0; k < num; ++k, a += panel, b += panel) {
    const Four a_low = at(a).four, a_high = at(a + 4).four;
    for (int j = 0; j < 4; ++j) {
      const Four factor = {b[j], b[j], b[j], b[j]};
      tile.low[j] += a_low * factor;
      tile.high[j] += a_high * factor;
    }
  }
  for (std::size_t j = 0; j < 4; ++j) {
    double* column = P + j * stride;
    store(tile.low[j] = at(column).four - tile.low[j], column);
    store(tile.high[j] = at(column + 4).four - tile.high[j], column + 4);
  }
  if (!mirror) return;
  transpose(tile.low);
  transpose(tile.high);
  for (std::size_t i = 0; i < 4; ++i) {
    store(tile.low[i], mirror + i * stride);
    store(tile.high[i], mirror + (i + 4) * stride);
  }
}

/// Subtracts from a tile of a matrix with that many rows and columns left from there on.
void subtract(const Tile& tile, double* from, std::size_t stride, int rows_left, int columns_left) {
  for (int j = 0; j < std::min(4, columns_left); ++j, from += stride) {
    if (rows_left >= panel) {
      store(at(from).four - tile.low[j], from);
      store(at(from + 4).four - tile.high[j], from + 4);
      continue;
    }
    for (int i = 0; i < rows_left; ++i) from[i] -= i < 4 ? tile.low[j][i] : tile.high[j][i - 4];
  }
}

ALIDADE_VECTOR_CLONES void loop_subtract_lower(const double* a, const double* b, int num, int dim, double* B,
                                               std::size_t stride) {
  for (int column = 0; column < dim; column += 4) {
    for (int row = column / panel * panel; row < dim; row += panel) {
      const double *rows = a + row * num, *factors = b + column / panel * panel * num + column % panel;
      Tile tile;
      for (int k = 0; k < num; ++k, rows += panel, factors += panel) {
        const Four low = at(rows).four, high = at(rows + 4).four;
        for (int j = 0; j < 4; ++j) {
          const Four factor = {factors[j], factors[j], factors[j], factors[j]};
          tile.low[j] += low * factor;
          tile.high[j] += high * factor;
        }
      }
      subtract(tile, B + static_cast<std::size_t>(column) * stride + row, stride, dim - row, dim - column);
    }
  }
}

ALIDADE_VECTOR_CLONES void loop_combine_columns(const double* block, std::size_t stride, double* columns,
                                                std::size_t num) {
  const double *b0 = block, *b1 = block + stride, *b2 = b1 + stride;
  double *x0 = columns, *x1 = columns + stride, *x2 = x1 + stride;
  for (std::size_t i = 0; i < num; ++i) {
    const double a0 = x0[i], a1 = x1[i], a2 = x2[i];
    x0[i] = a0 * b0[0] + a1 * b1[0] + a2 * b2[0];
    x1[i] = a0 * b0[1] + a1 * b1[1] + a2 * b2[1];
    x2[i] = a0 * b0[2] + a1 * b1[2] + a2 * b2[2];
  }
}

ALIDADE_VECTOR_CLONES void loop_turn_rows(const double* blocks, std::size_t stride, double* column, int first,
                                          int end) {
  const double *b0 = blocks, *b1 = blocks + stride, *b2 = b1 + stride;
  for (int i = first; i < end; i += 3) {
    const double a0 = column[i], a1 = column[i + 1], a2 = column[i + 2];
    for (int r = i; r < i + 3; ++r) column[r] = a0 * b0[r] + a1 * b1[r] + a2 * b2[r];
  }
}

ALIDADE_VECTOR_CLONES void loop_add_three(const double* K, const double* U, std::size_t stride, const double* u,
                                          const double* k, std::size_t num, double* column) {
  const double *K1 = K + stride, *K2 = K1 + stride, *U1 = U + stride, *U2 = U1 + stride;
  for (std::size_t i = 0; i < num; ++i)
    column[i] += K[i] * u[0] + K1[i] * u[1] + K2[i] * u[2] + U[i] * k[0] + U1[i] * k[1] + U2[i] * k[2];
}

ALIDADE_VECTOR_CLONES void loop_subtract_products(const double* w, const double* h, int num, double* x) {
  Tile tile;
  for (int k = 0; k < num; ++k, w += panel, h += 4) {
    const Four w_low = at(w).four, w_high = at(w + 4).four;
    for (int j = 0; j < 4; ++j) {
      const Four factor = {h[j], h[j], h[j], h[j]};
      tile.low[j] += w_low * factor;
      tile.high[j] += w_high * factor;
    }
  }
  for (int j = 0; j < 4; ++j, x += panel) {
    store(at(x).four - tile.low[j], x);
    store(at(x + 4).four - tile.high[j], x + 4);
  }
}

ALIDADE_VECTOR_CLONES void loop_weigh_panel(const double* P, std::size_t stride, const int* columns, int num,
                                            const double* h0, const double* h1, double* x) {
  Four x0_low = {}, x0_high = {}, x1_low = {}, x1_high = {};
  for (int c = 0; c < num; ++c) {
    const double* column = P + static_cast<std::size_t>(columns[c]) * stride;
    const Four low = at(column).four, high = at(column + 4).four;
    const Four a = {h0[c], h0[c], h0[c], h0[c]}, b = {h1[c], h1[c], h1[c], h1[c]};
    x0_low += low * a;
    x0_high += high * a;
    x1_low += low * b;
    x1_high += high * b;
  }
  store(x0_low, x);
  store(x0_high, x + 4);
  store(x1_low, x + panel);
  store(x1_high, x + panel + 4);
}

ALIDADE_VECTOR_CLONES void loop_subtract_squares(const PanelWeights& weights, int num_columns, double& s00, double& s01,
                                                 double& s11) {
  for (int k = 0; k < num_columns; ++k) {
    Four sum0 = {0.0, 0.0, 0.0, 0.0}, sum1 = {0.0, 0.0, 0.0, 0.0};
    for (int p = 0; p < weights.num; ++p) {
      const double* w = weights.panels[p] + k * panel;
      const Four low = at(w).four, high = at(w + 4).four;
      sum0 += low * at(weights.h0[p]).four + high * at(weights.h0[p] + 4).four;
      sum1 += low * at(weights.h1[p]).four + high * at(weights.h1[p] + 4).four;
    }
    const double w0 = sum0[0] + sum0[1] + (sum0[2] + sum0[3]), w1 = sum1[0] + sum1[1] + (sum1[2] + sum1[3]);
    s00 -= w0 * w0;
    s01 -= w0 * w1;
    s11 -= w1 * w1;
  }
}

ALIDADE_VECTOR_CLONES void loop_times_triangle(const double* x, const double* M, int num, double* w) {
  for (int j = 0; j < num; ++j) {
    Four low = {}, high = {};
    for (int k = 0; k <= j; ++k) {
      const double m = M[k * num + j];
      const Four factor = {m, m, m, m};
      low += at(x + k * panel).four * factor;
      high += at(x + k * panel + 4).four * factor;
    }
    store(low, w + j * panel);
    store(high, w + j * panel + 4);
  }
}

}  // namespace

void mirror_tile(const double* tile, double* mirror, std::size_t stride) {
  for (std::size_t half = 0; half < 2; ++half) {
    Four block[4];
    for (std::size_t j = 0; j < 4; ++j) block[j] = at(tile + half * 4 + j * stride).four;
    transpose(block);
    for (std::size_t i = 0; i < 4; ++i) store(block[i], mirror + (half * 4 + i) * stride);
  }
}

// The entry points for other files (for the reason see vector_clones.h).

void subtract_tile(const double* a, const double* b, int num, double* P, double* mirror, std::size_t stride) {
  loop_subtract_tile(a, b, num, P, mirror, stride);
}
void subtract_lower(const double* a, const double* b, int num, int dim, double* B, std::size_t stride) {
  loop_subtract_lower(a, b, num, dim, B, stride);
}
void combine_columns(const double* block, std::size_t stride, double* columns, std::size_t num) {
  loop_combine_columns(block, stride, columns, num);
}
void turn_rows(const double* blocks, std::size_t stride, double* column, int first, int end) {
  loop_turn_rows(blocks, stride, column, first, end);
}
void add_three(const double* K, const double* U, std::size_t stride, const double* u, const double* k, std::size_t num,
               double* column) {
  loop_add_three(K, U, stride, u, k, num, column);
}
void subtract_products(const double* w, const double* h, int num, double* x) { loop_subtract_products(w, h, num, x); }
void weigh_panel(const double* P, std::size_t stride, const int* columns, int num, const double* h0, const double* h1,
                 double* x) {
  loop_weigh_panel(P, stride, columns, num, h0, h1, x);
}
void subtract_squares(const PanelWeights& weights, int num_columns, double& s00, double& s01, double& s11) {
  loop_subtract_squares(weights, num_columns, s00, s01, s11);
}
void times_triangle(const double* x, const double* M, int num, double* w) { loop_times_triangle(x, M, num, w); }

}  // namespace alidade::panel_loops
