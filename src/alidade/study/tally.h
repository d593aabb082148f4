#pragma once

#include <array>
#include <cstdint>
#include <map>
#include <vector>

#include "alidade/study/exact_sum.h"
#include "alidade/study/trial.h"

namespace alidade {

/// Sums of one quantity over trials with an estimate of it.
struct QuantityTally {
  std::uint64_t values = 0;
  ExactSum error, error2, sigma2, ratio2;  ///< ratio: the error over the bound.
  std::array<std::uint64_t, 3> inside{};   ///< |error| < 1, 2, 3 σ.
  std::map<int, std::uint64_t> sizes;      ///< |error| by its size: the n-th of 32 parts of a power of two, 32 k + n.

  bool operator==(const QuantityTally&) const = default;
};

/// A trial among the worst: the quantity that is furthest off, in its stated σ.
struct WorstTrial {
  std::uint64_t trial = 0;
  int quantity = 0;
  double error = 0.0, sigma = 0.0;

  [[nodiscard]] double z() const { return std::abs(error) / sigma; }
  bool operator==(const WorstTrial&) const = default;
};

/// What trials came to. Whole numbers and exact sums: the same however the trials were divided and in whatever order
/// the parts are added.
class StudyTally {
 public:
  static constexpr std::size_t max_worst = 10;

  StudyTally() = default;
  explicit StudyTally(std::size_t num_quantities) : quantities(num_quantities) {}

  void add(std::uint64_t trial, const TrialResult& result);
  void add(const StudyTally& other);

  std::uint64_t trials = 0, estimates = 0;
  /// Estimates that no sum can take: not finite, or beyond 2¹⁵ units off. In no other number but `trials`.
  std::uint64_t beyond = 0;
  std::uint64_t good_beyond_5_sigma = 0;  ///< Said to be good, and beyond 5σ in some quantity.
  std::array<std::uint64_t, 5> states{};  ///< By State.
  std::vector<QuantityTally> quantities;
  std::vector<WorstTrial> worst;  ///< The worst first; of equals the earlier trial.

  bool operator==(const StudyTally&) const = default;

 private:
  void note(const WorstTrial& trial);
};

/// What a tally says of a quantity.
struct QuantityFigures {
  double bias = 0.0, rms = 0.0, rms_sigma = 0.0, rms_over_bound = 0.0;
  double median = 0.0, p90 = 0.0;    ///< Of |error|: half, and nine tenths, are below. To a hundredth of itself.
  std::array<double, 3> coverage{};  ///< Share of the trials within 1, 2, 3 σ.
};
/// NaN where there was no estimate.
[[nodiscard]] QuantityFigures figures_of(const StudyTally& tally, std::size_t quantity, bool has_bound);

}  // namespace alidade
