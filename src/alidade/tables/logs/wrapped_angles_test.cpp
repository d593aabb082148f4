#include <gtest/gtest.h>

#include <cmath>
#include <limits>
#include <numbers>

#include "alidade/simulate/rotation.h"
#include "alidade/tables/events_file.h"
#include "alidade/tables/rotation_log_file.h"
#include "alidade/testing/temporary_folder.h"

// Tables of encoders that begin again after a turn.

namespace alidade {
namespace {

std::string event_rows(const std::vector<double>& pans_rad) {
  std::string text = "t_capture_s,head,pan_rad,tilt_rad,u_px,v_px\n";
  for (std::size_t i = 0; i < pans_rad.size(); ++i)
    text += std::to_string(i) + ",1," + std::to_string(pans_rad[i]) + ",0.1,5,5\n";
  return text;
}

TEST(WrappedAngles, OfEventsGoOnFromTheRowBeforeAndBeginAtTheZero) {
  std::vector<RigHead> heads(1);
  heads[0].head.id = 1;
  const testing::TemporaryFolder folder;
  const std::filesystem::path file = folder.path() / "events.csv";
  const auto pans = [&](const std::vector<double>& pans_rad) {
    write_file(file, event_rows(pans_rad));
    std::vector<double> read;
    for (const TargetObservation& row : read_events(file, heads).observations) read.push_back(row.pan_tilt_rad.x());
    return read;
  };
  const double turn = 2.0 * std::numbers::pi;
  const std::vector<double> wrapped = pans({6.0, 6.25, 0.2, 1.0, 3.0, 3.5});
  const std::vector<double> expected{6.0 - turn, 6.25 - turn, 0.2, 1.0, 3.0, 3.5};
  for (std::size_t i = 0; i < expected.size(); ++i) EXPECT_NEAR(wrapped[i], expected[i], 1e-12) << i;
  heads[0].head.encoder.pan_zero_rad = 6.1;
  EXPECT_EQ(pans({6.0, 6.25}), (std::vector<double>{6.0, 6.25}));
}

TEST(WrappedAngles, OfARotationLogGoOnFromTheRowBefore) {
  const std::string head = "t,pan,tilt,p1x,p1y\n";
  const RotationLog log =
      parse_rotation_log(head + "0,6.2,0.1,300,200\n0.1,0.0,0.1,301,200\n0.2,,,301,200\n0.3,0.1,6.2,301,200\n", "log")
          .log;
  const double turn = 2.0 * std::numbers::pi;
  EXPECT_NEAR(log.rows[0].pan_tilt_roll_rad.x(), 6.2 - turn, 1e-12);
  EXPECT_EQ(log.rows[1].pan_tilt_roll_rad.x(), 0.0);
  EXPECT_TRUE(std::isnan(log.rows[2].pan_tilt_roll_rad.x()));
  EXPECT_EQ(log.rows[3].pan_tilt_roll_rad.x(), 0.1);
  EXPECT_NEAR(log.rows[3].pan_tilt_roll_rad.y(), 6.2 - turn, 1e-12);
}

}  // namespace
}  // namespace alidade
