#include "alidade/localize/usual_gap.h"

#include <gtest/gtest.h>

#include "alidade/simulate/draws.h"

namespace alidade {
namespace {

TEST(UsualGap, IsTheUpperMedianOfThoseSoFar) {
  UsualGap gap;
  EXPECT_EQ(gap.s(), 1.0);
  Draws draws(1);
  std::vector<double> sorted;
  for (int i = 0; i < 200; ++i) {
    const double value = i % 7 == 0 ? 0.5 : draws.uniform(0.1, 2.0);  // some alike
    gap.add(value);
    sorted.insert(std::ranges::upper_bound(sorted, value), value);
    EXPECT_EQ(gap.s(), sorted[sorted.size() / 2]) << i;
  }
}

}  // namespace
}  // namespace alidade
