#include "alidade/io/intrinsics_file.h"

#include <gtest/gtest.h>

#include <stdexcept>
#include <vector>

#include "alidade/observe/observe.h"

namespace alidade {
namespace {

TEST(IntrinsicsFile, ARowARowOfTheLogEmptyUntilThereIsAnEstimate) {
  std::vector<IntrinsicsEstimate> estimates(4);
  estimates[1] = {.has_value = true, .fx = 710.5, .fy = 700, .cx = 390, .cy = 290, .event = ObserveEvent::start};
  estimates[1].sigma = {0.25, 0.5, 1, 2};
  estimates[2] = estimates[1];
  estimates[2].sigma.setConstant(std::numeric_limits<double>::quiet_NaN());
  estimates[2].nis = 7.25;
  estimates[2].event = ObserveEvent::none;
  estimates[3].event = ObserveEvent::new_segment;
  const std::vector<double> t_s{0.0, 1.0 / 30.0, 0.1, 1.7e9};
  EXPECT_EQ(intrinsics_csv(t_s, estimates),
            "t_s,fx,fy,cx,cy,sigma_fx,sigma_fy,sigma_cx,sigma_cy,nis,event\n"
            "0.000000000,,,,,,,,,,\n"
            "0.033333333,710.500000,700.000000,390.000000,290.000000,0.250000,0.500000,1.000000,2.000000,,start\n"
            "0.100000000,710.500000,700.000000,390.000000,290.000000,,,,,7.2500,\n"
            "1700000000.000000000,,,,,,,,,,gap\n");
  EXPECT_THROW((void)intrinsics_csv({t_s.data(), 3}, estimates), std::logic_error);
}

TEST(IntrinsicsFile, EveryEventHasAWord) {
  using enum ObserveEvent;
  EXPECT_EQ(event_name(none), "");
  const std::vector<std::pair<ObserveEvent, std::string>> words{
      {start, "start"},       {burst, "burst"},     {slip, "slip"},      {zoom, "zoom"},
      {zoom_end, "zoom_end"}, {restart, "restart"}, {new_segment, "gap"}};
  for (const auto& [event, word] : words) EXPECT_EQ(event_name(event), word);
}

}  // namespace
}  // namespace alidade
