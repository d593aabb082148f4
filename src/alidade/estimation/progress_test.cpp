#include "alidade/estimation/progress.h"

#include <gtest/gtest.h>

#include <string>

namespace alidade {
namespace {

TEST(Progress, AnEmptyOneNeverStops) { EXPECT_NO_THROW(report_progress({}, "work", 1, 2)); }

TEST(Progress, SaysWhatAndHowFar) {
  std::string given;
  const Progress progress = [&](std::string_view what, std::size_t done, std::size_t total) {
    given = std::string(what) + " " + std::to_string(done) + "/" + std::to_string(total);
    return true;
  };
  EXPECT_NO_THROW(report_progress(progress, "photos", 3, 13));
  EXPECT_EQ(given, "photos 3/13");
}

TEST(Progress, AnAnswerOfNoInterrupts) {
  const Progress stop = [](std::string_view, std::size_t, std::size_t) { return false; };
  EXPECT_THROW(report_progress(stop, "work", 0, 0), Interrupted);
}

}  // namespace
}  // namespace alidade
