#include "alidade/rig/checks/board_print.h"

#include <gtest/gtest.h>

#include "alidade/testing/rig_trial.h"

// Boards that are not as they were meant, lenses that are not as their files say, and what must not be said of them.

namespace alidade {
namespace {

using testing::rig_trial;
using testing::RigTrial;
using testing::RigTrialSetup;

RigTrialSetup setup_of_eight_boards() {
  RigTrialSetup setup;
  setup.scene.num_boards = 8;
  return setup;
}

std::string said_of(const RigTrial& trial) { return trial.verdict.sentence + "; " + trial.verdict.to_add; }

TEST(BoardPrint, AStretchedPrintIsNamed) {
  for (std::uint64_t seed = 1; seed <= 4; ++seed) {
    RigTrialSetup setup = setup_of_eight_boards();
    setup.scene.print_stretch = seed % 2 == 0 ? 0.01 : -0.01;
    const RigTrial trial = rig_trial(setup, seed);
    EXPECT_NE(trial.verdict.state, State::good) << seed;
    EXPECT_NE(said_of(trial).find(seed % 2 == 0 ? "% farther apart than its rows" : "% less apart than its rows"),
              std::string::npos)
        << seed << ": " << said_of(trial);
  }
}

TEST(BoardPrint, ABentBoardIsNamedWhereItMattersAndNotAsWhatItIsNot) {
  for (std::uint64_t seed = 1; seed <= 4; ++seed) {
    RigTrialSetup setup = setup_of_eight_boards();
    setup.scene.board_bend_m = 0.004;
    const RigTrial bent = rig_trial(setup, seed);
    EXPECT_TRUE(bent.verdict.state == State::good || said_of(bent).find("not flat") != std::string::npos)
        << seed << ": " << said_of(bent);
    EXPECT_FALSE(bent.is_silent()) << seed;
    setup.scene.board_bend_m = 0.0002;
    EXPECT_EQ(rig_trial(setup, seed).verdict.state, State::good) << seed;
  }
}

}  // namespace
}  // namespace alidade
