#include "alidade/formats/intrinsics_file.h"

#include <gtest/gtest.h>

#include <filesystem>
#include <stdexcept>
#include <vector>

#include "alidade/files/files.h"
#include "alidade/observe/report.h"

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

class IntrinsicsHistoryFile : public ::testing::Test {
 protected:
  IntrinsicsHistory read(const std::string& text) {
    file_ = std::filesystem::path(::testing::TempDir()) / "intrinsics_history.csv";
    write_file(file_, text);
    return read_intrinsics_history(file_);
  }
  void expect_refusal(const std::string& text, const std::string& words) {
    try {
      (void)read(text);
      ADD_FAILURE() << "not refused: " << words;
    } catch (const InputError& error) {
      EXPECT_NE(std::string(error.what()).find(words), std::string::npos) << error.what();
    }
  }
  std::filesystem::path file_;
  const std::string header_ = "t_s,fx,fy,cx,cy,sigma_fx,sigma_fy,sigma_cx,sigma_cy,nis,event\n";
};

TEST_F(IntrinsicsHistoryFile, IsReadAsItIsWritten) {
  std::vector<IntrinsicsEstimate> estimates(4);
  estimates[1] = {.has_value = true, .fx = 700, .fy = 690, .cx = 390, .cy = 290};
  estimates[1].sigma = {1, 2, 3, 4};
  estimates[2] = estimates[1];
  estimates[2].fx = 800;
  const std::vector<double> t_s{0.0, 0.5, 1.0, 1.5};
  const IntrinsicsHistory history = read(intrinsics_csv(t_s, estimates));
  ASSERT_EQ(history.t_s, (std::vector<double>{0.5, 1.0}));
  EXPECT_EQ(history.from_s, 0.0);
  EXPECT_EQ(history.until_s, 1.5);
  EXPECT_NEAR(history.at(0.6).k[0], 720.0, 1e-9);
  EXPECT_EQ(history.at(0.0).k[0], 700.0);
  EXPECT_EQ(history.at(9.0).k[0], 800.0);
  EXPECT_EQ(history.at(0.6).sigma[3], 4.0);
}

TEST_F(IntrinsicsHistoryFile, RefusesWhatIsNone) {
  expect_refusal("t_s,fx\n0,700\n", "fy");
  expect_refusal(header_, "");
  expect_refusal(header_ + "0,,,,,,,,,,\n", "has no row with an estimate");
  expect_refusal(header_ + "0,700,700,390,290,1,1,1,1,,\n0,700,700,390,290,1,1,1,1,,\n", "does not come after");
  expect_refusal(header_ + "0,-700,700,390,290,1,1,1,1,,\n", ":2: column 'fx'");
  expect_refusal(header_ + "0,700,700,390,290,,1,1,1,,\n", "states σ");
  expect_refusal(header_ + "0,700,700,390,290,-1,1,1,1,,\n", "is below zero");
  expect_refusal(header_ + "0,700,700,nan,290,1,1,1,1,,\n", "is not a finite number");
}

}  // namespace
}  // namespace alidade
