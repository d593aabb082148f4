#include <fmt/format.h>
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <cstdlib>
#include <filesystem>
#include <functional>
#include <nlohmann/json.hpp>

#include "alidade/files/csv.h"
#include "alidade/files/files.h"
#include "alidade/testing/command_test.h"
#include "alidade/testing/reference_case.h"

namespace alidade {
namespace {

using testing::Outcome;
using Json = nlohmann::json;

class TrackCommand : public testing::CommandTest {
 protected:
  void simulate(const std::string& scenario, const std::vector<std::string>& options = {}) {
    std::vector<std::string> arguments{"simulate", "track", "--scenario", scenario, "--out", path("sim"), "--quiet"};
    const Outcome made = alidade(arguments, options);
    ASSERT_EQ(made.code, 0) << made.err;
  }
  [[nodiscard]] Outcome track(const std::vector<std::string>& options, const std::string& events = "sim/events.csv") {
    std::vector<std::string> arguments{"track", path(events), "--rig",      path("sim/rig.yaml"),
                                       "--out", path("out"),  "--no-report"};
    return alidade(arguments, options);
  }
  /// The simulated events, each row changed.
  void write_changed(const std::function<std::string(const Csv&, std::size_t row)>& change) {
    const Csv csv = Csv::read(path("sim/events.csv"));
    std::string text = "t_capture_s,t_arrival_s,head,pan_rad,tilt_rad,u_px,v_px\n";
    for (std::size_t row = 0; row < csv.num_rows(); ++row) text += change(csv, row);
    write_file(path("changed.csv"), text);
  }
};

std::string row_of(const Csv& csv, std::size_t row, const std::string& column, const std::string& value) {
  std::string text;
  for (const std::string& name : csv.header())
    text += (text.empty() ? "" : ",") + (name == column ? value : csv.text(row, name));
  return text + "\n";
}

TEST_F(TrackCommand, GivesThePathWithTheNamesOfTheContract) {
  simulate("B");
  for (const std::string method : {"cv", "singer", "turn", "imm"}) {
    const Outcome outcome = track({"--method", method, "--truth", path("sim/truth.csv"), "--json"});
    ASSERT_EQ(outcome.code, 0) << method << outcome.err;
    const Json document = Json::parse(outcome.out);
    const Json& estimate = document["estimate"];
    EXPECT_LT(estimate["rms_m"], 0.005) << method;
    EXPECT_LT(estimate["mean_error_m"], estimate["rms_m"]) << method;
    EXPECT_GT(estimate["nis_per_dof"], 0.7) << method;
    EXPECT_LT(estimate["nis_per_dof"], 1.4) << method;
    EXPECT_GT(estimate["nees_per_dof"], 0.4) << method;
    EXPECT_LT(estimate["nees_per_dof"], 1.8) << method;
    EXPECT_GT(estimate["pcrlb_m"], 0.001) << method;
    const Json& steps = document["data"]["steps"];
    EXPECT_EQ(steps["t_s"].size(), steps["target_in_world_x_m"].size());
    EXPECT_EQ(document["data"]["measurements"]["accepted"].size(), document["counts"]["given"]);
  }
  const Csv rows = Csv::read(path("out/track.csv"));
  const std::vector<std::string> header{"t_s",    "x_m",       "y_m",       "z_m",       "vx_m_s", "vy_m_s",
                                        "vz_m_s", "sigma_x_m", "sigma_y_m", "sigma_z_m", "nis",    "event"};
  EXPECT_EQ(rows.header(), header);
  EXPECT_EQ(rows.num_rows(), Csv::read(path("sim/events.csv")).num_rows());
}

/// A head that follows keeps the target central, where the focal length hardly matters: the truth alone shows it.
TEST_F(TrackCommand, AWrongCameraIsSeenByTheTruth) {
  simulate("B");
  std::string rig = read_file(path("sim/rig.yaml"));
  for (const std::string key : {"fx: ", "fy: "}) {
    for (std::size_t at = rig.find(key); at != std::string::npos; at = rig.find(key, at + 1)) {
      const std::size_t from = at + key.size(), end = rig.find_first_of(",\n}", from);
      rig.replace(from, end - from, std::to_string(2.0 * std::stod(rig.substr(from, end - from))));
    }
  }
  write_file(path("sim/rig.yaml"), rig);
  const Outcome outcome = track({"--truth", path("sim/truth.csv"), "--json"});
  if (outcome.code == 6) {
    EXPECT_EQ(Json::parse(outcome.out)["verdict"]["state"], "bad");
    EXPECT_TRUE(std::filesystem::exists(path("out/track.csv"))) << "it is there, for who wants to look";
    EXPECT_THAT(outcome.err + outcome.out, ::testing::HasSubstr("times their σ"));
  } else {
    EXPECT_EQ(outcome.code, 4);
  }
}

TEST_F(TrackCommand, WhatARigDoesNotSayOfItsErrorsIsAssumed) {
  simulate("C");
  const Json exact = Json::parse(track({"--json"}).out);
  EXPECT_EQ(exact["verdict"]["state"], "good") << exact["verdict"]["sentence"];
  std::string rig = read_file(path("sim/rig.yaml"));
  ASSERT_NE(rig.find("covariance: exact"), std::string::npos);
  rig.erase(rig.find("covariance: exact"));
  write_file(path("sim/rig.yaml"), rig);
  const Outcome outcome = track({"--json"});
  EXPECT_EQ(outcome.code, 0);
  const Json unknown = Json::parse(outcome.out);
  EXPECT_EQ(unknown["verdict"]["state"], "care");
  EXPECT_THAT(unknown["verdict"]["sentence"].get<std::string>(), ::testing::HasSubstr("given without σ"));
  // 0.5 % of a scale at the reading φ rotates a ray by 0.005 φ.
  bool has_scale = false;
  for (const Json& what : unknown["assumed"]) has_scale = has_scale || what["name"] == "head1.pan_scale";
  EXPECT_TRUE(has_scale);
}

TEST_F(TrackCommand, ErrorsThatARigStatesWidenSigma) {
  simulate("B");
  const Json exact = Json::parse(track({"--json"}).out);
  std::string rig = read_file(path("sim/rig.yaml"));
  const std::size_t at = rig.find("covariance: exact");
  rig.replace(at, std::string::npos, "covariance: {names: [head2.base_ry_rad], upper: [4e-6]}\n");
  write_file(path("sim/rig.yaml"), rig);
  const Json wide = Json::parse(track({"--json"}).out);
  EXPECT_TRUE(wide["estimate"]["rig_errors_counted"].get<bool>());
  // Rays 0.5 m apart that meet 0.64 m away: 2 mrad of one moves the meeting by about 0.64²/0.5 · 0.002 = 1.6 mm.
  const double sigma = wide["stddev"]["position_m"][2], noise = exact["stddev"]["position_m"][2];
  EXPECT_NEAR(std::sqrt(sigma * sigma - noise * noise), 0.0016, 0.0006);
}

TEST_F(TrackCommand, PredictsAhead) {
  simulate("B");
  ASSERT_EQ(track({"--predict", "0.1"}).code, 0);
  const Csv rows = Csv::read(path("out/track.csv"));
  std::size_t predicted = 0;
  double sum2 = 0.0;
  for (std::size_t row = 1; row < rows.num_rows(); ++row) {
    if (rows.text(row, "event") != "predicted") continue;
    EXPECT_NEAR(rows.number(row, "t_s"), rows.number(row - 1, "t_s") + 0.1, 1e-6);
    const double t_s = rows.number(row, "t_s"), angle = 2.0 * std::acos(-1.0) * t_s / 3.0;
    if (t_s < 1.0) continue;
    const double dx = rows.number(row, "x_m") - (0.173 + 0.2 * (std::cos(angle) - 1.0));
    const double dy = rows.number(row, "y_m") - (-0.314 + 0.2 * std::sin(angle));
    const double dz = rows.number(row, "z_m") - 0.636;
    sum2 += dx * dx + dy * dy + dz * dz;
    ++predicted;
  }
  EXPECT_GT(predicted, 150u);
  EXPECT_LT(std::sqrt(sum2 / static_cast<double>(predicted)), 0.014);  // 25 mm where latency is ignored
}

TEST_F(TrackCommand, ReadsTheReferenceEventsInTheirSpelling) {
  simulate("B");
  const std::string events = testing::reference_case("c6_events_latency.csv");
  const Outcome outcome = alidade({"track", events, "--rig", path("sim/rig.yaml"), "--truth", path("sim/truth.csv"),
                                   "--sigma-a", "1", "--out", path("out"), "--no-report", "--json"});
  ASSERT_EQ(outcome.code, 0) << outcome.err;
  EXPECT_LT(Json::parse(outcome.out)["estimate"]["rms_m"], 0.0038);
}

TEST_F(TrackCommand, AnswersRowsFromStandardInputAsTheFileIsAnswered) {
  simulate("B");
  ASSERT_EQ(track({}).code, 0);
  const std::string whole = read_file(path("out/track.csv"));
  const std::string line = std::string("'") + ALIDADE_EXECUTABLE + "' track - --no-report --rig '" +
                           path("sim/rig.yaml") + "' --out '" + path("live") + "'";
  const Outcome live = testing::run_program({"sh", "-c", line + " < '" + path("sim/events.csv") + "'"});
  EXPECT_EQ(live.code, 0) << live.err;
  EXPECT_EQ(read_file(path("live/track.csv")), whole);
  EXPECT_EQ(live.out.substr(0, whole.find('\n')), whole.substr(0, whole.find('\n')));
  EXPECT_GT(std::count(live.out.begin(), live.out.end(), '\n'), std::count(whole.begin(), whole.end(), '\n'));

  const Outcome empty = testing::run_program({"sh", "-c", "head -1 '" + path("sim/events.csv") + "' | " + line});
  EXPECT_EQ(empty.code, 3);
  EXPECT_THAT(empty.err, ::testing::HasSubstr("-: has no events"));
  const Outcome cut =
      testing::run_program({"sh", "-c", "(head -5 '" + path("sim/events.csv") + "'; echo 1,2,x) | " + line});
  EXPECT_EQ(cut.code, 3);
  EXPECT_THAT(cut.err, ::testing::HasSubstr("-:6: has 3 cells"));
  EXPECT_EQ(read_file(path("live/track.csv")), whole);  // of the run before: a failed one leaves it
}

TEST_F(TrackCommand, ThePapersFilterStandsBesideOurs) {
  simulate("A");
  const auto rms_of = [&](const std::vector<std::string>& options) {
    std::vector<std::string> all{"--truth", path("sim/truth.csv"), "--json"};
    all.insert(all.end(), options.begin(), options.end());
    const Outcome outcome = track(all);
    EXPECT_EQ(outcome.code, 0) << outcome.err;
    return Json::parse(outcome.out)["estimate"]["rms_m"].get<double>();
  };
  const double ours = rms_of({}), literal = rms_of({"--method", "xiahou2015"});
  EXPECT_LT(ours, 0.0025);
  EXPECT_NEAR(literal, 0.0236, 0.0036);  // an independent simulation's figure
  EXPECT_LT(rms_of({"--method", "xiahou2015", "--corrected"}), 0.5 * literal);
}

TEST_F(TrackCommand, MistakesAreNamedAndRefused) {
  simulate("B");
  const auto refused_as = [&](const std::string& what) {
    const Outcome outcome = track({}, "changed.csv");
    EXPECT_EQ(outcome.code, 4) << what << outcome.out << outcome.err;
    EXPECT_NE(outcome.err.find(what), std::string::npos) << outcome.err;
    EXPECT_EQ(std::ranges::count(outcome.err, '\n'), 1) << outcome.err;
    EXPECT_FALSE(std::filesystem::exists(path("out/track.csv")));
    EXPECT_TRUE(std::filesystem::exists(path("out/result.json")));
  };
  write_changed(
      [](const Csv& csv, std::size_t row) { return csv.text(row, "head") == "1" ? row_of(csv, row, "", "") : ""; });
  refused_as("one head only");
  write_changed([](const Csv& csv, std::size_t row) {
    return row_of(csv, row, "head", csv.text(row, "head") == "1" ? "2" : "1");
  });
  refused_as("heads swapped");
  write_changed([](const Csv& csv, std::size_t row) {
    const auto degrees = [&](const char* name) { return std::to_string(csv.number(row, name) * 57.29577951308232); };
    return csv.text(row, "t_capture_s") + "," + csv.text(row, "t_arrival_s") + "," + csv.text(row, "head") + "," +
           degrees("pan_rad") + "," + degrees("tilt_rad") + "," + csv.text(row, "u_px") + "," + csv.text(row, "v_px") +
           "\n";
  });
  refused_as("angles in degrees");
  write_changed([](const Csv& csv, std::size_t row) {
    return csv.text(row, "t_capture_s") + "," + csv.text(row, "t_arrival_s") + "," + csv.text(row, "head") +
           ",0.1,0.2,160,120\n";
  });
  refused_as("parallel rays");
}

/// One head's clock is 30 ms ahead: the target would have to be twenty times as manoeuvring.
TEST_F(TrackCommand, AWrongClockIsNamed) {
  simulate("B");
  EXPECT_EQ(track({}).out.find("clock"), std::string::npos);
  const Csv csv = Csv::read(path("sim/events.csv"));
  std::vector<std::pair<double, std::string>> rows;
  for (std::size_t row = 0; row < csv.num_rows(); ++row) {
    const double late_s = csv.text(row, "head") == "2" ? 0.03 : 0.0;
    const double capture_s = csv.number(row, "t_capture_s") + late_s,
                 arrival_s = csv.number(row, "t_arrival_s") + late_s;
    rows.emplace_back(arrival_s, fmt::format("{:.6f},{:.6f},{},{},{},{},{}\n", capture_s, arrival_s,
                                             csv.text(row, "head"), csv.text(row, "pan_rad"), csv.text(row, "tilt_rad"),
                                             csv.text(row, "u_px"), csv.text(row, "v_px")));
  }
  std::ranges::stable_sort(rows, {}, &std::pair<double, std::string>::first);
  std::string text = "t_capture_s,t_arrival_s,head,pan_rad,tilt_rad,u_px,v_px\n";
  for (const auto& [arrival_s, row] : rows) text += row;
  write_file(path("changed.csv"), text);
  const Outcome outcome = track({}, "changed.csv");
  EXPECT_THAT(outcome.err, ::testing::HasSubstr("the clock of head 2 seems 30 ms ahead of that of head 1"));
}

TEST_F(TrackCommand, SaysWhatIsWrongWithItsInput) {
  simulate("B");
  const std::string header = "t_capture_s,t_arrival_s,head,pan_rad,tilt_rad,u_px,v_px\n";
  const auto expect = [&](const std::string& table, const std::string& what) {
    write_file(path("bad.csv"), table);
    const Outcome outcome = track({}, "bad.csv");
    EXPECT_EQ(outcome.code, 3) << table << outcome.err;
    EXPECT_NE(outcome.err.find(what), std::string::npos) << outcome.err;
    EXPECT_EQ(std::ranges::count(outcome.err, '\n'), 1) << outcome.err;
    EXPECT_FALSE(std::filesystem::exists(path("out")));
  };
  expect("", "bad.csv");
  expect(header, "has no events");
  expect("t_capture_s,head,pan_px,tilt_px,u_px,v_px\n0,1,1,1,1,1\n", "has no column 'pan_rad'");
  expect("t_capture_s,head,pan_rad,tilt_rad\n0,1,1,1\n", "has no column 'u_px'");
  expect(header + "0,0.1,3,0,0,1,1\n", "bad.csv:2: column 'head': '3' is not a head of the rig (1, 2)");
  expect(header + "0.2,0.1,1,0,0,1,1\n", "arrives before its capture");
  expect(header + "0,0.2,1,0,0,1,1\n0.05,0.1,2,0,0,1,1\n", "bad.csv:3: column 't_arrival_s': '0.1' runs backwards");
  expect(header + "0,0,1,0,0,1,1\n0,0,2,0,0,1,1\n0,0,1,0,0,1,1\n",
         "bad.csv:4: column 't_capture_s': '0' is in an earlier row");
  expect(header + "0,0,1,nan,0,1,1\n", "column 'pan_rad': 'nan' is not a finite number");
  expect(header + "0,0,1,0,0,1e9,1\n", "is in no image");
  EXPECT_EQ(track({"--method", "magic"}).code, 2);
  EXPECT_EQ(track({"--corrected"}).code, 2);
  EXPECT_EQ(track({"--min-depth", "30"}).code, 2);
  EXPECT_EQ(track({"--predict", "-1"}).code, 2);
  EXPECT_EQ(alidade({"simulate", "track", "--scenario", "Z", "--out", path("z")}).code, 2);
}

TEST_F(TrackCommand, SkipsBadRowsByName) {
  simulate("B");
  write_changed([](const Csv& csv, std::size_t row) {
    return row_of(csv, row, row == 30 ? "u_px" : "", row == 30 ? "nan" : "");
  });
  EXPECT_EQ(track({}, "changed.csv").code, 3);
  const Outcome outcome = track({"--skip-bad", "--json"}, "changed.csv");
  ASSERT_EQ(outcome.code, 0) << outcome.err;
  const Json document = Json::parse(outcome.out);
  ASSERT_EQ(document["counts"]["skipped"].size(), 1u);
  EXPECT_EQ(document["counts"]["skipped"][0]["line"], 32);
}

TEST_F(TrackCommand, SaysThatTheNoiseIsNotAsStated) {
  simulate("B", {"--sigma-px", "1.2"});
  const Outcome outcome = track({"--json", "--sigma-px", "0.5"});
  ASSERT_EQ(outcome.code, 0) << outcome.err;
  const Json verdict = Json::parse(outcome.out)["verdict"];
  EXPECT_NE(verdict["state"], "good");
  EXPECT_NE(verdict["sentence"].get<std::string>().find("noise is larger than stated"), std::string::npos) << verdict;
  const Outcome given = track({"--json", "--sigma-px", "1.2"});
  EXPECT_EQ(Json::parse(given.out)["verdict"]["state"], "good") << given.out;
}

TEST_F(TrackCommand, SaysWhereOneHeadWasAlone) {
  simulate("D");
  const Outcome outcome = track({"--json", "--sigma-a", "4"});
  ASSERT_EQ(outcome.code, 0) << outcome.err;
  const Json document = Json::parse(outcome.out);
  EXPECT_EQ(document["verdict"]["state"], "care");
  const Csv rows = Csv::read(path("out/track.csv"));
  std::size_t alone = 0;
  for (std::size_t row = 0; row < rows.num_rows(); ++row) alone += rows.text(row, "event") == "one_head" ? 1u : 0u;
  EXPECT_GT(alone, 5u);
}

TEST_F(TrackCommand, SmoothingLowersTheErrorWhereTheTargetTurns) {
  simulate("C");
  const Outcome outcome = track({"--smooth", "0.3", "--truth", path("sim/truth.csv")});
  ASSERT_EQ(outcome.code, 0) << outcome.err;
  const Json estimate = Json::parse(read_file(path("out/result.json")))["estimate"];
  // The filter's own test finds a ratio of 0.8 or less at 0.2 s.
  EXPECT_LT(estimate["smoothed_rms_m"].get<double>(), 0.8 * estimate["rms_m"].get<double>());
  const Csv csv = Csv::read(path("out/smoothed.csv"));
  EXPECT_GT(csv.num_rows(), 150U);  // 11 s at 20 Hz
  for (std::size_t row = 1; row < csv.num_rows(); ++row) EXPECT_GT(csv.number(row, "t_s"), csv.number(row - 1, "t_s"));
  EXPECT_EQ(track({"--smooth", "0.3", "--method", "imm"}).code, 2);
  EXPECT_EQ(track({"--smooth", "30"}).code, 2);
}

/// The pan and tilt of a real broadcast camera say where its players went; here they are three metres away.
TEST_F(TrackCommand, FollowsWhatARealOperatorFollowed) {
  const char* data = std::getenv("ALIDADE_DATA");
  if (!data) GTEST_SKIP() << "ALIDADE_DATA is not set: the motion of a broadcast camera is not at hand";
  const Csv motion = Csv::read(std::filesystem::path(data) / "data" / "ptz-sports" / "basketball_ptz.csv");
  constexpr double frames_per_s = 30.0, distance_m = 3.0, degree = 0.017453292519943295;
  constexpr std::size_t num = 1800;  // a minute
  std::string text = "t_s,x_m,y_m,z_m\n";
  for (std::size_t k = 0; k < num; ++k) {
    const double pan = degree * (motion.number(k, "pan_deg") - motion.number(0, "pan_deg")),
                 tilt = degree * (motion.number(k, "tilt_deg") - motion.number(0, "tilt_deg"));
    text += fmt::format("{:.6f},{:.6f},{:.6f},{:.6f}\n", static_cast<double>(k) / frames_per_s,
                        distance_m * std::sin(pan) * std::cos(tilt), -distance_m * std::sin(tilt),
                        distance_m * std::cos(pan) * std::cos(tilt));
  }
  write_file(path("path.csv"), text);
  simulate("G", {"--path", path("path.csv")});
  const std::string sigma_a = Json::parse(read_file(path("sim/result.json")))["estimate"]["sigma_a_m_s2"].dump();
  const Outcome outcome = track({"--truth", path("sim/truth.csv"), "--sigma-a", sigma_a, "--json"});
  ASSERT_EQ(outcome.code, 0) << outcome.err;
  const Json estimate = Json::parse(outcome.out)["estimate"];
  RecordProperty("rms_m", estimate["rms_m"].dump());
  RecordProperty("nees_per_dof", estimate["nees_per_dof"].dump());
  EXPECT_LE(estimate["rms_m"].get<double>(), 1.10 * estimate["pcrlb_m"].get<double>());
  EXPECT_GE(estimate["nees_per_dof"].get<double>(), 0.6);
  EXPECT_LE(estimate["nees_per_dof"].get<double>(), 1.3);
}

TEST_F(TrackCommand, ARecordedPathThatIsNoneIsNamed) {
  const auto fault = [&](const std::string& table) {
    write_file(path("path.csv"), table);
    const Outcome outcome = alidade({"simulate", "track", "--path", path("path.csv"), "--out", path("none")});
    EXPECT_EQ(outcome.code, 3) << outcome.err;
    return outcome.err;
  };
  EXPECT_NE(fault("t_s,x_m,y_m,z_m\n0,0,0,1\n").find("has one row"), std::string::npos);
  EXPECT_NE(fault("t_s,x_m,y_m,z_m\n0,0,0,1\n0,0,0,2\n").find("path.csv:3"), std::string::npos);
  EXPECT_NE(fault("t_s,x_m,y_m,z_m\n0,0,0,1\n1,1e300,0,nan\n").find("path.csv:3"), std::string::npos);
}

}  // namespace
}  // namespace alidade
