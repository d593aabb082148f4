#include "alidade/study/exact_sum.h"

#include <algorithm>

namespace alidade {

std::string ExactSum::text() const {
  const bool is_negative = sum_ < 0;
  auto size = static_cast<unsigned __int128>(is_negative ? -sum_ : sum_);
  std::string digits;
  do {
    digits += "0123456789abcdef"[static_cast<int>(size & 15U)];
    size >>= 4;
  } while (size != 0);
  if (is_negative) digits += '-';
  std::ranges::reverse(digits);
  return digits;
}

std::optional<ExactSum> ExactSum::from_text(std::string_view text) {
  const bool is_negative = text.starts_with('-');
  if (is_negative) text.remove_prefix(1);
  if (text.empty() || text.size() > 31) return std::nullopt;
  ExactSum sum;
  for (const char digit : text) {
    const std::size_t value = std::string_view("0123456789abcdef").find(digit);
    if (value == std::string_view::npos) return std::nullopt;
    sum.sum_ = sum.sum_ * 16 + static_cast<Whole>(value);
  }
  if (is_negative) sum.sum_ = -sum.sum_;
  return sum;
}

}  // namespace alidade
