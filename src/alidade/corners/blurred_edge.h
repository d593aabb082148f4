#pragma once

#include <cstring>

namespace alidade {

/// A vector of floats; the compiler turns their arithmetic into vector instructions of any target.
using Float4 [[gnu::vector_size(16)]] = float;
using Float8 [[gnu::vector_size(32)]] = float;
template <class Floats>
using IntsOf = decltype(Floats{} < Floats{});

// The following functions are inlined, so that they are compiled for the same processor as their caller.

/// 2ˣ for -126 ≤ x ≤ 0, relative error < 2e-7 (Taylor of degree 6 on [-½, ½]).
template <class Floats>
[[gnu::always_inline]] inline void exp2_of_negative(const Floats& x, Floats& result) {
  const auto whole = __builtin_convertvector(x - 0.5f, IntsOf<Floats>);  // conversion cuts towards zero
  const Floats f = x - __builtin_convertvector(whole, Floats);
  const Floats mantissa =
      1.0f +
      f * (0.693147181f + f * (0.240226507f + f * (0.0555041087f +
                                                   f * (0.00961812911f + f * (0.00133335581f + f * 0.000154035304f)))));
  const IntsOf<Floats> bits = (whole + 127) << 23;
  Floats power;
  std::memcpy(&power, &bits, sizeof power);
  result = power * mantissa;
}

/// erf(z) and exp(-z²), the profile of the edge and its slope; erf to 2e-7.
/// Abramowitz & Stegun, "Handbook of Mathematical Functions", 1964, 7.1.26.
template <class Floats>
struct EdgeProfile {
  Floats step, bell;
};
template <class Floats>
[[nodiscard, gnu::always_inline]] inline EdgeProfile<Floats> edge_profile(const Floats& z) {
  const Floats a = z < 0.0f ? -z : z;
  const Floats power = a * a * -1.44269504f;
  // Further out the bell is zero beside a float's 1e-7; smaller powers would make slow denormal products.
  const Floats lowest = Floats{} - 40.0f;
  Floats bell;
  exp2_of_negative<Floats>(power < lowest ? lowest : power, bell);
  const Floats t = 1.0f / (1.0f + 0.3275911f * a);
  const Floats tail =
      bell * t * (0.254829592f + t * (-0.284496736f + t * (1.421413741f + t * (-1.453152027f + t * 1.061405429f))));
  return {z < 0.0f ? tail - 1.0f : 1.0f - tail, bell};
}

}  // namespace alidade
