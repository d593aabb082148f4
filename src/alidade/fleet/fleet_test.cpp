#include <gtest/gtest.h>

#include <cmath>
#include <limits>
#include <map>
#include <random>
#include <vector>

#include "alidade/fleet/fleet_camera.h"
#include "alidade/fleet/fleet_tracking.h"
#include "alidade/results/fleet_text.h"
#include "alidade/simulate/draws.h"
#include "alidade/simulate/fleet.h"

namespace alidade {
namespace {

const FleetConfig fleet_config{640, 480};

FleetRow row_of(const FleetScene& scene, const FleetSceneConfig& config, std::int64_t n) {
  return fleet_row_of(simulate_observation(scene, config, 7, n), n);
}

struct Watched {
  FleetCamera camera;
  std::vector<FleetAlarm> alarms;
};

Watched watch(const FleetScene& scene, const FleetSceneConfig& config, int rows) {
  Watched watched;
  for (int n = 1; n <= rows; ++n)
    if (const auto alarm = advance(watched.camera, row_of(scene, config, n), fleet_config))
      watched.alarms.push_back(*alarm);
  return watched;
}

/// Nothing happens: no alarm, and the intrinsics are within what they say of themselves.
TEST(Fleet, IsQuietWhereNothingHappens) {
  FleetSceneConfig config;
  config.event_share = 0.0;
  double chi2 = 0.0;
  constexpr int cameras = 100;
  for (int i = 0; i < cameras; ++i) {
    const FleetScene scene = draw_fleet_scene(config, 7, i);
    const Watched watched = watch(scene, config, 600);
    EXPECT_TRUE(watched.alarms.empty()) << scene.id;
    const FleetEstimate estimate = estimate_of(watched.camera);
    ASSERT_TRUE(estimate.has_value) << scene.id;
    const Eigen::Vector4d truth(scene.fx, scene.fy, scene.cx, scene.cy);
    chi2 += (estimate.value.head<4>() - truth).cwiseQuotient(estimate.sigma.head<4>()).squaredNorm() / 4.0;
    EXPECT_EQ(verdict_of(watched.camera).state, State::good);
  }
  EXPECT_NEAR(chi2 / cameras, 1.0, 5.0 * std::sqrt(2.0 / cameras));  // the four of a camera count as one
}

/// Slips of 5 σ of a row: found within a minute in 99 %, as what they are, of the size they have.
TEST(Fleet, FindsSlipsAndTellsTheirSize) {
  FleetSceneConfig config;
  config.event_share = 1.0;
  config.slip_sigmas = 5.0;
  constexpr int cameras = 300;
  int found = 0;
  double chi2 = 0.0;
  for (int i = 0; i < cameras; ++i) {
    const FleetScene scene = draw_fleet_scene(config, 7, i);
    const Watched watched = watch(scene, config, static_cast<int>(scene.event_t_s) + 61);
    if (watched.alarms.empty()) continue;
    const FleetAlarm& alarm = watched.alarms.front();
    if (alarm.kind != FleetAlarmKind::pan_zero || alarm.t_s < scene.event_t_s) continue;
    ++found;
    chi2 += std::pow((alarm.value - scene.event_size) / alarm.sigma, 2);
    EXPECT_NEAR(alarm.since_s, scene.event_t_s, 20.0);
  }
  EXPECT_GE(found, cameras * 99 / 100);
  EXPECT_NEAR(chi2 / found, 1.0, 5.0 * std::sqrt(2.0 / found));
}

TEST(Fleet, TellsWhatHappened) {
  FleetSceneConfig config;
  config.event_share = 1.0;
  const std::map<FleetEvent, FleetAlarmKind> expected{{FleetEvent::belt_slip, FleetAlarmKind::pan_zero},
                                                      {FleetEvent::bracket_sag, FleetAlarmKind::tilt_zero},
                                                      {FleetEvent::focal_drift, FleetAlarmKind::focal_length},
                                                      {FleetEvent::frozen, FleetAlarmKind::frozen}};
  std::map<FleetEvent, int> seen;
  for (int i = 0; i < 80; ++i) {
    const FleetScene scene = draw_fleet_scene(config, 7, i);
    const Watched watched = watch(scene, config, static_cast<int>(scene.event_t_s) + 121);
    ASSERT_FALSE(watched.alarms.empty()) << scene.id << " " << event_word(scene.event);
    EXPECT_EQ(watched.alarms.front().kind, expected.at(scene.event)) << scene.id << " " << event_word(scene.event);
    EXPECT_GE(watched.alarms.front().t_s, scene.event_t_s);
    ++seen[scene.event];
  }
  EXPECT_EQ(seen.size(), 4U);
}

/// Two hours of a day that warms up by 12 °C: a camera that drifts with it is reported, with the size of the drift; the
/// others are not, and neither is a step of the focal length mistaken for it.
TEST(Fleet, TellsAFocalLengthThatFollowsTheTemperature) {
  FleetSceneConfig config;
  config.event_share = 0.5;
  config.warming_c = 12.0;
  config.warming_s = 7200.0;
  config.rate_hz = 0.5;
  constexpr int cameras = 40;
  int drifting = 0;
  double chi2 = 0.0;
  for (int i = 0; i < cameras; ++i) {
    const FleetScene scene = draw_fleet_scene(config, 7, i);
    const Watched watched = watch(scene, config, 3600);
    const bool drifts = scene.focal_per_c != 0.0;
    ASSERT_EQ(watched.alarms.size(), drifts ? 1U : 0U) << scene.id << " " << scene.focal_per_c;
    const FleetEstimate estimate = estimate_of(watched.camera);
    ASSERT_TRUE(estimate.has_temperature);
    chi2 += std::pow((estimate.value[6] - scene.focal_per_c) / estimate.sigma[6], 2);
    if (!drifts) continue;
    ++drifting;
    const FleetAlarm& alarm = watched.alarms.front();
    EXPECT_EQ(alarm.kind, FleetAlarmKind::focal_temperature);
    EXPECT_NEAR(alarm.value, scene.focal_per_c, 5.0 * alarm.sigma) << scene.id;
    EXPECT_NE(sentence_of(alarm).find("drifts with temperature"), std::string::npos);
    EXPECT_NE(fleet_state_text("c", watched.camera).find("\"focal_per_c\""), std::string::npos);
  }
  EXPECT_GT(drifting, 10);
  EXPECT_LT(drifting, 30);
  EXPECT_NEAR(chi2 / cameras, 1.0, 5.0 * std::sqrt(2.0 / cameras));
}

/// The sums alone, on standard normal scores: as often beyond a threshold as Siegmund's approximation says (Sequential
/// Analysis, 1985, eq. 2.58), to a tenth; by it the default is passed once in five years of a row a second.
TEST(FleetSums, AreRarelyBeyondTheirThreshold) {
  const auto rows_between = [](double threshold) {
    const double b = threshold + 1.166;
    return (std::exp(2.0 * b) - 1.0 - 2.0 * b) / 2.0 / 6.0;
  };
  Draws draws(5);
  for (const double threshold : {3.0, 4.0}) {
    constexpr int rows = 3000000;
    FleetSums sums{};
    int count = 0;
    for (int i = 0; i < rows; ++i) {
      FleetScores scores;
      for (std::size_t k = 0; k < num_fleet_channels; ++k) {
        scores.score[k] = draws.normal();
        scores.information[k] = 1.0;
      }
      if (add_scores(sums, scores, 1.0, 0.0, threshold) < 0) continue;
      ++count;
      sums = {};
    }
    EXPECT_NEAR(static_cast<double>(rows) / count, rows_between(threshold), 0.1 * rows_between(threshold));
  }
  EXPECT_GT(rows_between(FleetConfig{}.threshold), 4.0 * 365.25 * 86400.0);
}

/// A worker that ends anywhere, and another that goes on from its checkpoint: the same bytes.
TEST(FleetCheckpoint, GoesOnAsIfNothingHadHappened) {
  FleetSceneConfig config;
  config.event_share = 1.0;
  for (int i = 0; i < 20; ++i) {
    const FleetScene scene = draw_fleet_scene(config, 7, i);
    FleetCamera one, other;
    for (int n = 1; n <= 300; ++n) {
      const auto alarm = advance(one, row_of(scene, config, n), fleet_config);
      const auto back = parse_checkpoint(checkpoint_text(other));
      ASSERT_TRUE(back);
      other = *back;
      const auto again = advance(other, row_of(scene, config, n), fleet_config);
      ASSERT_EQ(alarm.has_value(), again.has_value());
      if (alarm) {
        EXPECT_EQ(fleet_alarm_text("c", *alarm), fleet_alarm_text("c", *again));
      }
      ASSERT_EQ(fleet_state_text("c", one), fleet_state_text("c", other)) << n;
    }
  }
  EXPECT_FALSE(parse_checkpoint(""));
  EXPECT_FALSE(parse_checkpoint("3:AAAA"));
  EXPECT_FALSE(parse_checkpoint("2:AAAA"));
  EXPECT_FALSE(parse_checkpoint("1:AAAA"));
}

TEST(FleetRow, IsReadAsJsonAndCborOrRefused) {
  std::string fault;
  const auto row =
      parse_fleet_row(R"({"n":3,"t":1.5,"pan":0.1,"tilt":-0.2,"p1x":10,"p1y":20,"p3x":null,"p3y":5})", fault);
  ASSERT_TRUE(row);
  EXPECT_EQ(row->n, 3);
  EXPECT_EQ(row->rotation[1], -0.2);
  EXPECT_EQ(row->px[1], 20.0);
  EXPECT_TRUE(std::isnan(row->px[4]));
  // {"n": 3} and {"n": 3, "t": 1.5} by RFC 8949.
  const auto cbor = parse_fleet_row(std::string_view("\xa2\x61n\x03\x61t\xf9\x3e\x00", 9), fault);
  ASSERT_TRUE(cbor);
  EXPECT_EQ(cbor->t_s, 1.5);
  for (const char* text :
       {"", "{", "[]", "{}", "{\"n\":0}", "{\"n\":-1}", "{\"n\":1.5}", "{\"n\":\"1\"}", "\xff\xff", "null"})
    EXPECT_FALSE(parse_fleet_row(text, fault)) << text;
}

/// A row that says nothing is one, whatever it is that is no number; a camera of such rows says why it learns nothing.
TEST(Fleet, NamesWhatItCannotUse) {
  FleetSceneConfig config;
  config.event_share = 0.0;
  const FleetScene scene = draw_fleet_scene(config, 7, 3);
  std::string fault;
  const auto row = [&](const std::string& members) { return *parse_fleet_row("{" + members + "}", fault); };
  FleetCamera fresh;
  for (const char* pan : {"", "\"pan\":\"x\",", "\"pan\":1e300,", "\"pan\":true,", "\"pan\":null,"}) {
    (void)advance(fresh, row("\"n\":1,\"t\":1," + std::string(pan) + "\"tilt\":0.1,\"p1x\":9,\"p1y\":9"), fleet_config);
    EXPECT_EQ(fresh.last_fault, FleetFault::rotation) << pan;
  }
  EXPECT_NE(verdict_of(fresh).sentence.find("rotation is not there"), std::string::npos) << verdict_of(fresh).sentence;
  Watched watched = watch(scene, config, 100);
  EXPECT_EQ(watched.camera.last_fault, FleetFault::none);
  EXPECT_EQ(verdict_of(watched.camera).state, State::good);
  (void)advance(watched.camera, row("\"n\":101,\"t\":1e300,\"pan\":0,\"tilt\":0"), fleet_config);
  EXPECT_EQ(watched.camera.last_fault, FleetFault::time);
  (void)advance(watched.camera, row("\"n\":102,\"t\":102,\"qw\":1,\"qx\":0,\"qy\":0,\"qz\":0"), fleet_config);
  EXPECT_EQ(watched.camera.last_fault, FleetFault::another_rotation);
  EXPECT_EQ(verdict_of(watched.camera).state, State::care);
  (void)advance(watched.camera, row_of(scene, config, 103), fleet_config);
  EXPECT_EQ(verdict_of(watched.camera).state, State::good);
}

/// A camera whose rows are all changed in the same way, after 200 of them.
template <typename Change>
FleetCamera camera_of_changed(int index, const Change& change) {
  FleetSceneConfig config;
  config.event_share = 0.0;
  const FleetScene scene = draw_fleet_scene(config, 7, index);
  FleetCamera camera;
  for (int n = 1; n <= 200; ++n) {
    FleetRow row = row_of(scene, config, n);
    change(row);
    (void)advance(camera, row, fleet_config);
  }
  return camera;
}

/// Units and signs that are wrong are named as observe names them, not "turn it about both axes", which is said where
/// it did not turn.
TEST(Fleet, SaysHowItsRowsAreMisread) {
  using Change = void (*)(FleetRow&);
  const std::vector<std::pair<Change, const char*>> changes{
      {[](FleetRow& row) {
         for (double& each : row.rotation) each *= 180.0 / 3.14159265358979;
       },
       "angles are degrees"},
      {[](FleetRow& row) { row.rotation[0] = -row.rotation[0]; }, "pan counts the other way"},
      {[](FleetRow& row) { std::swap(row.rotation[0], row.rotation[1]); }, "pan and tilt are exchanged"},
      {[](FleetRow& row) {
         for (std::size_t i = 0; i < 12; i += 2) std::swap(row.px[i], row.px[i + 1]);
       },
       "x and y of the points are exchanged"},
      {[](FleetRow& row) { std::swap(row.px[0], row.px[1]); }, "check units and signs"},
      {[](FleetRow& row) { row.rotation[0] = 0.01; }, "turn it about both axes"}};
  for (const auto& [change, words] : changes) {
    for (int i = 0; i < 5; ++i) {
      const FleetCamera camera = camera_of_changed(i, change);
      EXPECT_EQ(verdict_of(camera).state, State::refused) << words;
      EXPECT_NE(verdict_of(camera).sentence.find(words), std::string::npos) << verdict_of(camera).sentence;
    }
  }
}

/// Pixels of another size than the one given: the principal point is not where a lens looks.
TEST(Fleet, AsksAboutASizeThatIsNotThePixels) {
  for (int i = 0; i < 5; ++i) {
    const FleetCamera camera = camera_of_changed(i, [](FleetRow& row) {
      for (double& each : row.px) each *= 2.0;
    });
    EXPECT_EQ(verdict_of(camera).state, State::care);
    EXPECT_NE(verdict_of(camera).sentence.find("images of the size given"), std::string::npos);
  }
}

/// A temperature or a pixel that is no number: the rest of the row is used, and it is said.
TEST(Fleet, UsesTheRestOfARowAndSaysWhatIsOdd) {
  std::string fault;
  EXPECT_EQ(parse_fleet_row(R"({"n":1,"t":1,"pan":0,"tilt":0,"p1x":1,"p1y":2,"temperature_c":null})", fault)->in_part,
            FleetFault::none);
  EXPECT_EQ(parse_fleet_row(R"({"n":1,"t":1,"pan":0,"tilt":0,"p1x":1,"p1y":2,"temperature_c":"hot"})", fault)->in_part,
            FleetFault::temperature);
  EXPECT_EQ(parse_fleet_row(R"({"n":1,"t":1,"pan":0,"tilt":0,"p1x":"1","p1y":2})", fault)->in_part, FleetFault::pixel);
  const FleetCamera camera = camera_of_changed(1, [](FleetRow& row) { row.in_part = FleetFault::temperature; });
  EXPECT_TRUE(estimate_of(camera).has_value);
  EXPECT_EQ(verdict_of(camera).state, State::care);
  EXPECT_NE(verdict_of(camera).sentence.find("temperature_c is not a number"), std::string::npos);
  const auto degrees = parse_fleet_row(R"({"n":1,"t":1,"pan_deg":90,"tilt_deg":-45})", fault);
  EXPECT_NEAR(degrees->rotation[0], 1.5707963267949, 1e-12);
  EXPECT_NEAR(degrees->rotation[1], -0.7853981633974, 1e-12);
}

/// States of the version before go on; a camera that was learning gathers its rows again.
TEST(FleetCheckpoint, OfTheVersionBeforeGoesOn) {
  const FleetCamera camera = camera_of_changed(1, [](FleetRow&) {});
  std::string text = checkpoint_text(camera);
  text[0] = '2';
  ASSERT_TRUE(parse_checkpoint(text));
  EXPECT_EQ(fleet_state_text("c", *parse_checkpoint(text)), fleet_state_text("c", camera));
  FleetCamera learning;
  learning.n = learning.num_buffered = 7;
  text = checkpoint_text(learning);
  text[0] = '2';
  EXPECT_EQ(parse_checkpoint(text)->num_buffered, 0);
  EXPECT_EQ(parse_checkpoint(text)->n, 7);
}

/// Rows that say nothing, or nonsense: each has its state, and none stops the camera for good.
TEST(Fleet, BearsAnyRow) {
  FleetSceneConfig config;
  config.event_share = 0.0;
  const FleetScene scene = draw_fleet_scene(config, 7, 3);
  FleetCamera camera;
  std::mt19937_64 bits(1);
  std::string fault;
  for (int n = 1; n <= 2000; ++n) {
    FleetRow row = row_of(scene, config, n);
    if (n > 300 && n < 900) {
      const auto k = static_cast<std::size_t>(bits() % 12);
      const double odd[] = {NAN, 1e12, -1e12, 0.0, INFINITY};
      row.px[k] = odd[bits() % 5];
      if (bits() % 4 == 0) row.rotation[bits() % 2] = odd[bits() % 5];
      if (bits() % 8 == 0) row.t_s = odd[bits() % 5];
      if (bits() % 8 == 0) row = *parse_fleet_row("{\"n\":" + std::to_string(n) + "}", fault);
    }
    (void)advance(camera, row, fleet_config);
    EXPECT_EQ(camera.n, n);
    EXPECT_NE(fleet_state_text("c", camera).find("\"verdict\""), std::string::npos);
  }
  EXPECT_TRUE(estimate_of(camera).has_value);
  EXPECT_NEAR(estimate_of(camera).value[0], scene.fx, 8.0 * estimate_of(camera).sigma[0]);
}

}  // namespace
}  // namespace alidade
