#pragma once

#include <cmath>
#include <cstdint>
#include <optional>
#include <string>
#include <string_view>

namespace alidade {

/// A sum that is the same in whatever order and in whatever parts it is taken: every number is rounded once to a
/// multiple of 2⁻⁶⁰, and these are added as whole numbers of 128 bits. Numbers below 2³⁰; 2³⁷ of them.
class ExactSum {
 public:
  static constexpr double limit = 0x1p30;

  /// Whether a number can be taken; not infinities and NaN.
  [[nodiscard]] static bool takes(double value) { return std::abs(value) < limit; }

  /// `value` as takes() says.
  void add(double value) {
    // Two halves, each a whole number that a double holds: the rounding is the last one's alone.
    const double high = std::floor(value * 0x1p20);
    const double low = std::nearbyint((value * 0x1p20 - high) * 0x1p40);
    sum_ +=
        static_cast<Whole>(static_cast<std::int64_t>(high)) * (std::int64_t{1} << 40) + static_cast<std::int64_t>(low);
  }
  void add(const ExactSum& other) { sum_ += other.sum_; }

  [[nodiscard]] double value() const {
    const bool is_negative = sum_ < 0;
    const auto size = static_cast<unsigned __int128>(is_negative ? -sum_ : sum_);
    const double high = static_cast<double>(static_cast<std::uint64_t>(size >> 64)) * 0x1p64;
    const double whole = high + static_cast<double>(static_cast<std::uint64_t>(size));
    return (is_negative ? -whole : whole) * 0x1p-60;
  }

  /// Hexadecimal digits, with a sign: what a file holds without loss.
  [[nodiscard]] std::string text() const;
  [[nodiscard]] static std::optional<ExactSum> from_text(std::string_view text);

  bool operator==(const ExactSum&) const = default;

 private:
  __extension__ typedef __int128 Whole;

  Whole sum_ = 0;
};

}  // namespace alidade
