#include <gtest/gtest.h>

#include <cmath>
#include <limits>

#include "alidade/files/files.h"
#include "alidade/geometry/degree.h"
#include "alidade/heads/head_identify.h"
#include "alidade/heads/protocols/line_socket.h"
#include "alidade/heads/simulated_head.h"
#include "alidade/servo/identify/identify.h"
#include "alidade/servo/identify/identify_flaws.h"

// Heads that are simulated in a time of their own: truth is the plant's.

namespace alidade {
namespace {

/// Writes down its commands, and passes them on.
class WatchedHead : public HeadDevice {
 public:
  explicit WatchedHead(const std::string& url) : head_(open_head(url)) {}
  [[nodiscard]] HeadLimits limits() override { return head_->limits(); }
  [[nodiscard]] HeadPosition position() override {
    asked_s.push_back(clock().now_s());
    return head_->position();
  }
  HeadSent command(const Eigen::Vector2d& target) override {
    ++commands;
    asked_s.push_back(clock().now_s());
    moves_since_stop = true;
    farthest = farthest.cwiseMax(target.cwiseAbs());
    return head_->command(target);
  }
  HeadSent stop() override {
    moves_since_stop = false;
    return head_->stop();
  }
  [[nodiscard]] const std::string& name() const override { return head_->name(); }
  [[nodiscard]] HeadClock& clock() override { return head_->clock(); }

  int commands = 0;
  bool moves_since_stop = false;
  Eigen::Vector2d farthest = Eigen::Vector2d::Zero();
  std::vector<double> asked_s;

 private:
  std::unique_ptr<HeadDevice> head_;
};

void expect_within(const PositionerValue& value, double truth, const std::string& what) {
  EXPECT_LE(std::abs(value.value - truth), 3.0 * value.sigma) << what << ": " << value.value << " for " << truth;
  EXPECT_GT(value.sigma, 0.0) << what;
}

/// All that moves an axis but its dead band.
void expect_motion_within(const PositionerFit& axis, const SimulatedHeadConfig& truth, const std::string& plant) {
  expect_within(axis.rate, truth.axis.rate_rad_s, plant + " rate");
  expect_within(axis.acceleration, truth.axis.acceleration_rad_s2, plant + " acceleration");
  expect_within(axis.time_constant, truth.axis.time_constant_s, plant + " time constant");
  const double sampling_s = truth.update_hz > 0.0 ? 0.5 / truth.update_hz : 0.0;  // a reading is that old on average
  expect_within(axis.latency, truth.axis.latency_s + sampling_s, plant + " latency");
  expect_within(axis.backlash, truth.axis.backlash_rad, plant + " backlash");
}

TEST(Heads, IdentifiedWithinThreeSigma) {
  for (const std::string plant :
       {"rate=33&accel=210&tau=0.07&latency=0.05&backlash=0.2&dead_band=0.08&step=0.01",
        "rate=55&accel=150&tau=0.1&latency=0.02&step=0.02&update_hz=20", "rate=12&accel=300&tau=0.05&latency=0.1"}) {
    const std::string url = "sim://?" + plant + "&clock=free";
    const SimulatedHeadConfig truth = simulated_head_config(plant, "test");
    const std::unique_ptr<HeadDevice> head = open_head(url);
    const HeadIdentification result = identify_head(*head);
    EXPECT_TRUE(result.verdict.ok()) << result.verdict.sentence;
    EXPECT_LT(result.head_time_s, 90.0);
    for (const PositionerFit& axis : result.axes) {
      expect_motion_within(axis, truth, plant);
      expect_within(axis.dead_band, truth.axis.dead_band_rad, plant + " dead band");
      EXPECT_NEAR(axis.resolution.value, truth.step_rad, 0.05 * truth.step_rad) << plant;
      EXPECT_EQ(axis.backlash.is_asked_for, truth.axis.backlash_rad > 0.0) << plant;
    }
  }
}

/// Drawn plants on which the search ended in a wrong minimum, a whole move given up (14: 25σ), and on which the
/// encoder's period was off by 5e-5, a sample at the ends of the log (12: 5σ), or by 4e-6 that no σ counted (30: 4.6σ),
/// or readings were taken for other samples than they were (the last: 4.5σ).
TEST(Heads, DrawnPlantsAreIdentifiedWithinThreeSigma) {
  for (const std::string plant : {"seed=12", "seed=14", "seed=30",
                                  "seed=12&rate=50.5928&accel=217.7934&tau=0.14329&latency=0.03854&backlash=0.0538"}) {
    const SimulatedHeadConfig truth = simulated_head_config(plant, "test");
    const std::unique_ptr<HeadDevice> head = open_head("sim://?clock=free&" + plant);
    for (const PositionerFit& axis : identify_head(*head).axes) {
      expect_motion_within(axis, truth, plant);
      EXPECT_NEAR(axis.encoder_hz, truth.update_hz, 2e-5 * truth.update_hz) << plant;
      EXPECT_LT(axis.rms_rad, 0.5 * truth.step_rad) << plant;
    }
  }
}

/// Of their logs `alidade identify` has the same model, without what the experiment knows: where it rested, and what
/// the readings' steps and times are worth.
TEST(Heads, IdentifyFindsTheSameAxisInTheirLogs) {
  for (const std::string plant :
       {"rate=33&accel=210&tau=0.07&latency=0.05&backlash=0.2&step=0.01",
        "rate=55&accel=150&tau=0.1&latency=0.02&step=0.02", "rate=12&accel=300&tau=0.05&latency=0.1&step=0.01"}) {
    const SimulatedHeadConfig truth = simulated_head_config(plant, "test");
    const std::unique_ptr<HeadDevice> head = open_head("sim://?clock=free&" + plant);
    const HeadIdentification by_head = identify_head(*head);
    const std::vector<ServoSample> log = servo_samples(by_head.logs[0]);
    const ServoIdentification identified = identify_servo(log);
    const ServoFit& fit = identified.fit;
    EXPECT_EQ(fit.kind, ServoKind::angle) << plant;
    EXPECT_EQ(identify_verdict(log, identified).exit_code, ExitCode::ok) << plant;
    const auto near = [&](double value, double sigma, double right, double least, const std::string& what) {
      EXPECT_LE(std::abs(value - right), std::max(3.0 * sigma, least)) << plant << " " << what << ": " << value;
    };
    const auto sigma_of = [&](int param) { return std::sqrt(fit.cov(param, param)); };
    near(fit.params[ServoParam::gain], sigma_of(ServoParam::gain), 1.0, 0.0, "gain");
    near(fit.params[ServoParam::tau], sigma_of(ServoParam::tau), truth.axis.time_constant_s, 0.0, "time constant");
    near(fit.params[ServoParam::latency], sigma_of(ServoParam::latency), truth.axis.latency_s, 0.0, "latency");
    const std::array<std::pair<std::size_t, double>, 3> flaws{
        {{ServoFlaw::rate_limit, truth.axis.rate_rad_s},
         {ServoFlaw::acceleration_limit, truth.axis.acceleration_rad_s2},
         {ServoFlaw::backlash, truth.axis.backlash_rad}}};
    for (const auto& [flaw, right] : flaws) {
      EXPECT_EQ(std::ranges::count(fit.freed, flaw), right > 0.0 ? 1 : 0) << plant << servo_flaw_names[flaw];
      near(fit.flaws.*servo_flaws[flaw], fit.flaw_sigma[flaw], right, 0.0, servo_flaw_names[flaw]);
    }
    EXPECT_LT(fit.rms_rad, 1.2 * by_head.axes[0].rms_rad) << plant;
    EXPECT_LT(fit.rms_rad, 0.01 * identified.other.rms_rad) << plant;
  }
}

TEST(Heads, AskedAtMostFortyTimesASecondWithinLimits) {
  WatchedHead head("sim://?rate=30&clock=free");
  const HeadRange range{Eigen::Vector2d(-20.0, -10.0) * degree, Eigen::Vector2d(20.0, 15.0) * degree};
  (void)identify_head(head, range);
  EXPECT_LE(head.farthest[0], 20.0001 * degree);
  EXPECT_LE(head.farthest[1], 15.0001 * degree);
  for (std::size_t i = 40; i < head.asked_s.size(); ++i) ASSERT_GE(head.asked_s[i] - head.asked_s[i - 40], 0.97);
  EXPECT_FALSE(head.moves_since_stop);
}

TEST(Heads, NothingMovesWhereItIsOnlyAsked) {
  WatchedHead head("sim://?clock=free");
  const HeadSurvey survey = survey_head(head, false);
  EXPECT_EQ(head.commands, 0);
  EXPECT_EQ(survey.readings.size(), 100u);
  const HeadSurvey moved = survey_head(head, true);
  EXPECT_EQ(head.commands, 2);
  EXPECT_FALSE(head.moves_since_stop);
  EXPECT_TRUE(moved.verdict.ok());
}

TEST(Heads, NeverSentWhatIsNotFiniteOrOutside) {
  WatchedHead head("sim://?clock=free");
  MovingHead moving(head, Eigen::Vector2d(-0.5, -0.5), Eigen::Vector2d(0.5, 0.5), {});
  const double nan = std::nan(""), inf = std::numeric_limits<double>::infinity();
  for (const Eigen::Vector2d& bad : {Eigen::Vector2d(nan, 0.0), Eigen::Vector2d(0.0, nan), Eigen::Vector2d(inf, 0.0),
                                     Eigen::Vector2d(0.0, -inf), Eigen::Vector2d(0.6, 0.0), Eigen::Vector2d(0.0, -0.6)})
    EXPECT_THROW(moving.command(bad), InputError) << bad.transpose();
  EXPECT_EQ(head.commands, 0);
  const std::unique_ptr<HeadDevice> device = open_head("sim://?clock=free");
  EXPECT_THROW(device->command({nan, 0.0}), InputError);
  EXPECT_THROW(device->command({100.0, 0.0}), InputError);
}

TEST(Heads, StoppedFirstWhateverEndsIt) {
  for (const std::string lie : {"silent", "nan"}) {
    WatchedHead head("sim://?clock=free&lie_after=5&lie=" + lie);
    EXPECT_THROW((void)identify_head(head), InputError) << lie;
    EXPECT_GT(head.commands, 0) << lie;
    EXPECT_FALSE(head.moves_since_stop) << lie;
  }
  for (const int after : {50, 300, 900}) {  // Ctrl-C
    WatchedHead head("sim://?clock=free");
    int calls = 0;
    const Progress stops = [&](std::string_view, std::size_t, std::size_t) { return ++calls < after; };
    EXPECT_THROW((void)identify_head(head, {}, stops), Interrupted);
    EXPECT_FALSE(head.moves_since_stop) << after;
  }
}

HeadIdentification identified(const std::string& words) {
  const std::unique_ptr<HeadDevice> head = open_head("sim://?clock=free&" + words);
  return identify_head(*head);
}

TEST(Heads, LiesAreNamed) {
  struct Case {
    std::string head, words;
    ExitCode code;
  };
  const std::vector<Case> cases{{"lie=refuses", "refused silently", ExitCode::undetermined},
                                {"lie=frozen", "refused silently, or its reading is frozen", ExitCode::undetermined},
                                {"lie=frozen&lie_after=20", "frozen",
                                 ExitCode::undetermined},  // in the middle: by its readings, not their number
                                {"lie=refuses&lie_after=30", "refused silently", ExitCode::undetermined},
                                {"lie=reports-target", "its target at once", ExitCode::not_trusted},
                                {"grid=1.8", "moves in steps of 1.8°", ExitCode::not_trusted},
                                {"zoom=1&lie=zoom-moves-pan", "zoom moves pan: by 1.50°", ExitCode::not_trusted},
                                {"step=1.8", "read in steps of 1.8°", ExitCode::ok}};
  for (const Case& each : cases) {
    const HeadIdentification given = identified(each.head);
    EXPECT_EQ(given.verdict.exit_code, each.code) << each.head << ": " << given.verdict.sentence;
    EXPECT_NE(given.verdict.state, State::good) << each.head;
    EXPECT_NE(given.verdict.sentence.find(each.words), std::string::npos)
        << each.head << ": " << given.verdict.sentence;
  }
}

/// Advice names the axis that lacks room; one that may not move is not said to be frozen, and is not moved.
TEST(Heads, AnAxisWithoutRoomIsNamedWithItsOwnOption) {
  const auto in_pan = [](const std::string& words, double low_deg, double high_deg) {
    WatchedHead head("sim://?clock=free" + words);
    HeadRange range;
    range.low_rad[0] = low_deg * degree, range.high_rad[0] = high_deg * degree;
    const HeadIdentification given = identify_head(head, range);
    EXPECT_TRUE(high_deg > low_deg || head.commands == 0) << head.commands;
    return given;
  };
  const HeadIdentification narrow = in_pan("", 0.0, 3.0);
  EXPECT_TRUE(narrow.verdict.ok()) << narrow.verdict.sentence;
  EXPECT_NE(narrow.verdict.sentence.find("pan"), std::string::npos);
  EXPECT_EQ(narrow.verdict.to_add, "give it more room: --pan-range LOW,HIGH");
  EXPECT_TRUE(std::isfinite(narrow.axes[1].dead_band.sigma)) << "tilt has all the room that it needs";
  const HeadIdentification none = in_pan("", 0.0, 0.0);
  EXPECT_EQ(none.verdict.exit_code, ExitCode::undetermined);
  EXPECT_EQ(none.verdict.sentence, "pan has no room to move between 0° and 0°");
  EXPECT_EQ(none.verdict.to_add, "give it more room: --pan-range LOW,HIGH");
  const HeadIdentification within_dead_band = in_pan("&dead_band=0.5", 0.0, 0.4);
  EXPECT_EQ(within_dead_band.verdict.exit_code, ExitCode::undetermined);
  EXPECT_EQ(within_dead_band.verdict.sentence,
            "pan did not move, and had too little room to show why, between 0° and 0.4°");
  const HeadIdentification own = in_pan("&min_pan=-2&max_pan=2", -1e9, 1e9);
  EXPECT_EQ(own.verdict.to_add, "the head's own limits leave pan no more room");
}

TEST(Heads, HonestOnesAreNotAccused) {
  for (const std::string head : {"dead_band=0.2&backlash=0.3", "step=0.05&update_hz=20", "zoom=1", "repeat=0.05"}) {
    const HeadIdentification given = identified(head);
    EXPECT_TRUE(given.verdict.ok()) << head << ": " << given.verdict.sentence;
    EXPECT_LT(given.verdict.sentence.size(), 160u) << given.verdict.sentence;
  }
  const std::unique_ptr<HeadDevice> zooms = open_head("sim://?clock=free&zoom=1");
  const HeadSurvey survey = survey_head(*zooms, true);
  EXPECT_TRUE(survey.zoom.has_zoom);
  EXPECT_TRUE(survey.verdict.ok()) << survey.verdict.sentence;
  EXPECT_NEAR(*zooms->zoom(), 0.0, 1e-12);  // it is back
}

/// A head that renews what it reads when it is asked, half a second after the last time at the earliest.
class CachingHead final : public WatchedHead {
 public:
  using WatchedHead::WatchedHead;
  [[nodiscard]] HeadPosition position() override {
    const HeadPosition now = WatchedHead::position();
    if (now.t_s - kept_.t_s > 0.5) kept_ = now;
    return {now.t_s, now.wait_s, kept_.pan_tilt_rad};
  }

 private:
  HeadPosition kept_;
};

TEST(Heads, ACachedPositionIsNamedAndItsLatencyIsThatOfTheFirstChange) {
  CachingHead head("sim://?rate=30&accel=90&latency=0.04&clock=free");
  const HeadIdentification given =
      identify_head(head, {Eigen::Vector2d(-40.0, -20.0) * degree, Eigen::Vector2d(40.0, 20.0) * degree});
  EXPECT_EQ(given.verdict.state, State::care) << given.verdict.sentence;
  EXPECT_NE(given.verdict.sentence.find("cached"), std::string::npos) << given.verdict.sentence;
  for (const PositionerFit& axis : given.axes) {
    EXPECT_NEAR(axis.gain, 1.0, 1e-3);
    EXPECT_NEAR(axis.renewal_s, 0.53, 0.05);
    expect_within(axis.latency, 0.04 + 0.26, "latency");
    expect_within(axis.rate, 30.0 * degree, "rate");
  }
}

/// A head that somebody else moves by 8° every five seconds.
class SharedHead final : public WatchedHead {
 public:
  using WatchedHead::WatchedHead;
  [[nodiscard]] HeadPosition position() override {
    const HeadPosition now = WatchedHead::position();
    if (now.t_s - moved_s_ < 5.0) return now;
    moved_s_ = now.t_s;
    WatchedHead::command(now.pan_tilt_rad + Eigen::Vector2d(now.pan_tilt_rad[0] > 0.0 ? -8.0 : 8.0, 0.0) * degree);
    return now;
  }

 private:
  double moved_s_ = 0.0;
};

TEST(Heads, WhoeverElseMovesItIsNamed) {
  SharedHead head("sim://?rate=30&accel=90&latency=0.04&clock=free");
  const HeadIdentification given =
      identify_head(head, {Eigen::Vector2d(-40.0, -20.0) * degree, Eigen::Vector2d(40.0, 20.0) * degree});
  EXPECT_EQ(given.verdict.exit_code, ExitCode::not_trusted) << given.verdict.sentence;
  EXPECT_NE(given.verdict.sentence.find("pan came to rest up to"), std::string::npos) << given.verdict.sentence;
}

TEST(Heads, UnknownKeysAreNamedWithThoseThereAre) {
  for (const std::string bad : {"speed=3", "rate=fast", "lie=often", "rate", "clock=slow", "min_pan=10&max_pan=5"}) {
    try {
      (void)open_head("sim://?" + bad);
      ADD_FAILURE() << bad;
    } catch (const InputError& error) {
      if (bad.starts_with("speed")) {
        EXPECT_NE(std::string(error.what()).find("backlash, "), std::string::npos) << error.what();
      }
    }
  }
}

TEST(Heads, Addresses) {
  const SocketAddress plain = address_of("rotctl://radio:4534", "rotctl://", 4533);
  EXPECT_EQ(plain.host, "radio");
  EXPECT_EQ(plain.port, 4534);
  EXPECT_EQ(address_of("rotctl://[::1]", "rotctl://", 4533).host, "::1");
  EXPECT_EQ(address_of("rotctl://[::1]:99", "rotctl://", 4533).port, 99);
  EXPECT_EQ(address_of("onvif://admin@cam:8080/?profile=0", "onvif://", 80).user, "admin");
  EXPECT_EQ(address_of("onvif://admin@cam:8080/?profile=0", "onvif://", 80).host, "cam");
  EXPECT_EQ(address_of("onvif://cam?profile=0", "onvif://", 80).port, 80);
  for (const std::string bad : {"rotctl://me:secret@a", "rotctl://@a", "rotctl://a@b@c", "rotctl://", "rotctl://:4533",
                                "rotctl://a:0", "rotctl://a:70000", "rotctl://a:x", "rotctl://a:-1"})
    EXPECT_THROW((void)address_of(bad, "rotctl://", 4533), InputError) << bad;
  EXPECT_THROW((void)open_head("telnet://here"), InputError);
  EXPECT_THROW((void)open_head("sim://?rate=0"), InputError);
  EXPECT_THROW((void)open_head("sim://?rate=nan"), InputError);
  EXPECT_THROW((void)open_head("sim://?colour=1"), InputError);
}

}  // namespace
}  // namespace alidade
