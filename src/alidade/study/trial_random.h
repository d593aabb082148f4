#pragma once

#include <array>
#include <cstdint>
#include <string_view>

namespace alidade {

/// Four words of 32 bits that a counter and a key give: Philox4x32-10. Salmon, Moraes, Dror & Shaw, "Parallel random
/// numbers: as easy as 1, 2, 3", SC 2011.
[[nodiscard]] std::array<std::uint32_t, 4> philox(std::array<std::uint32_t, 4> counter,
                                                  std::array<std::uint32_t, 2> key);

/// Random numbers of one trial: a function of (seed, study, trial) alone.
class TrialRandom {
 public:
  TrialRandom(std::uint64_t seed, std::string_view study, std::uint64_t trial);

  /// A seed for a simulator that draws its own numbers.
  [[nodiscard]] std::uint64_t seed() const;
  [[nodiscard]] std::uint64_t bits();
  /// In [0, 1), 53 bits.
  [[nodiscard]] double uniform() { return static_cast<double>(bits() >> 11U) * 0x1p-53; }
  /// Standard normal, by a ziggurat of 128 layers. J. A. Doornik, "An improved ziggurat method to generate normal
  /// random samples", 2005.
  [[nodiscard]] double normal();

 private:
  [[nodiscard]] double normal_beyond();

  std::array<std::uint32_t, 2> key_;
  std::uint64_t trial_;
  std::uint64_t count_ = 0;  ///< Of blocks of two words drawn.
  std::uint64_t spare_ = 0;
  bool has_spare_ = false;
};

}  // namespace alidade
