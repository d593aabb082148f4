#include "alidade/localize/filter/state_covariance.h"

#include <Eigen/Core>
#include <algorithm>
#include <array>
#include <cstring>
#include <utility>

#include "alidade/localize/path/panel_loops.h"

namespace alidade {

using namespace panel_loops;

namespace {

int rounded_up(int count) { return (count + panel - 1) / panel * panel; }

}  // namespace

void StateCovariance::reserve(int state_capacity, int measured_capacity) {
  stride_ = rounded_up(state_capacity);
  pending_capacity_ = rounded_up(measured_capacity);
  const std::size_t num_W = stride() * static_cast<std::size_t>(pending_capacity_);
  P_ = std::make_unique_for_overwrite<double[]>(stride() * stride());
  W_ = std::make_unique_for_overwrite<double[]>(num_W);
  W_aside_ = std::make_unique_for_overwrite<double[]>(num_W);
  X_.assign(stride() * max_columns, 0.0);
  shear_.assign(stride() * 3, 0.0);
  HW_.assign(static_cast<std::size_t>(pending_capacity_) * max_columns, 0.0);
  dim_ = pending_ = pending_aside_ = 0;
}

/// Copies all but the change set aside, which belongs to an unfinished update.
StateCovariance& StateCovariance::operator=(const StateCovariance& other) {
  if (this == &other) return *this;
  if (stride_ != other.stride_ || pending_capacity_ != other.pending_capacity_)
    reserve(other.stride_, other.pending_capacity_);
  dim_ = other.dim_;
  pending_ = other.pending_;
  pending_aside_ = 0;
  const auto padded = static_cast<std::size_t>(num_panels() * panel);
  for (std::size_t at = 0; at < padded * stride(); at += stride()) std::copy_n(&other.P_[at], padded, &P_[at]);
  for (int p = 0; p < num_panels(); ++p) {
    const auto at = static_cast<std::size_t>(p * pending_capacity_ * panel);
    std::copy_n(&other.W_[at], pending_ * panel, &W_[at]);
  }
  return *this;
}

double StateCovariance::current(int i, int j) const {
  const auto place = [&](int row) {
    return W_.get() + static_cast<std::size_t>(row / panel * pending_capacity_ * panel + row % panel);
  };
  const double *a = place(i), *b = place(j);
  double value = at(i, j);
  for (int k = 0; k < pending_; ++k) value -= a[k * panel] * b[k * panel];
  return value;
}

bool StateCovariance::grow(int count) {
  if (dim_ + count > stride_) return false;
  const int padded = rounded_up(dim_ + count);
  for (int j = 0; j < padded; ++j) {
    for (int i = j < dim_ ? dim_ : 0; i < padded; ++i) at(i, j) = 0.0;
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
  for (int j = 0; j < padded; ++j)  // the last panel is always read as a whole
    for (int i = j < dim_ ? dim_ : 0; i < padded; ++i) at(i, j) = 0.0;
}

void StateCovariance::product(const Rows& rows, double* x0, double* x1) const {
  std::array<double, 2 * panel> x{};
  for (int at = 0; at < dim_; at += panel) {
    weigh_panel(P_.get() + at, stride(), rows.columns.data(), static_cast<int>(rows.columns.size()), rows.h0, rows.h1,
                x.data());
    std::copy_n(x.data(), panel, x0 + at);
    std::copy_n(x.data() + panel, panel, x1 + at);
  }
}

void StateCovariance::products(std::span<const Rows> rows) {
  const int num = 2 * static_cast<int>(rows.size()), tiles = (num + 3) / 4;
  // H W, four measured components at a time, for each column of W.
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
      weigh_panel(P_.get() + p * panel, stride(), rows[m].columns.data(), static_cast<int>(rows[m].columns.size()),
                  rows[m].h0, rows[m].h1, x + m * 2 * panel);
    const double* w = &W_[static_cast<std::size_t>(p * pending_capacity_ * panel)];
    for (int tile = 0; tile < tiles; ++tile)
      subtract_products(w, &HW_[static_cast<std::size_t>(tile * pending_capacity_ * 4)], pending_,
                        x + tile * 4 * panel);
  }
}

Eigen::Matrix2d StateCovariance::innovation_covariance(const Rows& rows) const {
  double s00 = 0.0, s01 = 0.0, s11 = 0.0;
  for (std::size_t a = 0; a < rows.columns.size(); ++a) {
    const double* column = &P_[static_cast<std::size_t>(rows.columns[a]) * stride()];
    const double h0 = rows.h0[a], h1 = rows.h1[a], own = column[rows.columns[a]];
    double x0 = 0.5 * own * h0, x1 = 0.5 * own * h1;  // H P Hᵀ is twice the part below the diagonal
    for (std::size_t b = 0; b < a; ++b) {
      x0 += rows.h0[b] * column[rows.columns[b]];
      x1 += rows.h1[b] * column[rows.columns[b]];
    }
    s00 += 2.0 * x0 * h0;
    s01 += x0 * h1 + x1 * h0;
    s11 += 2.0 * x1 * h1;
  }
  PanelWeights weights;
  for (std::size_t c = 0; c < rows.columns.size(); ++c) {
    const int row = rows.columns[c];
    weights.add(&W_[static_cast<std::size_t>(row / panel * pending_capacity_ * panel)], row % panel, rows.h0[c],
                rows.h1[c]);
  }
  subtract_squares(weights, pending_, s00, s01, s11);
  return (Eigen::Matrix2d() << s00, s01, s01, s11).finished();
}

bool StateCovariance::append(std::span<const double> M, int num) {
  if (pending_ + num > pending_capacity_) return false;
  for (int p = 0; p < num_panels(); ++p)
    times_triangle(&X_[static_cast<std::size_t>(p * max_columns * panel)], M.data(), num,
                   &W_[static_cast<std::size_t>((p * pending_capacity_ + pending_) * panel)]);
  pending_ += num;
  return true;
}

void StateCovariance::swap_pending() {
  W_.swap(W_aside_);
  std::swap(pending_, pending_aside_);
}

bool StateCovariance::stays_positive() const {
  for (int i = 0; i < dim_; ++i)
    if (!(current(i, i) > 0.0)) return false;
  return true;
}

void StateCovariance::commit() {
  constexpr int together = 4;  // panels that stay in the L1 cache while all others stream past
  for (int first = 0; first < num_panels(); first += together) {
    const int end = std::min(first + together, num_panels());
    for (int p = first; p < num_panels(); ++p) {
      const double* a = &W_[static_cast<std::size_t>(p * pending_capacity_ * panel)];
      for (int q = first; q < std::min(end, p + 1); ++q) {
        for (int half = 0; half < 2; ++half) {
          const double* b = &W_[static_cast<std::size_t>(q * pending_capacity_ * panel + half * 4)];
          const int i = p * panel, j = q * panel + half * 4;
          subtract_tile(a, b, pending_, &at(i, j), p > q ? &at(j, i) : nullptr, stride());
        }
      }
    }
  }
  pending_ = 0;
}

/// Computes the lower triangle and mirrors it: writing rows of a column-major matrix is slow.
void StateCovariance::turn(const double* blocks, int single_at, int num_single) {
  const auto is_single = [&](int i) { return i >= single_at && i < single_at + num_single; };
  for (int j = 0; j < dim_; j += is_single(j) ? 1 : 3) {
    double* column = &at(j, j);
    if (is_single(j)) {
      turn_rows(blocks + j, stride(), column, single_at + num_single - j, dim_ - j);
      continue;
    }
    const int lens = j < single_at ? single_at - j : dim_ - j, after = std::min(lens + num_single, dim_ - j);
    combine_columns(blocks + j, stride(), column, static_cast<std::size_t>(dim_ - j));
    for (int c = 0; c < 3; ++c, column += stride()) {
      turn_rows(blocks + j, stride(), column, 0, lens);
      turn_rows(blocks + j, stride(), column, after, dim_ - j);
    }
  }
  mirror_lower();
}

void StateCovariance::mirror_lower() {
  for (int q = 0; q < num_panels(); ++q) {
    const int first = q * panel, end = std::min(first + panel, dim_);
    for (int j = first; j < end; ++j)
      for (int i = j + 1; i < end; ++i) at(j, i) = at(i, j);
    for (int p = q + 1; p < num_panels(); ++p)
      for (int j = 0; j < panel; j += 4) mirror_tile(&at(p * panel, first + j), &at(first + j, p * panel), stride());
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

/// P + u wᵀ + w uᵀ, with w = P Eᵀ + ½ u (E P Eᵀ).
void StateCovariance::shear_along(int at, const double* u) {
  const Eigen::Map<const Eigen::VectorXd> along(u, dim_), read(column(at), dim_);
  Eigen::Map<Eigen::VectorXd> w(shear_.data(), dim_);
  w = read + 0.5 * read[at] * along;
  for (int j = 0; j < dim_; ++j) {
    Eigen::Map<Eigen::VectorXd> column(&this->at(0, j), dim_);
    column += w[j] * along + along[j] * w;
  }
}

}  // namespace alidade
