#include "alidade/tables/logs/rotation_log_stream.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <chrono>
#include <cstdlib>
#include <numbers>
#include <sstream>

#include "alidade/geometry/so3.h"
#include "alidade/simulate/rotation.h"
#include "alidade/tables/pairs_file.h"
#include "alidade/testing/reference_case.h"
#include "alidade/testing/temporary_folder.h"

namespace alidade {
namespace {

using ::testing::HasSubstr;

class RotationLogText : public ::testing::Test {
 protected:
  [[nodiscard]] std::filesystem::path file(const std::string& text, const char* name = "log.csv") const {
    write_file(folder_.path() / name, text);
    return folder_.path() / name;
  }
  [[nodiscard]] RotationLogFile read(const std::string& text, const RotationLogOptions& options = {}) const {
    return read_rotation_log(file(text), options);
  }
  /// What a file of that text is refused with; empty where it is not.
  [[nodiscard]] std::string refusal(const std::string& text, const RotationLogOptions& options = {}) const {
    try {
      (void)read(text, options);
    } catch (const InputError& error) {
      return error.what();
    }
    return "";
  }
  [[nodiscard]] std::string pairs_refusal(const std::string& text) const {
    try {
      (void)read_pairs(file(text, "pairs.csv"));
    } catch (const InputError& error) {
      return error.what();
    }
    return "";
  }

 private:
  testing::TemporaryFolder folder_;
};

const std::string rate_head = "t,omega_x,omega_y,p1x,p1y\n";
const std::string two_rows = "0,0.1,0.2,300,200\n0.1,0.1,0.2,301,201\n";

TEST_F(RotationLogText, ReadsEveryKindOfRotation) {
  const auto rate = read(rate_head + two_rows).log;
  EXPECT_EQ(rate.source, RotationSource::rate);
  EXPECT_FALSE(rate.has_roll_rate);
  EXPECT_EQ(rate.rows[1].rate_rad_per_s, Eigen::Vector3d(0.1, 0.2, 0.0));
  EXPECT_EQ(rate.rows[1].px[0], Eigen::Vector2d(301, 201));
  const auto full = read("p1y,p1x,omega_z,t,omega_y,omega_x,frame\n1,2,3,0,5,6,a\n1,2,3,1,5,6,b\n").log;
  EXPECT_TRUE(full.has_roll_rate);
  EXPECT_EQ(full.rows[0].rate_rad_per_s, Eigen::Vector3d(6, 5, 3));
  const auto head = read("t_s,pan,tilt_deg,p1x,p1y\n0,0.5,90,1,2\n1,0.5,-45,1,2\n").log;
  EXPECT_EQ(head.source, RotationSource::head);
  EXPECT_EQ(head.rows[0].pan_tilt_roll_rad.x(), 0.5);
  EXPECT_NEAR(head.rows[1].pan_tilt_roll_rad.y(), -std::numbers::pi / 4, 1e-15);
  EXPECT_EQ(head.rows[0].pan_tilt_roll_rad.z(), 0.0);
  const auto attitude = read("t,qw,qx,qy,qz,p1x,p1y\n0,0,0,1.0005,0,1,2\n1,,,,,1,2\n").log;
  EXPECT_EQ(attitude.source, RotationSource::attitude);
  EXPECT_EQ(attitude.rows[0].base_from_cam.y(), 1.0) << "normalised";
  EXPECT_EQ(attitude.rows[1].base_from_cam.norm(), 0.0) << "not measured";
  const auto none = read("t,p1x,p1y\n0,1,2\n1,1,2\n", {.needs_rotation = false}).log;
  EXPECT_EQ(none.source, RotationSource::none);
}

TEST_F(RotationLogText, WhatWasNotMeasuredIsMissing) {
  const auto log = read(
                       "t,omega_x,omega_y,p1x,p1y,p2x,p2y,range_m,vx,vy,vz,fx,fy,u0,v0\n"
                       "0,0.1,0.2,1,2,,,2.5,0,0,1,710,700,390,290\n"
                       "1,,,1,2,3,4,,0,0,1,711,700,390,290\n")
                       .log;
  EXPECT_FALSE(is_seen(log.rows[0].px[1]));
  EXPECT_TRUE(is_seen(log.rows[1].px[1]));
  EXPECT_TRUE(log.rows[1].rate_rad_per_s.array().isNaN().all());
  EXPECT_EQ(log.rows[0].range_m, 2.5);
  EXPECT_TRUE(std::isnan(log.rows[1].range_m));
  EXPECT_TRUE(log.has_velocity);
  EXPECT_EQ(log.rows[0].velocity_m_per_s, Eigen::Vector3d(0, 0, 1));
  EXPECT_EQ(log.truth[1], (TrueIntrinsics{711, 700, 390, 290}));
}

TEST_F(RotationLogText, RowsThatSayTheSameAreRejectedAndListed) {
  const auto read_log = read(rate_head + "0,0.1,0.2,1,2\n0,0.1,0.2,1,2\n0,0.1,0.2,1,2.5\n1,,,,\n1,,,,\n");
  EXPECT_EQ(read_log.log.rows.size(), 3u) << "the same time with another content stays";
  ASSERT_EQ(read_log.skipped.size(), 2u);
  EXPECT_EQ(read_log.skipped[0].line, 3u);
  EXPECT_EQ(read_log.skipped[1].line, 6u);
  EXPECT_EQ(read_log.skipped[0].reason, "repeated row");
}

TEST_F(RotationLogText, HostileFilesAreRefusedAtTheirPlace) {
  const auto wrong_row = [](const std::string& row) { return rate_head + "0,0.1,0.2,1,2\n" + row + "\n"; };
  const std::string head_of_angles = "t,pan,tilt,p1x,p1y\n";
  const std::vector<std::pair<std::string, std::string>> cases = {
      {"", "log.csv: is empty"},
      {"\n\n", "log.csv: is empty"},
      {rate_head, "log.csv: has 0 usable rows"},
      {rate_head + "0,0.1,0.2,1,2\n", "log.csv: has 1 usable row;"},
      {rate_head + "0,0.1,0.2,,\n1,0.1,0.2,,\n", "log.csv: no point is seen"},
      {"omega_x,omega_y,p1x,p1y\n1,2,3,4\n", "log.csv: has no column 't'"},
      {"t,omega_x,omega_y\n0,1,2\n1,1,2\n", "log.csv: has no points"},
      {"t,p1x,p1y\n0,1,2\n1,1,2\n", "log.csv: has no column 'omega_x'"},
      {"t,t_s,omega_x,omega_y,p1x,p1y\n", "log.csv:1: column 't_s'"},
      {"t,t,omega_x,omega_y,p1x,p1y\n", "log.csv:1: column 't' appears twice"},
      {"t,omega_x,p1x,p1y\n0,1,2,3\n", "log.csv:1: column 'omega_x': is there without 'omega_y'"},
      {"t,omega_z,p1x,p1y\n0,1,2,3\n", "log.csv:1: column 'omega_z': is there without 'omega_x'"},
      {"t,pan,p1x,p1y\n0,1,2,3\n", "log.csv:1: column 'pan': is there without 'tilt'"},
      {"t,roll,p1x,p1y\n0,1,2,3\n", "log.csv:1: column 'roll': is there without 'pan'"},
      {"t,pan,pan_deg,tilt,p1x,p1y\n", "log.csv:1: column 'pan_deg': duplicates 'pan'"},
      {"t,qw,qx,qy,p1x,p1y\n", "log.csv:1: column 'qw': is there without 'qz'"},
      {"t,omega_x,omega_y,pan,tilt,p1x,p1y\n", "log.csv:1: column 'pan': duplicates 'omega_x'"},
      {"t,omega_x,omega_y,p1x\n", "log.csv:1: column 'p1x': is there without 'p1y'"},
      {"t,omega_x,omega_y,p1x,p1y,p3y\n", "log.csv:1: column 'p3y': is there without 'p3x'"},
      {"t,omega_x,omega_y,p1x,p1y,p3x,p3y\n", "log.csv:1: column 'p3x': points are numbered"},
      {"t,omega_x,omega_y,p0x,p0y\n", "log.csv:1: column 'p0x': is not known; points are"},
      {"t,omega_x,omega_y,p01x,p01y\n", "log.csv:1: column 'p01x': is not known; points are"},
      {"t,omega_x,omega_y,p1u,p1v\n", "log.csv:1: column 'p1u': is not known; points are"},
      {"t,omega_x,omega_y,P1X,P1Y\n", "log.csv:1: column 'P1X': is not known; points are"},
      {"t,omega_X,omega_y,p1x,p1y\n", "log.csv:1: column 'omega_"},
      {"t,omega_X,omega_Y,p1x,p1y\n", "log.csv:1: column 'omega_X': is not known; is 'omega_x' meant?"},
      {"t,omega_x,omega_y,p1x,p1y,range\n", "log.csv:1: column 'range': is not known; is 'range_m' meant?"},
      {"t,omega_x,omega_y,p1x,p1y,temperature\n", "log.csv:1: column 'temperature': is not known; a rotation log has"},
      {"t,omega_x,omega_y,p1x,p1y,fx,fy,cx\n", "log.csv:1: column 'fx': is there without 'cy'"},
      {"t,omega_x,omega_y,p1x,p1y,fx,fy,cx,u0,cy\n", "log.csv:1: column 'u0': duplicates 'cx'"},
      {"t,omega_x,omega_y,p1x,p1y,vx,vz\n", "log.csv:1: column 'vx': is there without 'vy'"},
      {wrong_row("nan,0.1,0.2,1,2"), "log.csv:3: column 't': 'nan' is not a finite number"},
      {wrong_row(",0.1,0.2,1,2"), "log.csv:3: column 't': is empty"},
      {wrong_row("1e300,0.1,0.2,1,2"), "log.csv:3: column 't': '1e300' is out of range"},
      {wrong_row("-0.1,0.1,0.2,1,2"), "log.csv:3: column 't': '-0.1' is before the row above"},
      {wrong_row("1,inf,0.2,1,2"), "log.csv:3: column 'omega_x': 'inf' is not a finite number"},
      {wrong_row("1,0.1,,1,2"), "log.csv:3: column 'omega_y': is empty, but"},
      {wrong_row("1,0.1,200,1,2"), "log.csv:3: column 'omega_y': '200' is beyond 100 rad/s"},
      {wrong_row("1,0.1,0.2,1,"), "log.csv:3: column 'p1y': is empty, but"},
      {wrong_row("1,0.1,0.2,,2"), "log.csv:3: column 'p1x': is empty, but"},
      {wrong_row("1,0.1,0.2,1,2000001"), "log.csv:3: column 'p1y': '2000001' is out of range"},
      {wrong_row("1,0.1,0.2,1,1e300"), "log.csv:3: column 'p1y': '1e300' is out of range"},
      {wrong_row("1,0.1,0.2,1,two"), "log.csv:3: column 'p1y': 'two' is not a number"},
      {wrong_row("1,0.1,0.2,1"), "log.csv:3: has 4 cells, the header has 5"},
      {wrong_row("1,0.1,0.2,1,2,3"), "log.csv:3: has 6 cells, the header has 5"},
      {wrong_row("\n1,0.1,0.2,1,2"), "log.csv:3: a blank line"},
      {wrong_row(std::string("1,0.1,0.2,1,\0", 13)), "log.csv:3: is not a text file"},
      {wrong_row("1,0.1,0.2,1,\"2"), "log.csv:3: a quote is opened"},
      {head_of_angles + "0,1,90,1,2\n", "log.csv:2: column 'tilt': '90' is more than two turns; rad expected"},
      {head_of_angles + "0,-90,1,1,2\n", "log.csv:2: column 'pan': '-90' is more than two turns; rad expected"},
      {"t,pan_deg,tilt_deg,p1x,p1y\n0,1,721,1,2\n", "log.csv:2: column 'tilt_deg': '721' is more than two turns"},
      {"t,qw,qx,qy,qz,p1x,p1y\n0,0.9,0,0,0,1,2\n", "log.csv:2: column 'qw': the quaternion's norm is 0.9"},
      {"t,qw,qx,qy,qz,p1x,p1y\n0,0,0,0,0,1,2\n", "log.csv:2: column 'qw': the quaternion's norm is 0"},
      {"t,qw,qx,qy,qz,p1x,p1y\n0,1,,0,0,1,2\n", "log.csv:2: column 'qx': is empty, but"},
      {"t,omega_x,omega_y,p1x,p1y,range_m\n0,1,1,1,2,0\n", "log.csv:2: column 'range_m': '0' is not above zero"},
      {"t,omega_x,omega_y,p1x,p1y,range_m\n0,1,1,1,2,-3\n", "log.csv:2: column 'range_m': '-3' is not above"},
      {"t,omega_x,omega_y,p1x,p1y,vx,vy,vz\n0,1,1,1,2,,,\n", "log.csv:2: column 'vx': is empty"},
      {"t,omega_x,omega_y,p1x,p1y,fx,fy,cx,cy\n0,1,1,1,2,0,1,1,1\n", "log.csv:2: column 'fx': '0' is not above zero"},
      {"t,omega_x,omega_y,p1x,p1y,fx,fy,cx,cy\n0,1,1,1,2,1,1,1,\n", "log.csv:2: column 'cy': is empty"},
      {std::string("\xFF\xFEt\0", 4), "log.csv:1: is not a text file"},
  };
  for (const auto& [text, place] : cases) {
    const std::string said = refusal(text);
    EXPECT_THAT(said, HasSubstr(place)) << text;
    EXPECT_EQ(said.find('\n'), std::string::npos) << "one line";
  }
}

TEST_F(RotationLogText, SkipBadListsWrongRows) {
  const auto read_log =
      read(rate_head + "0,0.1,0.2,1,2\n1,nan,0.2,1,2\n\n2,0.1,0.2\n1.5,0.1,0.2,1,2\n1.2,0.1,0.2,1,2\n3,0.1,0.2,1,2\n",
           {.skip_bad = true});
  EXPECT_EQ(read_log.log.rows.size(), 3u);
  ASSERT_EQ(read_log.skipped.size(), 4u);
  EXPECT_EQ(read_log.skipped[0].line, 3u);
  EXPECT_EQ(read_log.skipped[0].reason, "column 'omega_x': 'nan' is not a finite number");
  EXPECT_EQ(read_log.skipped[1].line, 4u);  // the blank line
  EXPECT_EQ(read_log.skipped[2].line, 5u);
  EXPECT_EQ(read_log.skipped[2].reason, "has 3 cells, the header has 5");
  EXPECT_EQ(read_log.skipped[3].line, 7u);
  EXPECT_THAT(refusal("t,omega_X,omega_Y,p1x,p1y\n" + two_rows, {.skip_bad = true}), HasSubstr("omega_X"))
      << "a wrong header leaves nothing to skip";
}

/// A stream that reports how far it was read.
class CountingBuffer : public std::streambuf {
 public:
  explicit CountingBuffer(std::string text) : text_(std::move(text)) {}
  [[nodiscard]] std::size_t given() const { return at_; }

 protected:
  int_type uflow() override { return at_ < text_.size() ? traits_type::to_int_type(text_[at_++]) : traits_type::eof(); }
  int_type underflow() override {
    return at_ < text_.size() ? traits_type::to_int_type(text_[at_]) : traits_type::eof();
  }

 private:
  std::string text_;
  std::size_t at_ = 0;
};

TEST_F(RotationLogText, AStreamGivesEachRowAsSoonAsItIsThere) {
  CountingBuffer buffer(rate_head + "0,0.1,0.2,300,200\n0.1,bad,0.2,301,201\r\n0.2,0.1,0.2,302,202");
  std::istream in(&buffer);
  RotationLogStream stream(in, "-");
  EXPECT_EQ(stream.layout().num_points, 1u);
  EXPECT_EQ(buffer.given(), rate_head.size());
  const auto first = stream.next();
  ASSERT_TRUE(first);
  EXPECT_EQ(buffer.given(), rate_head.size() + 18) << "not a character beyond the line";
  EXPECT_EQ(first->line, 2u);
  EXPECT_THROW((void)stream.next(), InputError);
  const auto last = stream.next();
  ASSERT_TRUE(last) << "the fault is behind";
  EXPECT_EQ(last->row.px[0], Eigen::Vector2d(302, 202));
  EXPECT_EQ(last->line, 4u);
  EXPECT_FALSE(stream.next());
}

TEST_F(RotationLogText, AnyLineEndAndAByteOrderMark) {
  for (const char* end : {"\n", "\r\n", "\r"}) {
    std::string text = "\xEF\xBB\xBF" + rate_head + two_rows;
    for (std::size_t at = 0; (at = text.find('\n', at)) != std::string::npos; at += std::string(end).size())
      text.replace(at, 1, end);
    EXPECT_EQ(read(text).log.rows.size(), 2u);
  }
}

RotationLog simulated(RotationSource source) {
  RotationScene scene;
  scene.start_px = draw_points(780, 582, 6, 1);
  scene.depth_m.assign(6, 3.0);
  scene.motion = source == RotationSource::rate ? paper_rate : [](double t_s) { return paper_pan_tilt(t_s, 0.3); };
  RotationLogConfig config;
  config.source = source;
  config.duration_s = 3.0;
  config.lost_share = 0.1;
  config.with_range = true;
  RotationLog log = simulate_rotation(scene, config, 7);
  log.rows[5].range_m = not_seen;
  log.rows[6].rate_rad_per_s.setConstant(not_seen);
  log.rows[6].pan_tilt_roll_rad.setConstant(not_seen);
  log.rows[6].base_from_cam.coeffs().setZero();
  return log;
}

/// Largest difference; infinite where one is missing and the other is not.
double difference(const Eigen::VectorXd& a, const Eigen::VectorXd& b) {
  double largest = 0.0;
  for (Eigen::Index i = 0; i < a.size(); ++i) {
    if (std::isnan(a[i]) && std::isnan(b[i])) continue;
    const double apart = std::abs(a[i] - b[i]);
    largest = std::max(largest, std::isnan(apart) ? std::numeric_limits<double>::infinity() : apart);
  }
  return largest;
}

TEST_F(RotationLogText, RoundTrip) {
  using enum RotationSource;
  for (const RotationSource source : {rate, head, attitude, none}) {
    const RotationLog log = simulated(source);
    const RotationLog back = read(rotation_log_csv(log), {.needs_rotation = source != none}).log;
    EXPECT_EQ(back.source, source);
    EXPECT_EQ(back.has_roll_rate, source == rate);
    ASSERT_EQ(back.rows.size(), log.rows.size());
    ASSERT_EQ(back.truth.size(), log.truth.size());
    for (std::size_t i = 0; i < log.rows.size(); ++i) {
      const RotationRow &a = log.rows[i], &b = back.rows[i];
      EXPECT_NEAR(a.t_s, b.t_s, 0.51e-9);
      // 12 digits of numbers below one, and a quaternion that is normalised again.
      EXPECT_LT(difference(a.rate_rad_per_s, b.rate_rad_per_s), 1e-11);
      EXPECT_LT(difference(a.pan_tilt_roll_rad, b.pan_tilt_roll_rad), 1e-11);
      EXPECT_LT(difference(a.base_from_cam.coeffs(), b.base_from_cam.coeffs()), 1e-11);
      for (std::size_t k = 0; k < 6; ++k) EXPECT_LT(difference(a.px[k], b.px[k]), 0.51e-6);
      EXPECT_LT(difference(Eigen::VectorXd::Constant(1, a.range_m), Eigen::VectorXd::Constant(1, b.range_m)), 1e-11);
      for (std::size_t k = 0; k < 4; ++k) EXPECT_NEAR(log.truth[i][k], back.truth[i][k], 0.51e-6);
    }
  }
}

class Speed : public RotationLogText {};

TEST_F(Speed, TenThousandRowsOfTwentyPointsTakeNoTime) {
  RotationScene scene;
  scene.start_px = draw_points(780, 582, 20, 1);
  scene.motion = paper_rate;
  RotationLogConfig config;
  config.duration_s = 10'000 / 30.0;
  const auto log_file = file(rotation_log_csv(simulate_rotation(scene, config, 7)));
  double best_s = 1e9;
  for (int i = 0; i < 3; ++i) {
    const auto start = std::chrono::steady_clock::now();
    EXPECT_EQ(read_rotation_log(log_file).log.rows.size(), 10'001u);
    best_s = std::min(best_s, std::chrono::duration<double>(std::chrono::steady_clock::now() - start).count());
  }
  RecordProperty("best_ms", std::to_string(1e3 * best_s));
#ifdef NDEBUG
  EXPECT_LT(best_s, 0.3);
#endif
}

TEST_F(RotationLogText, ReadsTheReferenceLog) {
  for (const char* name : {"a_clean", "a_exp1_noise", "a_exp2_burst", "a_exp3_zoom", "a_exp3_zoom_noise"}) {
    const RotationLogFile read = read_rotation_log(testing::reference_case(std::string(name) + ".csv"));
    EXPECT_EQ(read.log.rows.size(), 601u);
    EXPECT_EQ(read.log.num_points, 4u);
    EXPECT_EQ(read.log.truth.size(), 601u);
    EXPECT_TRUE(read.skipped.empty());
  }
}

const std::string pair_head = "frame_a,frame_b,ua_px,va_px,ub_px,vb_px\n";

TEST_F(RotationLogText, MatchesThatShareAPixelShareAFeature) {
  // Three frames; a pixel that two matches share; a duplicate match; one given in the reverse direction.
  const auto read = read_pairs(file(pair_head + "b,a,10,20,11,21\n"
                                                "a,c,11,21,12,22\n"
                                                "a,c,50,60,51,61\n"
                                                "c,a,12,22,99,99\n"
                                                "b,a,10,20,11,21\n"
                                                "b,c,10,20,12,22\n"));
  EXPECT_THAT(read.photos.names, ::testing::ElementsAre("b", "a", "c")) << "as they appear";
  ASSERT_EQ(read.photos.features.size(), 3u);
  EXPECT_EQ(read.photos.features[0].size(), 1u);
  EXPECT_EQ(read.photos.features[1].size(), 3u);
  EXPECT_EQ(read.photos.features[2].size(), 2u);
  ASSERT_EQ(read.photos.pairs.size(), 3u);
  const MatchedPair& a_c = read.photos.pairs[1];
  EXPECT_EQ(a_c.photo_a, 1);
  EXPECT_EQ(a_c.photo_b, 2);
  ASSERT_EQ(a_c.matches.size(), 3u);
  EXPECT_EQ(read.photos.features[1][static_cast<std::size_t>(a_c.matches[2].a)], Eigen::Vector2d(99, 99));
  EXPECT_EQ(read.photos.features[2][static_cast<std::size_t>(a_c.matches[2].b)], Eigen::Vector2d(12, 22));
  ASSERT_EQ(read.skipped.size(), 1u);
  EXPECT_EQ(read.skipped[0].line, 6u);
}

TEST_F(RotationLogText, HostilePairsAreRefusedAtTheirPlace) {
  const std::vector<std::pair<std::string, std::string>> cases = {
      {"", "pairs.csv: is empty"},
      {pair_head, "pairs.csv: has no matches"},
      {"frame_a,ua_px,va_px,ub_px,vb_px\na,1,2,3,4\n", "pairs.csv: has no column 'frame_b'"},
      {pair_head + "a,a,1,2,3,4\n", "pairs.csv:2: column 'frame_b': 'a' is matched with itself"},
      {pair_head + ",a,1,2,3,4\n", "pairs.csv:2: column 'frame_a': is empty"},
      {pair_head + "a,b,nan,2,3,4\n", "pairs.csv:2: column 'ua_px': 'nan' is not a finite"},
      {pair_head + "a,b,1,2,3,1e7\n", "pairs.csv:2: column 'vb_px': '1e7' is out of range"},
      {pair_head + "a,b,1,2,,4\n", "pairs.csv:2: column 'ub_px': is empty"},
      {pair_head + "a,b,1,2,3\n", "pairs.csv:2: has 5 cells"},
  };
  for (const auto& [text, place] : cases) EXPECT_THAT(pairs_refusal(text), HasSubstr(place)) << text;
  const auto read = read_pairs(file(pair_head + "a,b,1,2,3,4\na,b,nan,2,3,4\n"), true);
  ASSERT_EQ(read.skipped.size(), 1u);
  EXPECT_EQ(read.skipped[0].line, 3u);
}

TEST_F(RotationLogText, ReadsRealMatches) {
  const char* data = std::getenv("ALIDADE_DATA");
  if (data == nullptr) GTEST_SKIP() << "ALIDADE_DATA does not name the folder of recorded data";
  const auto read = read_pairs(std::filesystem::path(data) / "data" / "rot-prexy" / "correspondences.csv");
  EXPECT_EQ(read.photos.names.size(), 7u);
  EXPECT_EQ(read.photos.pairs.size(), 6u);
}

}  // namespace
}  // namespace alidade
