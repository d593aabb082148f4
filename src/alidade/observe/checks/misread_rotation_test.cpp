#include <gtest/gtest.h>

#include "alidade/observe/solve/solve.h"

namespace alidade {
namespace {

/// Where a σ of the scale keeps it from being estimated all else is freed, until nothing is asked for and nothing
/// determined.
TEST(MisreadRotation, AVagueAnswerMayBe) {
  ObserveSolution report;
  report.status = ObserveSolution::Status::ok;
  report.motion.span_rad = 0.3;
  report.motion.path_rad = {1.0, 2.0, 0.1};
  for (const char* name : {"fx", "fy", "cx", "cy"}) report.quantities.push_back({name, 1000.0, 1.0, 1.0, 1.0});
  EXPECT_FALSE(may_be_misread(report));
  report.quantities[1].sigma = 200.0;
  EXPECT_TRUE(may_be_misread(report));
  report.motion.path_rad.x() = 0.0;  // pan alone: no reading is distinguished from another
  EXPECT_FALSE(may_be_misread(report));
}

}  // namespace
}  // namespace alidade
