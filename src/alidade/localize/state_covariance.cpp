#include "alidade/localize/state_covariance.h"

#include <algorithm>
#include <cstring>

#include "alidade/geometry/vector_clones.h"

namespace alidade {
namespace {

constexpr int panel = StateCovariance::panel;
using Four = double __attribute__((vector_size(32)));

using FourInMemory = double __attribute__((vector_size(32), aligned(8), may_alias));

const FourInMemory& load(const double* from) { return *reinterpret_cast<const FourInMemory*>(from); }

/// P(i, j) −= Σ_k a_k[i] b_k[j] of a tile of 8 × 4, and of its mirror. a, b: 8 numbers for each k.
ALIDADE_VECTOR_CLONES void subtract_tile(const double* a, const double* b, int num, double* P, double* mirror,
                                         std::size_t stride) {
  Four low[4] = {}, high[4] = {};
  for (int k = 0; k < num; ++k, a += panel, b += panel) {
    const Four a_low = load(a), a_high = load(a + 4);
    for (int j = 0; j < 4; ++j) {
      const Four factor = {b[j], b[j], b[j], b[j]};
      low[j] += a_low * factor;
      high[j] += a_high * factor;
    }
  }
  double tile[4][panel];
  for (int j = 0; j < 4; ++j) {
    std::memcpy(tile[j], &low[j], sizeof low[j]);
    std::memcpy(tile[j] + 4, &high[j], sizeof high[j]);
    for (int i = 0; i < panel; ++i)
      tile[j][i] = P[static_cast<std::size_t>(j) * stride + static_cast<std::size_t>(i)] -= tile[j][i];
  }
  if (!mirror) return;
  for (int i = 0; i < panel; ++i)
    for (int j = 0; j < 4; ++j) mirror[static_cast<std::size_t>(i) * stride + static_cast<std::size_t>(j)] = tile[j][i];
}

/// column += K u + U k, three numbers each of u and k.
ALIDADE_VECTOR_CLONES void add_three(const double* K, const double* U, std::size_t stride, const double* u,
                                     const double* k, std::size_t num, double* column) {
  const double *K1 = K + stride, *K2 = K1 + stride, *U1 = U + stride, *U2 = U1 + stride;
  for (std::size_t i = 0; i < num; ++i)
    column[i] += K[i] * u[0] + K1[i] * u[1] + K2[i] * u[2] + U[i] * k[0] + U1[i] * k[1] + U2[i] * k[2];
}

/// x −= Σ_k w_k h_k for a panel: four columns of x at a time, whose factors of each k stand together.
ALIDADE_VECTOR_CLONES void subtract_products(const double* w, const double* h, int num, double* x) {
  Four low[4] = {}, high[4] = {};
  for (int k = 0; k < num; ++k, w += panel, h += 4) {
    const Four w_low = load(w), w_high = load(w + 4);
    for (int j = 0; j < 4; ++j) {
      const Four factor = {h[j], h[j], h[j], h[j]};
      low[j] += w_low * factor;
      high[j] += w_high * factor;
    }
  }
  for (int j = 0; j < 4; ++j)
    for (int i = 0; i < 4; ++i) {
      x[j * panel + i] -= low[j][i];
      x[j * panel + 4 + i] -= high[j][i];
    }
}

/// x0, x1 = P Hᵀ of one measurement: columns of P, weighted.
ALIDADE_VECTOR_CLONES void weigh_columns(const double* P, std::size_t stride, const int* columns, int num,
                                         const double* h0, const double* h1, int rows, double* x0, double* x1) {
  std::fill_n(x0, rows, 0.0);
  std::fill_n(x1, rows, 0.0);
  for (int c = 0; c < num; ++c) {
    const double* column = P + static_cast<std::size_t>(columns[c]) * stride;
    const double a = h0[c], b = h1[c];
    for (int i = 0; i < rows; ++i) {
      x0[i] += a * column[i];
      x1[i] += b * column[i];
    }
  }
}

/// The same for 8 rows.
ALIDADE_VECTOR_CLONES void weigh_panel(const double* P, std::size_t stride, const int* columns, int num,
                                       const double* h0, const double* h1, double* x) {
  Four x0_low = {}, x0_high = {}, x1_low = {}, x1_high = {};
  for (int c = 0; c < num; ++c) {
    const double* column = P + static_cast<std::size_t>(columns[c]) * stride;
    const Four low = load(column), high = load(column + 4);
    const Four a = {h0[c], h0[c], h0[c], h0[c]}, b = {h1[c], h1[c], h1[c], h1[c]};
    x0_low += low * a;
    x0_high += high * a;
    x1_low += low * b;
    x1_high += high * b;
  }
  std::memcpy(x, &x0_low, sizeof x0_low);
  std::memcpy(x + 4, &x0_high, sizeof x0_high);
  std::memcpy(x + panel, &x1_low, sizeof x1_low);
  std::memcpy(x + panel + 4, &x1_high, sizeof x1_high);
}

/// w = x M of a panel, M upper triangular, row-major.
ALIDADE_VECTOR_CLONES void times_triangle(const double* x, const double* M, int num, double* w) {
  for (int j = 0; j < num; ++j) {
    Four low = {}, high = {};
    for (int k = 0; k <= j; ++k) {
      const double m = M[k * num + j];
      const Four factor = {m, m, m, m};
      low += load(x + k * panel) * factor;
      high += load(x + k * panel + 4) * factor;
    }
    std::memcpy(w + j * panel, &low, sizeof low);
    std::memcpy(w + j * panel + 4, &high, sizeof high);
  }
}

int rounded_up(int count) { return (count + panel - 1) / panel * panel; }

}  // namespace

void StateCovariance::reserve(int state_capacity, int measured_capacity) {
  stride_ = rounded_up(state_capacity);
  pending_capacity_ = rounded_up(measured_capacity);
  P_.assign(stride() * stride(), 0.0);
  W_.assign(stride() * static_cast<std::size_t>(pending_capacity_), 0.0);
  X_.assign(stride() * max_columns, 0.0);
  shear_.assign(stride() * 3, 0.0);
  HW_.assign(static_cast<std::size_t>(pending_capacity_) * max_columns, 0.0);
  dim_ = pending_ = 0;
}

double StateCovariance::current(int i, int j) const {
  const auto place = [&](int row) {
    return W_.data() + static_cast<std::size_t>(row / panel * pending_capacity_ * panel + row % panel);
  };
  const double *a = place(i), *b = place(j);
  double value = at(i, j);
  for (int k = 0; k < pending_; ++k) value -= a[k * panel] * b[k * panel];
  return value;
}

bool StateCovariance::grow(int count) {
  if (dim_ + count > stride_) return false;
  for (int j = 0; j < dim_ + count; ++j) {
    for (int i = j < dim_ ? dim_ : 0; i < dim_ + count; ++i) at(i, j) = 0.0;
  }
  dim_ += count;
  return true;
}

void StateCovariance::remove(int offset, int count) {
  const auto tail = static_cast<std::size_t>(dim_ - offset - count);
  for (int j = 0; j < dim_; ++j) {
    double* column = &at(0, j);
    std::memmove(column + offset, column + offset + count, tail * sizeof(double));
  }
  for (int j = offset; j + count < dim_; ++j) std::memcpy(&at(0, j), &at(0, j + count), stride() * sizeof(double));
  dim_ -= count;
  const int padded = std::min(rounded_up(dim_ + count), stride_);
  for (int j = 0; j < padded; ++j)  // the last panel is read as a whole
    for (int i = j < dim_ ? dim_ : 0; i < padded; ++i) at(i, j) = 0.0;
}

void StateCovariance::product(const Rows& rows, double* x0, double* x1) const {
  weigh_columns(P_.data(), stride(), rows.columns.data(), static_cast<int>(rows.columns.size()), rows.h0, rows.h1, dim_,
                x0, x1);
}

void StateCovariance::products(std::span<const Rows> rows) {
  const int num = 2 * static_cast<int>(rows.size()), tiles = (num + 3) / 4;
  // H W, four measured numbers together, for each column of W.
  for (std::size_t m = 0; m < rows.size(); ++m) {
    for (int k = 0; k < pending_; ++k) {
      double sum0 = 0.0, sum1 = 0.0;
      for (std::size_t c = 0; c < rows[m].columns.size(); ++c) {
        const int row = rows[m].columns[c];
        const double w = W_[static_cast<std::size_t>((row / panel * pending_capacity_ + k) * panel + row % panel)];
        sum0 += rows[m].h0[c] * w;
        sum1 += rows[m].h1[c] * w;
      }
      double* place =
          &HW_[(m / 2 * static_cast<std::size_t>(pending_capacity_) + static_cast<std::size_t>(k)) * 4 + m % 2 * 2];
      place[0] = sum0;
      place[1] = sum1;
      if (m + 1 == rows.size() && m % 2 == 0) place[2] = place[3] = 0.0;
    }
  }
  for (int p = 0; p < num_panels(); ++p) {
    double* x = &X_[static_cast<std::size_t>(p * max_columns * panel)];
    for (std::size_t m = 0; m < rows.size(); ++m)
      weigh_panel(P_.data() + p * panel, stride(), rows[m].columns.data(), static_cast<int>(rows[m].columns.size()),
                  rows[m].h0, rows[m].h1, x + m * 2 * panel);
    const double* w = &W_[static_cast<std::size_t>(p * pending_capacity_ * panel)];
    for (int tile = 0; tile < tiles; ++tile)
      subtract_products(w, &HW_[static_cast<std::size_t>(tile * pending_capacity_ * 4)], pending_,
                        x + tile * 4 * panel);
  }
}

Eigen::Matrix2d StateCovariance::innovation_covariance(const Rows& rows) const {
  const std::size_t num = rows.columns.size();
  Eigen::Matrix2d S = Eigen::Matrix2d::Zero();
  for (std::size_t a = 0; a < num; ++a) {
    const double* column = &P_[static_cast<std::size_t>(rows.columns[a]) * stride()];
    double x0 = 0.0, x1 = 0.0;
    for (std::size_t b = 0; b < num; ++b) {
      x0 += rows.h0[b] * column[rows.columns[b]];
      x1 += rows.h1[b] * column[rows.columns[b]];
    }
    S(0, 0) += x0 * rows.h0[a];
    S(0, 1) += x0 * rows.h1[a];
    S(1, 1) += x1 * rows.h1[a];
  }
  for (int k = 0; k < pending_; ++k) {
    double w0 = 0.0, w1 = 0.0;
    for (std::size_t c = 0; c < num; ++c) {
      const int row = rows.columns[c];
      const double w = W_[static_cast<std::size_t>((row / panel * pending_capacity_ + k) * panel + row % panel)];
      w0 += rows.h0[c] * w;
      w1 += rows.h1[c] * w;
    }
    S(0, 0) -= w0 * w0;
    S(0, 1) -= w0 * w1;
    S(1, 1) -= w1 * w1;
  }
  S(1, 0) = S(0, 1);
  return S;
}

bool StateCovariance::append(std::span<const double> M, int num) {
  if (pending_ + num > pending_capacity_) return false;
  for (int p = 0; p < num_panels(); ++p)
    times_triangle(&X_[static_cast<std::size_t>(p * max_columns * panel)], M.data(), num,
                   &W_[static_cast<std::size_t>((p * pending_capacity_ + pending_) * panel)]);
  pending_ += num;
  return true;
}

bool StateCovariance::stays_positive() const {
  for (int i = 0; i < dim_; ++i)
    if (!(current(i, i) > 0.0)) return false;
  return true;
}

void StateCovariance::commit() {
  for (int q = 0; q < num_panels(); ++q) {
    for (int half = 0; half < 2; ++half) {
      const double* b = &W_[static_cast<std::size_t>(q * pending_capacity_ * panel + half * 4)];
      for (int p = q; p < num_panels(); ++p) {
        const double* a = &W_[static_cast<std::size_t>(p * pending_capacity_ * panel)];
        const int i = p * panel, j = q * panel + half * 4;
        subtract_tile(a, b, pending_, &at(i, j), p > q ? &at(j, i) : nullptr, stride());
      }
    }
  }
  pending_ = 0;
}

void StateCovariance::turn(const double* blocks, int single_at, int num_single) {
  const auto next = [&](int i) { return i + 3 == single_at ? i + 3 + num_single : i + 3; };
  const auto block_at = [&](int i, double(&M)[9]) {  // row by row
    for (std::size_t r = 0; r < 3; ++r)
      for (std::size_t c = 0; c < 3; ++c) M[3 * r + c] = blocks[c * stride() + static_cast<std::size_t>(i) + r];
  };
  double left[9], right[9], half[9];
  for (int j = 0; j < dim_; j = next(j)) {
    block_at(j, right);
    for (int i = j; i < dim_; i = next(i)) {
      block_at(i, left);
      for (int r = 0; r < 3; ++r)
        for (int c = 0; c < 3; ++c)
          half[3 * r + c] =
              left[3 * r] * at(i, j + c) + left[3 * r + 1] * at(i + 1, j + c) + left[3 * r + 2] * at(i + 2, j + c);
      for (int r = 0; r < 3; ++r)
        for (int c = 0; c < 3; ++c)
          at(i + r, j + c) = at(j + c, i + r) =
              half[3 * r] * right[3 * c] + half[3 * r + 1] * right[3 * c + 1] + half[3 * r + 2] * right[3 * c + 2];
    }
    for (int s = single_at; s < single_at + num_single; ++s) {
      const double x[3] = {at(j, s), at(j + 1, s), at(j + 2, s)};
      for (int r = 0; r < 3; ++r)
        at(j + r, s) = at(s, j + r) = right[3 * r] * x[0] + right[3 * r + 1] * x[1] + right[3 * r + 2] * x[2];
    }
  }
}

/// P + K Uᵀ + U Kᵀ, with U = P Eᵀ + ½ K (E P Eᵀ).
void StateCovariance::shear(int at, const double* K) {
  const auto num = static_cast<std::size_t>(dim_), first = static_cast<std::size_t>(at);
  double* const U = shear_.data();
  for (std::size_t c = 0; c < 3; ++c) {
    for (std::size_t i = 0; i < num; ++i) {
      double sum = P_[(first + c) * stride() + i];
      for (std::size_t d = 0; d < 3; ++d) sum += 0.5 * K[d * stride() + i] * P_[(first + c) * stride() + first + d];
      U[c * stride() + i] = sum;
    }
  }
  for (std::size_t j = 0; j < num; ++j) {
    const double u[3] = {U[j], U[stride() + j], U[2 * stride() + j]};
    const double k[3] = {K[j], K[stride() + j], K[2 * stride() + j]};
    add_three(K, U, stride(), u, k, num, &P_[j * stride()]);
  }
}

}  // namespace alidade
