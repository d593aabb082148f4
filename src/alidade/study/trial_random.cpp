#include "alidade/study/trial_random.h"

#include <cmath>

namespace alidade {
namespace {

constexpr std::uint64_t seed_block = ~std::uint64_t{0};  // no trial draws so many numbers

/// Steele, Lea & Flood, "Fast splittable pseudorandom number generators", OOPSLA 2014: SplitMix64's mixing.
std::uint64_t mixed(std::uint64_t z) {
  z = (z ^ (z >> 30U)) * 0xbf58476d1ce4e5b9U;
  z = (z ^ (z >> 27U)) * 0x94d049bb133111ebU;
  return z ^ (z >> 31U);
}

struct Ziggurat {
  static constexpr int layers = 128;
  static constexpr double edge = 3.442619855899, area = 9.91256303526217e-3;
  std::array<double, layers + 1> x;
  std::array<double, layers> ratio;

  Ziggurat() {
    double f = std::exp(-0.5 * edge * edge);
    x[0] = area / f;
    x[1] = edge;
    x[layers] = 0.0;
    for (std::size_t i = 2; i < layers; ++i) {
      x[i] = std::sqrt(-2.0 * std::log(area / x[i - 1] + f));
      f = std::exp(-0.5 * x[i] * x[i]);
    }
    for (std::size_t i = 0; i < layers; ++i) ratio[i] = x[i + 1] / x[i];
  }
};

const Ziggurat ziggurat;

struct Layer {
  double u;
  std::size_t i;
};

Layer layer_of(std::uint64_t bits) {
  return {static_cast<double>(bits >> 11U) * 0x1p-52 - 1.0, static_cast<std::size_t>(bits & 127U)};
}

}  // namespace

std::array<std::uint32_t, 4> philox(std::array<std::uint32_t, 4> c, std::array<std::uint32_t, 2> k) {
  for (int round = 0; round < 10; ++round) {
    const std::uint64_t a = std::uint64_t{0xD2511F53U} * c[0], b = std::uint64_t{0xCD9E8D57U} * c[2];
    c = {static_cast<std::uint32_t>(b >> 32U) ^ c[1] ^ k[0], static_cast<std::uint32_t>(b),
         static_cast<std::uint32_t>(a >> 32U) ^ c[3] ^ k[1], static_cast<std::uint32_t>(a)};
    k[0] += 0x9E3779B9U;
    k[1] += 0xBB67AE85U;
  }
  return c;
}

TrialRandom::TrialRandom(std::uint64_t seed, std::string_view study, std::uint64_t trial) : trial_(trial) {
  std::uint64_t key = mixed(seed + 0x9e3779b97f4a7c15U);
  for (const char letter : study) key = mixed(key ^ static_cast<unsigned char>(letter));
  key_ = {static_cast<std::uint32_t>(key), static_cast<std::uint32_t>(key >> 32U)};
}

std::uint64_t TrialRandom::seed() const {
  const auto words = philox({static_cast<std::uint32_t>(seed_block), static_cast<std::uint32_t>(seed_block >> 32U),
                             static_cast<std::uint32_t>(trial_), static_cast<std::uint32_t>(trial_ >> 32U)},
                            key_);
  return (std::uint64_t{words[1]} << 32U) | words[0];
}

std::uint64_t TrialRandom::bits() {
  if (has_spare_) {
    has_spare_ = false;
    return spare_;
  }
  const auto words = philox({static_cast<std::uint32_t>(count_), static_cast<std::uint32_t>(count_ >> 32U),
                             static_cast<std::uint32_t>(trial_), static_cast<std::uint32_t>(trial_ >> 32U)},
                            key_);
  ++count_;
  spare_ = (std::uint64_t{words[3]} << 32U) | words[2];
  has_spare_ = true;
  return (std::uint64_t{words[1]} << 32U) | words[0];
}

double TrialRandom::normal() {
  while (true) {
    const auto [u, i] = layer_of(bits());
    if (std::abs(u) < ziggurat.ratio[i]) return u * ziggurat.x[i];
    if (i == 0) return u < 0.0 ? -normal_beyond() : normal_beyond();
    const double x = u * ziggurat.x[i], x0 = ziggurat.x[i], x1 = ziggurat.x[i + 1];
    const double f0 = std::exp(-0.5 * (x0 * x0 - x * x)), f1 = std::exp(-0.5 * (x1 * x1 - x * x));
    if (f1 + uniform() * (f0 - f1) < 1.0) return x;
  }
}

/// Of the tail beyond the ziggurat's edge. G. Marsaglia, 1964.
double TrialRandom::normal_beyond() {
  double x = 0.0, y = 0.0;
  do {
    x = -std::log(1.0 - uniform()) / Ziggurat::edge;
    y = -std::log(1.0 - uniform());
  } while (!(y + y > x * x));
  return Ziggurat::edge + x;
}

}  // namespace alidade
