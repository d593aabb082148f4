#include "alidade/study/exact_sum.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <random>
#include <vector>

namespace alidade {
namespace {

TEST(ExactSum, IsTheSameInEveryOrderAndDivision) {
  std::mt19937_64 bits(3);
  std::normal_distribution<double> normal(0.0, 1e3);
  std::vector<double> numbers(10000);
  for (double& number : numbers) number = normal(bits) * std::pow(10.0, static_cast<double>(bits() % 9) - 6.0);
  const auto sum_of = [](const std::vector<double>& all, std::size_t parts) {
    std::vector<ExactSum> sums(parts);
    for (std::size_t i = 0; i < all.size(); ++i) sums[i % parts].add(all[i]);
    ExactSum sum;
    for (const ExactSum& part : sums) sum.add(part);
    return sum;
  };
  const ExactSum one = sum_of(numbers, 1);
  for (int round = 0; round < 5; ++round) {
    std::ranges::shuffle(numbers, bits);
    EXPECT_EQ(sum_of(numbers, static_cast<std::size_t>(1 + 13 * round)), one);
  }
}

TEST(ExactSum, IsTheSumToItsLastPlace) {
  ExactSum sum;
  for (int i = 0; i < 1000; ++i) sum.add(0.125);
  for (int i = 0; i < 500; ++i) sum.add(-0.25);
  EXPECT_EQ(sum.value(), 0.0);
  sum.add(0x1p-59);
  EXPECT_EQ(sum.value(), 0x1p-59);
  sum.add(-0x1p29);
  EXPECT_EQ(sum.value(), -0x1p29 + 0x1p-59);
  EXPECT_FALSE(ExactSum::takes(0x1p30));
  EXPECT_FALSE(ExactSum::takes(std::nan("")));
}

TEST(ExactSum, ComesBackFromItsText) {
  for (const double value : {0.0, 1.0, -1.0, 1e-15, -123456.789, 0x1p29}) {
    ExactSum sum;
    for (int i = 0; i < 12345; ++i) sum.add(value);
    EXPECT_EQ(ExactSum::from_text(sum.text()), sum) << value;
  }
  for (const char* text : {"", "-", "xyz", "1 ", "0123456789abcdef0123456789abcdef"})
    EXPECT_FALSE(ExactSum::from_text(text)) << text;
}

}  // namespace
}  // namespace alidade
