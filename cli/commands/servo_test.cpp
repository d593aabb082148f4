#include <fmt/format.h>
#include <gtest/gtest.h>

#include <algorithm>
#include <chrono>
#include <cmath>
#include <cstdlib>
#include <nlohmann/json.hpp>

#include "alidade/files/csv.h"
#include "alidade/files/files.h"
#include "alidade/testing/command_test.h"

namespace alidade {
namespace {

using testing::Outcome;
using Json = nlohmann::json;

class ServoCommand : public testing::CommandTest {
 protected:
  [[nodiscard]] Outcome servo(const std::string& scenario, const std::vector<std::string>& options = {}) {
    write_file(path("scenario.yaml"), scenario);
    return alidade({"servo", path("scenario.yaml"), "--out", path("out"), "--no-report"}, options);
  }
};

constexpr const char* brief = "seeds: 2\nduration_s: 6\nrobustness: {points: 2}\n";

TEST_F(ServoCommand, GivesTheNamesOfTheContract) {
  const Outcome outcome = servo(brief, {"--json"});
  ASSERT_EQ(outcome.code, 0) << outcome.err;
  const Json document = Json::parse(outcome.out);
  for (const std::string name : {"pi", "feedforward", "lqr", "mpc"}) {
    const Json& figures = document["estimate"]["controllers"][name];
    EXPECT_GT(figures["rms_px"], 0.0) << name;
    EXPECT_GE(figures["max_px"], figures["rms_px"]) << name;
    EXPECT_EQ(figures["central_third"], 1.0) << name;
  }
  EXPECT_LT(document["estimate"]["loops"]["pi"]["sampled_radius"], 1.0);
  EXPECT_GT(document["estimate"]["loops"]["pi"]["phase_margin_deg"], 90.0);
  for (const std::string name : {"bandwidth_rad_s", "phase_margin_deg", "loop_gain"})
    EXPECT_TRUE(document["estimate"]["loops"]["lqr"][name].is_null()) << name;  // it is tried
  const Json& control = document["data"]["control"];
  for (const std::string name :
       {"t_s", "head", "asked_pan_rad", "measured_tilt_rad", "predicted_pan_rad", "rate_pan_rad_s", "error_u_px"})
    EXPECT_EQ(control[name].size(), 2u * 121u) << name;
  const Json& trials = document["data"]["trials"];
  EXPECT_EQ(trials["controller"].size(), 8u);
  EXPECT_EQ(trials["p95_px"].size(), 8u);
  EXPECT_EQ(document["grids"]["robustness"]["rms_px"].size(), 4u);
  const Csv rows = Csv::read(path("out/servo.csv"));
  EXPECT_EQ(rows.num_rows(), 4u * 2u * 121u);
  EXPECT_TRUE(rows.has("error_v_px"));
  EXPECT_GT(document["data"]["steps"]["target_in_world_x_m"].size(), 200u);  // what track makes of the shown run
  EXPECT_GT(document["data"]["measurements"]["accepted"].size(), 200u);
  EXPECT_EQ(document["verdict"]["state"], "good");
}

/// Held to the clock, it takes as long as what it shows, and its figures are the same.
TEST_F(ServoCommand, RunsInRealTime) {
  const std::string three_seconds = "seeds: 1\nduration_s: 3\n";
  const std::vector<std::string> options{"--json", "--controller", "feedforward", "--no-robustness"};
  const Outcome fast = servo(three_seconds, options);
  std::vector<std::string> in_time = options;
  in_time.emplace_back("--realtime");
  const auto begin = std::chrono::steady_clock::now();
  const Outcome real = servo(three_seconds, in_time);
  const double took_s = std::chrono::duration<double>(std::chrono::steady_clock::now() - begin).count();
  ASSERT_EQ(fast.code, 0) << fast.err;
  ASSERT_EQ(real.code, 0) << real.err;
  EXPECT_GT(took_s, 2.9);
  const Json a = Json::parse(fast.out)["estimate"], b = Json::parse(real.out)["estimate"];
  EXPECT_EQ(a["controllers"], b["controllers"]);
  EXPECT_EQ(b["realtime"]["steps"], 2 * 61);  // two heads, 20 Hz
  EXPECT_LT(b["realtime"]["worst_late_s"], 0.5);
  EXPECT_FALSE(a.contains("realtime"));
}

/// The figures of the command are those of its rows.
TEST_F(ServoCommand, RmsIsThatOfItsRows) {
  const Outcome outcome = servo("seeds: 1\n", {"--json", "--controller", "lqr", "--latency-ms", "100"});
  ASSERT_EQ(outcome.code, 0) << outcome.err;
  const Csv rows = Csv::read(path("out/servo.csv"));
  double sum2 = 0.0;
  std::size_t count = 0;
  for (std::size_t row = 0; row < rows.num_rows(); ++row) {
    if (rows.number(row, "t_s") < 2.0) continue;
    const double u = rows.number(row, "error_u_px"), v = rows.number(row, "error_v_px");
    sum2 += u * u + v * v;
    ++count;
  }
  const double rms_px = Json::parse(outcome.out)["estimate"]["controllers"]["lqr"]["rms_px"];
  EXPECT_NEAR(rms_px, std::sqrt(sum2 / static_cast<double>(count)), 1e-4 * rms_px);  // 6 digits in the file
  EXPECT_LT(rms_px, 8.0 / 5.0);  // a fifth of the paper's controller
}

TEST_F(ServoCommand, TheHelpsScenarioIsThePreset) {
  const Outcome help = alidade({"servo", "--help"});
  const std::size_t begin = help.out.find("# Scenario of alidade servo");
  ASSERT_NE(begin, std::string::npos);
  const auto rms_of = [](const Outcome& outcome) {
    return Json::parse(outcome.out)["estimate"]["controllers"]["mpc"]["rms_px"].get<double>();
  };
  const std::vector<std::string> options{"--json", "--seeds", "2", "--no-robustness"};
  const Outcome written = servo(help.out.substr(begin), options);
  ASSERT_EQ(written.code, 0) << written.err;
  const Outcome left_out = servo("{}\n", options);
  ASSERT_EQ(left_out.code, 0) << left_out.err;
  EXPECT_NEAR(rms_of(written), rms_of(left_out), 1e-6);
}

TEST_F(ServoCommand, RefusesAnUnstableLoop) {
  const auto refused_as = [&](const std::string& scenario, const std::string& what) {
    const Outcome outcome = servo(scenario);
    EXPECT_EQ(outcome.code, 4) << scenario << outcome.out;
    EXPECT_NE(outcome.err.find(what), std::string::npos) << outcome.err;
    EXPECT_EQ(std::ranges::count(outcome.err, '\n'), 1) << outcome.err;
    EXPECT_FALSE(std::filesystem::exists(path("out/servo.csv")));
    EXPECT_TRUE(std::filesystem::exists(path("out/result.json")));
  };
  refused_as("plant: {gain: 0.0567, unit: rad}\n", "spectral radius 14.22");
  refused_as("plant: {gain: 0.0567, unit: rad}\n", "is the gain in deg? then the radius is 0.8766");
  refused_as("plant: {gain: -0.0567, unit: deg}\n", "unstable");
  refused_as("pi: {kp: 40, ki: 10, unit: px}\n", "unstable");
  refused_as("pi: {kp: 8, ki: 40, unit: px}\nlatency_s: 0.2\n", "loop of pi");
  // A controller is tried with the plant as it is, whatever kind it is.
  refused_as(
      "plant: {kind: rate, gain: 1, unit: rad, tau_s: 0.05}\npredictive: {rate_gain_per_s: 100}\n"
      "controllers: [feedforward]\n",
      "loop of feedforward");
  refused_as("mismatch: {gain: 5, tau: 1}\ncontrollers: [lqr, mpc]\n", "loop of lqr");
  // Nobody who leaves pi out is kept from running by it.
  EXPECT_EQ(servo("plant: {gain: 0.0567, unit: rad}\ncontrollers: [lqr]\nseeds: 1\n").code, 0);
}

TEST_F(ServoCommand, FollowsAWholeRatePlantWithStopsAndCoarseEncoders) {
  const Outcome outcome = servo(
      "plant: {kind: rate, pan_deg: [-60, 60], tilt_deg: [-10, 80], command_delay_s: 0.02}\n"
      "noise: {encoder_step_deg: 0.1}\ntarget: {radius_m: 0.2, period_s: 3}\nseeds: 2\nrobustness: {points: 0}\n",
      {"--json"});
  ASSERT_EQ(outcome.code, 0) << outcome.err;
  const Json controllers = Json::parse(outcome.out)["estimate"]["controllers"];
  for (const std::string name : {"feedforward", "lqr", "mpc"})
    EXPECT_LT(controllers[name]["rms_px"], 0.2 * controllers["pi"]["rms_px"].get<double>()) << name;
}

TEST_F(ServoCommand, TellsOfALossAndTheSearch) {
  const Outcome outcome =
      servo("hidden_s: [4, 5]\nseeds: 2\nrobustness: {points: 0}\n", {"--json", "--controller", "mpc"});
  ASSERT_EQ(outcome.code, 0) << outcome.err;
  const Json document = Json::parse(outcome.out);
  EXPECT_EQ(document["estimate"]["controllers"]["mpc"]["lost"], 4);
  EXPECT_EQ(document["estimate"]["controllers"]["mpc"]["found"], 4);
  EXPECT_NE(document["verdict"]["state"], "good");
  const std::string csv = read_file(path("out/servo.csv"));
  for (const std::string event : {",lost\n", ",searching\n", ",found\n"})
    EXPECT_NE(csv.find(event), std::string::npos) << event;
}

TEST_F(ServoCommand, SaysWhatIsWrongWithItsScenario) {
  const auto expect = [&](const std::string& scenario, const std::string& what) {
    const Outcome outcome = servo(scenario);
    EXPECT_EQ(outcome.code, 3) << scenario << outcome.out;
    EXPECT_NE(outcome.err.find(what), std::string::npos) << outcome.err;
    EXPECT_EQ(std::ranges::count(outcome.err, '\n'), 1) << outcome.err;
    EXPECT_FALSE(std::filesystem::exists(path("out")));
  };
  expect("", "is not a table of keys");
  expect("- 1\n", "is not a table of keys");
  expect("{", "is not YAML");
  expect("speed: 1\n", "speed: is not a key");
  expect("target: {colour: red}\n", "target.colour: is not a key");
  expect("target: {path: spiral}\n", "'spiral' is not one of still, circle");
  expect("target: {start_m: [1, 2]}\n", "must be three numbers");
  expect("target: {start_m: [1, 2, nan]}\n", "'nan' is not a finite number");
  expect("target: {period_s: 0}\n", "target.period_s: 0 is not between");
  expect("plant: {tau_s: -0.1}\n", "plant.tau_s: -0.1 is not between");
  expect("plant: {gain: 1e300, unit: deg}\n", "is beyond 1e12");
  expect("plant: {gain: 0, unit: deg}\n", "plant.gain: is zero");
  expect("plant: {gain: 2}\n", "plant.unit: is missing");
  expect("plant: {kind: stepper}\n", "'stepper' is not one of angle, rate");
  expect("plant: {max_acceleration_deg_s2: 0}\n", "max_acceleration_deg_s2");
  expect("plant: {pan_deg: [10, -10]}\n", "must be two angles, the lower one first");
  expect("pi: {kp: 2}\n", "pi.unit: is missing");
  expect("controllers: []\n", "names none");
  expect("controllers: [pi, pi]\n", "'pi' appears twice");
  expect("controllers: [fuzzy]\n", "'fuzzy' is not one of");
  expect("duration_s: 1\n", "is not longer than the warm-up");
  expect("latency_s: 9.99\nsample_period_s: 0.01\n", "more than 200 images late");
  expect("plant: {command_delay_s: 0.6}\nsample_period_s: 0.01\n",
         "plant.command_delay_s: 0.6 is more than 32 periods of 0.01 s");
  expect("seeds: 1.5\n", "is not a whole number");
  expect("seeds: 2\nseeds: 3\n", "appears twice");
  expect("hidden_s: [3, 2]\n", "3 is not before 2");
  expect("filter: {sigma_deg_s2: [1, 2]}\n", "must be one number, or 5");
  expect("rig: nowhere.yaml\n", "nowhere.yaml");
  EXPECT_EQ(servo("{}", {"--controller", "fuzzy"}).code, 2);
  EXPECT_EQ(servo("{}", {"--seeds", "0"}).code, 2);
  EXPECT_EQ(servo("{}", {"--latency-ms", "nan"}).code, 2);
  EXPECT_EQ(alidade({"servo"}).code, 2);
  EXPECT_EQ(alidade({"servo", path("none.yaml"), "--out", path("out")}).code, 3);
}

class IdentifyCommand : public testing::CommandTest {
 protected:
  [[nodiscard]] Outcome identify(const std::string& log, const std::vector<std::string>& options = {}) {
    return alidade({"identify", path(log), "--out", path("out"), "--no-report"}, options);
  }
};

TEST_F(IdentifyCommand, FindsTheSimulatedServo) {
  for (const std::string kind : {"angle", "rate"}) {
    for (const bool is_chirp : {false, true}) {
      std::vector<std::string> words{"simulate", "servo", "--kind", kind, "--out", path("sim"), "--quiet"};
      if (is_chirp) words.emplace_back("--chirp");
      const Outcome made = alidade(words);
      ASSERT_EQ(made.code, 0) << made.err;
      const Outcome outcome = identify("sim/log.csv", {"--json"});
      ASSERT_EQ(outcome.code, 0) << outcome.err;
      const Json document = Json::parse(outcome.out), &estimate = document["estimate"];
      const double gain = kind == "angle" ? 0.0567 : 0.3;
      const auto near = [&](const char* name, double truth) {
        // 4.5 σ: once in 100 000 of these four
        EXPECT_NEAR(estimate[name].get<double>(), truth, 4.5 * document["stddev"][name].get<double>()) << name << kind;
      };
      EXPECT_EQ(estimate["kind"], kind);
      near("gain_deg", gain);
      near("tau_s", 0.1);
      near("latency_s", 0.08);
      EXPECT_EQ(document["covariance"]["names"].size(), 5u);
      EXPECT_EQ(document["data"]["response"]["model_rad"].size(), 501u);
      EXPECT_NE(read_file(path("out/servo.yaml")).find("kind: " + kind), std::string::npos);
    }
  }
}

/// What identify writes, servo reads.
TEST_F(IdentifyCommand, ItsPlantIsAScenario) {
  ASSERT_EQ(alidade({"simulate", "servo", "--latency-s", "0.02", "--out", path("sim"), "--quiet"}).code, 0);
  ASSERT_EQ(identify("sim/log.csv").code, 0);
  write_file(path("scenario.yaml"), read_file(path("out/servo.yaml")) + "seeds: 1\nrobustness: {points: 0}\n");
  const Outcome outcome = alidade({"servo", path("scenario.yaml"), "--out", path("servo"), "--json"});
  ASSERT_EQ(outcome.code, 0) << outcome.err;
  const Json document = Json::parse(outcome.out);
  EXPECT_LT(document["estimate"]["controllers"]["lqr"]["rms_px"], 1.5);
  const Json identified = Json::parse(read_file(path("out/result.json")));
  for (const Json& one : document["assumed"])
    if (one["name"] == "plant.tau_s")
      EXPECT_NEAR(one["sigma"].get<double>(), identified["stddev"]["tau_s"].get<double>(), 1e-5);
  EXPECT_LT(document["estimate"]["loops"]["pi"]["radius_within_3_sigma"], 1.0);
  EXPECT_GT(document["estimate"]["loops"]["pi"]["radius_within_3_sigma"],
            document["estimate"]["loops"]["pi"]["sampled_radius"]);
}

TEST_F(IdentifyCommand, ItsRatePlantIsAScenarioToo) {
  ASSERT_EQ(
      alidade({"simulate", "servo", "--kind", "rate", "--latency-s", "0.02", "--out", path("sim"), "--quiet"}).code, 0);
  ASSERT_EQ(identify("sim/log.csv").code, 0);
  write_file(path("scenario.yaml"), read_file(path("out/servo.yaml")) + "seeds: 1\nrobustness: {points: 0}\n");
  const Outcome outcome = alidade({"servo", path("scenario.yaml"), "--out", path("servo"), "--json"});
  ASSERT_EQ(outcome.code, 0) << outcome.err;
  const Json controllers = Json::parse(outcome.out)["estimate"]["controllers"];
  EXPECT_LT(controllers["pi"]["rms_px"], 10.0);  // its preset is a loop of 4/s, whatever a unit of command is
  EXPECT_LT(controllers["mpc"]["rms_px"], 1.5);
}

TEST_F(IdentifyCommand, ReadsDegrees) {
  ASSERT_EQ(alidade({"simulate", "servo", "--out", path("sim"), "--quiet"}).code, 0);
  const Csv csv = Csv::read(path("sim/log.csv"));
  std::string text = "t_s,command,angle_deg\n";
  for (std::size_t row = 0; row < csv.num_rows(); ++row)
    text += csv.text(row, "t_s") + "," + csv.text(row, "command") + "," +
            std::to_string(csv.number(row, "angle_rad") * 57.29577951308232) + "\n";
  write_file(path("deg.csv"), text);
  const Outcome outcome = identify("deg.csv", {"--json"});
  ASSERT_EQ(outcome.code, 0) << outcome.err;
  EXPECT_NEAR(Json::parse(outcome.out)["estimate"]["gain_deg"].get<double>(), 0.0567, 3e-4);
}

TEST_F(IdentifyCommand, SaysWhatIsWrongWithItsLog) {
  const auto expect = [&](int code, const std::string& log, const std::string& what) {
    write_file(path("bad.csv"), log);
    const Outcome outcome = identify("bad.csv");
    EXPECT_EQ(outcome.code, code) << log.substr(0, 200) << outcome.err;
    EXPECT_NE(outcome.err.find(what), std::string::npos) << outcome.err;
    EXPECT_EQ(std::ranges::count(outcome.err, '\n'), 1) << outcome.err;
    EXPECT_EQ(std::filesystem::exists(path("out")), code == 4);
    std::filesystem::remove_all(path("out"));
  };
  const std::string header = "t_s,command,angle_rad\n";
  expect(3, "", "bad.csv");
  expect(3, header, "has no rows");
  expect(3, "t_s,command\n0,1\n", "has no column 'angle_rad'");
  expect(3, "t_s,command,angle_rad,angle_deg\n0,1,1,1\n", "has both");
  expect(3, header + "0,0,0\n0,0,0\n", "bad.csv:3: column 't_s': '0' is not after the row before it");
  expect(3, header + "0,0,0\n-1,0,0\n", "is not after the row before it");
  expect(3, header + "0,nan,0\n", "'nan' is not a finite number");
  expect(3, header + "0,1e300,0\n", "1e300");
  expect(3, header + "0,0,1e9\n", "is no angle of a servo");
  expect(4, header + "0,0,0\n0.1,1,0\n", "too few");
  const std::string timed = "t_s,command,angle_rad,command_t_s\n";
  expect(3, timed + "0,0,0,0\n0.1,1,0,0.2\n", "bad.csv:3: column 'command_t_s': '0.2' is not between");
  expect(3, timed + "0,0,0,0\n0.1,1,0,-0.1\n", "is not between the row before it and t_s");
  expect(3, timed + "0,0,0,nan\n", "'nan' is not a finite number");
  std::string still = header, flat = header;
  for (int i = 0; i < 100; ++i) {
    const std::string t = std::to_string(0.01 * i);
    still += t + ",1,0.5\n";
    flat += t + "," + (i < 20 ? "0" : "1") + ",0.5\n";
  }
  expect(4, still, "no excitation");
  expect(4, flat, "the angle never changes");
  EXPECT_EQ(alidade({"identify", path("none.csv"), "--out", path("out")}).code, 3);
  EXPECT_EQ(alidade({"simulate", "servo", "--tau-s", "-1", "--out", path("z")}).code, 2);
  EXPECT_EQ(alidade({"simulate", "servo", "--rate-hz", "100000", "--duration-s", "1000", "--out", path("z")}).code, 2);
  write_file(path("bad.csv"), header + "0,0,0\n0.1,x,0\n");
  EXPECT_EQ(identify("bad.csv", {"--skip-bad"}).code, 4);
}

/// The pan and tilt of a real broadcast camera (60 m away, say) are where its players went.
TEST_F(ServoCommand, FollowsWhatARealOperatorFollowed) {
  const char* data = std::getenv("ALIDADE_DATA");
  if (!data) GTEST_SKIP() << "ALIDADE_DATA is not set: the motion of a broadcast camera is not at hand";
  const Csv motion = Csv::read(std::filesystem::path(data) / "data" / "ptz-sports" / "basketball_ptz.csv");
  constexpr double frames_per_s = 30.0, distance_m = 60.0, degree = 0.017453292519943295;
  constexpr std::size_t first = 0, num = 900;  // half a minute
  const double pan0 = motion.number(first, "pan_deg"), tilt0 = motion.number(first, "tilt_deg");
  std::string path_csv = "t_s,x_m,y_m,z_m\n";
  for (std::size_t k = first; k < first + num; ++k) {
    const double pan = degree * (motion.number(k, "pan_deg") - pan0),
                 tilt = degree * (motion.number(k, "tilt_deg") - tilt0);
    path_csv += fmt::format("{},{},{},{}\n", static_cast<double>(k - first) / frames_per_s,
                            distance_m * std::sin(pan) * std::cos(tilt), -distance_m * std::sin(tilt),
                            distance_m * std::cos(pan) * std::cos(tilt));
  }
  write_file(path("path.csv"), path_csv);
  write_file(path("scenario.yaml"),
             "target: {track: path.csv}\nduration_s: 29\nlatency_s: 0.1\nrobustness: {points: 0}\nseeds: 4\n");
  const Outcome outcome = alidade({"servo", path("scenario.yaml"), "--out", path("out"), "--no-report", "--json"});
  ASSERT_EQ(outcome.code, 0) << outcome.err;
  const Json document = Json::parse(outcome.out);
  const Json& compared = document["estimate"]["controllers"];
  // PI lags a rotating target by its rate over the loop's 2.9 rad/s; a predictor does not.
  EXPECT_LT(compared["lqr"]["rms_px"].get<double>(), 0.5 * compared["pi"]["rms_px"].get<double>());
  EXPECT_EQ(compared["lqr"]["central_third"], 1.0);
  EXPECT_EQ(document["inputs"][1]["role"], "track");
}

TEST_F(ServoCommand, ARecordedPathThatIsNoneIsNamed) {
  write_file(path("scenario.yaml"), "target: {track: path.csv}\n");
  const auto fault = [&](const std::string& table) {
    write_file(path("path.csv"), table);
    const Outcome outcome = alidade({"servo", path("scenario.yaml"), "--out", path("out"), "--no-report"});
    EXPECT_EQ(outcome.code, 3) << outcome.err;
    return outcome.err;
  };
  EXPECT_NE(fault("t_s,x_m,y_m,z_m\n").find("path.csv"), std::string::npos);
  EXPECT_NE(fault("t_s,x_m,y_m,z_m\n0,0,0,1\n").find("has one row"), std::string::npos);
  EXPECT_NE(fault("t_s,x_m,y_m,z_m\n0,0,0,1\n0,0,0,2\n").find("path.csv:3"), std::string::npos);
  EXPECT_NE(fault("t_s,x_m,y_m,z_m\n0,0,0,1\n1,0,nan,2\n").find("'nan' is not a finite number"), std::string::npos);
}

/// A lens that zooms: by the rig's focal length, by the observer's, by the true one.
TEST_F(ServoCommand, ComparesWhatTheLoopKnowsOfAZoom) {
  const Outcome outcome = servo(
      "zoom: {t_s: [3, 7], factor: [1, 4]}\nduration_s: 11\nseeds: 2\ncontrollers: [feedforward]\nrobustness: {points: "
      "0}\n",
      {"--json"});
  ASSERT_EQ(outcome.code, 0) << outcome.err;
  const Json estimate = Json::parse(outcome.out)["estimate"], lenses = estimate["intrinsics"];
  EXPECT_LT(lenses["observed"]["rms_px"], 10.0);
  EXPECT_EQ(lenses["observed"]["rms_px"], estimate["controllers"]["feedforward"]["rms_px"]);
  EXPECT_GT(lenses["given"]["rms_px"], 20.0);
  EXPECT_LT(lenses["observed"]["rms_px"].get<double>(), 1.2 * lenses["true"]["rms_px"].get<double>());
  EXPECT_EQ(lenses["true"]["focal_share"], 0.0);
  const Csv rows = Csv::read(path("out/servo.csv"));
  const std::size_t last = rows.num_rows() - 1;
  EXPECT_NEAR(rows.number(last, "true_fx_px"), 4.0 * 337.84, 0.5);
  EXPECT_NEAR(rows.number(last, "fx_px"), rows.number(last, "true_fx_px"), 5.0 * rows.number(last, "sigma_fx_px"));
}

TEST_F(ServoCommand, RefusesAZoomThatIsNone) {
  for (const std::string zoom :
       {"{t_s: [3, 7], factor: [1]}", "{t_s: [7, 3], factor: [1, 2]}", "{t_s: [3], factor: [0]}",
        "{t_s: [], factor: []}", "{factor: [2]}", "{t_s: [1], factor: [2], speed: 1}"})
    EXPECT_EQ(servo("zoom: " + zoom + "\n").code, 3) << zoom;
  EXPECT_EQ(servo("intrinsics: guessed\n").code, 3);
  EXPECT_EQ(servo("background_points: 2\n").code, 3);
  EXPECT_EQ(servo("{}", {"--intrinsics", "guessed"}).code, 2);
}

}  // namespace
}  // namespace alidade
