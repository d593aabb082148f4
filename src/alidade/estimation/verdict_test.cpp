#include "alidade/estimation/verdict.h"

#include <gtest/gtest.h>

namespace alidade {
namespace {

TEST(AssumedCheck, SaysWhatMovesAndWhatDoesNot) {
  Assumption square{.name = "square_m", .value = 0.03, .ordinary = 6e-5};
  EXPECT_EQ(assumed_check({square}).text, "square_m is given without σ, but moves nothing of the answer");
  EXPECT_EQ(assumed_check({square}).state, State::good);
  square.moves = 2.0;
  square.moved = "fx";
  EXPECT_EQ(assumed_check({square}).text, "square_m is given without σ: an error of 6e-05 would move fx by 2σ");
  EXPECT_EQ(assumed_check({square}).state, State::care);
  square.sigma = 1e-5;
  EXPECT_EQ(assumed_check({square}).text, "all that is taken as given has its σ");
  EXPECT_EQ(assumed_check({}).text, "nothing is taken as given");
}

}  // namespace
}  // namespace alidade
