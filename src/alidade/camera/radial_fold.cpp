#include "alidade/camera/radial_fold.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <limits>

namespace alidade::detail {
namespace {

/// A few numbers without the heap: this runs for every batch of pixels.
class Numbers {
 public:
  void push_back(double value) { values_[count_++] = value; }
  void pop_back() { --count_; }
  [[nodiscard]] std::size_t size() const { return count_; }
  [[nodiscard]] bool empty() const { return count_ == 0; }
  [[nodiscard]] double operator[](std::size_t i) const { return values_[i]; }
  [[nodiscard]] double front() const { return values_[0]; }
  [[nodiscard]] double back() const { return values_[count_ - 1]; }
  [[nodiscard]] double* begin() { return values_.data(); }
  [[nodiscard]] double* end() { return values_.data() + count_; }
  [[nodiscard]] const double* begin() const { return values_.data(); }
  [[nodiscard]] const double* end() const { return values_.data() + count_; }

 private:
  std::array<double, 8> values_{};
  std::size_t count_ = 0;
};

/// Coefficients from the constant term upwards.
using Polynomial = Numbers;

double value(const Polynomial& p, double t) {
  double sum = 0.0;
  for (std::size_t i = p.size(); i-- > 0;) sum = sum * t + p[i];
  return sum;
}

Polynomial derivative(const Polynomial& p) {
  Polynomial d;
  for (std::size_t i = 1; i < p.size(); ++i) d.push_back(static_cast<double>(i) * p[i]);
  return d;
}

/// The root of p in [low, high], where p is monotone and changes its sign. Newton kept inside a shrinking bracket.
double bracketed_root(const Polynomial& p, double low, double high) {
  const Polynomial slope = derivative(p);
  const bool rises = value(p, low) < value(p, high);
  double t = 0.5 * (low + high);
  for (int i = 0; i < 200; ++i) {  // bisection alone needs at most 60 or so down to the last bit
    const double f = value(p, t);
    if (f == 0.0) return t;
    ((f > 0.0) == rises ? high : low) = t;
    double next = t - f / value(slope, t);
    if (!(next > low && next < high)) next = 0.5 * (low + high);
    if (std::abs(next - t) <= 1e-16 * t || next == low || next == high) return next;
    t = next;
  }
  return t;
}

/// All sign changes of p in (0, 1), ascending: between the roots of its derivative it is monotone.
Numbers roots_in_unit_interval(const Polynomial& p) {
  if (p.size() < 2) return {};
  Numbers turns = roots_in_unit_interval(derivative(p));
  turns.push_back(1.0);
  Numbers roots;
  double low = 0.0;
  for (const double high : turns) {
    const double at_low = value(p, low), at_high = value(p, high);
    if (at_high == 0.0) {
      roots.push_back(high);
    } else if (at_low * at_high < 0.0 || (at_low < 0.0) != (at_high < 0.0)) {
      if (at_low != 0.0) roots.push_back(bracketed_root(p, low, high));
    }
    low = high;
  }
  return roots;
}

}  // namespace

double first_root(std::span<const double> c) {
  Polynomial p;
  p.push_back(1.0);
  for (const double coefficient : c) {
    if (!(std::abs(coefficient) < 1e100)) return 0.0;  // beyond: overflow, and no lens
    p.push_back(coefficient);
  }
  while (p.back() == 0.0) p.pop_back();
  const Numbers near = roots_in_unit_interval(p);
  if (!near.empty()) return near.front();
  // Beyond 1: the largest root in s = 1/t of the polynomial with its coefficients reversed.
  std::reverse(p.begin(), p.end());
  const Numbers far = roots_in_unit_interval(p);
  return far.empty() || far.back() <= 0.0 ? std::numeric_limits<double>::infinity() : 1.0 / far.back();
}

}  // namespace alidade::detail
