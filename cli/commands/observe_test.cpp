#include <gtest/gtest.h>

#include <algorithm>
#include <cstdlib>
#include <nlohmann/json.hpp>
#include <sstream>

#include "alidade/files/files.h"
#include "alidade/testing/command_test.h"

namespace alidade {
namespace {

using testing::Outcome;

/// A simulated log, observed; what the command says and its exit code.
Outcome observe_motion(const std::string& motion) {
  const testing::TemporaryFolder folder;
  const std::string log = (folder.path() / "log").string(), out = (folder.path() / "out").string();
  const Outcome made = testing::run_program(
      {ALIDADE_EXECUTABLE, "simulate", "rotation", "--motion", motion, "--duration", "6", "--out", log});
  EXPECT_EQ(made.code, 0) << made.err;
  return testing::run_program(
      {ALIDADE_EXECUTABLE, "observe", log + "/log.csv", "--size", "780x582", "--out", out, "--no-report"});
}

TEST(Observe, RefusesByNameWhatTheMotionDoesNotDetermine) {
  EXPECT_EQ(observe_motion("sway").code, 0);
  const auto expect = [](const std::string& motion, const std::string& reason) {
    const Outcome outcome = observe_motion(motion);
    EXPECT_EQ(outcome.code, 4) << motion;
    EXPECT_NE(outcome.err.find(reason), std::string::npos) << outcome.err;
  };
  expect("pan", "pan only: fy cannot be determined; tilt the camera as well");
  expect("tilt", "tilt only: fx cannot be determined; pan the camera as well");
  expect("roll", "roll only");
  expect("still", "does not turn");
}

/// Tables up to 20 000 rows are whole; of longer ones all rows are in a file beside.
TEST(Observe, TheResultHoldsALogOfThousandsOfRows) {
  const testing::TemporaryFolder folder;
  const std::string log = (folder.path() / "log").string(), out = (folder.path() / "out").string();
  ASSERT_EQ(testing::run_program({ALIDADE_EXECUTABLE, "simulate", "rotation", "--duration", "170", "--out", log}).code,
            0);
  const Outcome outcome =
      testing::run_program({ALIDADE_EXECUTABLE, "observe", log + "/log.csv", "--size", "780x582", "--out", out});
  ASSERT_EQ(outcome.code, 0) << outcome.err;
  const auto data = nlohmann::json::parse(read_file(out + "/result.json"))["data"];
  EXPECT_EQ(data["steps"]["t_s"].size(), 5101u);
  EXPECT_FALSE(data["steps"].contains("thinned"));
  const auto& points = data["points"];
  EXPECT_EQ(points["thinned"]["from"], 4 * 5101);
  const std::vector<double> kept = points["residual_u_px"];
  EXPECT_LE(kept.size(), 20'000u);
  double largest = 0.0;
  std::istringstream rows(read_file(out + "/points_all.csv"));
  std::string row;
  std::getline(rows, row);
  ASSERT_EQ(row, "step,point,u_px,v_px,residual_u_px,residual_v_px");
  std::size_t count = 0;
  for (; std::getline(rows, row); ++count) {
    for (int skip = 0; skip < 4; ++skip) row.erase(0, row.find(',') + 1);
    largest = std::max(largest, std::stod(row));
  }
  EXPECT_EQ(count, 4u * 5101u);
  EXPECT_EQ(*std::max_element(kept.begin(), kept.end()), largest) << "extremes stay";
}

TEST(Observe, SaysWhatIsWrongWithItsInput) {
  const testing::TemporaryFolder folder;
  const auto expect = [&](const std::vector<std::string>& arguments, int code, const std::string& what) {
    std::vector<std::string> command{ALIDADE_EXECUTABLE, "observe", "--out", (folder.path() / "out").string()};
    command.insert(command.end(), arguments.begin(), arguments.end());
    const Outcome outcome = testing::run_program(command);
    EXPECT_EQ(outcome.code, code) << outcome.err;
    EXPECT_NE(outcome.err.find(what), std::string::npos) << outcome.err;
  };
  expect({}, 2, "give one of a rotation log, photos, --video FILE and --pairs FILE");
  expect({"none.csv", "--method", "best"}, 2, "--method");
  expect({"none.csv", "--estimate", "k9"}, 2,
         "--estimate: 'k9' is not auto, none, k1, k2, k3, p1, p2, mount, delay, lever, shutter, focal-drift, scale, "
         "backlash, curve, axes, drift, bias or clock");
  expect({"none.csv", "--start", "1,2,3,nan"}, 2, "--start");
  expect({(folder.path() / "none.csv").string()}, 3, "none.csv");
  EXPECT_FALSE(std::filesystem::exists(folder.path() / "out"));
}

/// A small log with one cell or line made wrong.
class BadLog : public testing::CommandTest {
 protected:
  void SetUp() override {
    const Outcome made =
        testing::run_program({ALIDADE_EXECUTABLE, "simulate", "rotation", "--duration", "3", "--out", path("made")});
    ASSERT_EQ(made.code, 0) << made.err;
    good_ = read_file(path("made/log.csv"));
  }

  Outcome observe(const std::string& text, const std::vector<std::string>& options = {}) const {
    write_file(path("log.csv"), text);
    std::vector<std::string> command{ALIDADE_EXECUTABLE, "observe",     path("log.csv"), "--size",
                                     "780x582",          "--no-report", "--out",         path("out")};
    command.insert(command.end(), options.begin(), options.end());
    return testing::run_program(command);
  }

  /// Cell `column` of data row `row` replaced.
  [[nodiscard]] std::string with_cell(std::size_t row, std::size_t column, const std::string& cell) const {
    std::size_t at = 0;
    for (std::size_t i = 0; i <= row; ++i) at = good_.find('\n', at) + 1;
    for (std::size_t i = 0; i < column; ++i) at = good_.find(',', at) + 1;
    const std::size_t end = good_.find_first_of(",\n", at);
    return good_.substr(0, at) + cell + good_.substr(end);
  }

  void expect_bad_input(const std::string& text, const std::string& what) const {
    const Outcome outcome = observe(text);
    EXPECT_EQ(outcome.code, 3) << outcome.err;
    EXPECT_NE(outcome.err.find(what), std::string::npos) << outcome.err;
    EXPECT_EQ(std::ranges::count(outcome.err, '\n'), 1) << outcome.err;
    EXPECT_FALSE(std::filesystem::exists(path("out")));
  }

  std::string good_;
};

TEST_F(BadLog, IsNamedByLineAndColumn) {
  expect_bad_input("", "log.csv");
  expect_bad_input(good_.substr(0, good_.find('\n') + 1), "log.csv");
  expect_bad_input(with_cell(4, 1, "nan"), "log.csv:6: column 'omega_x'");
  expect_bad_input(with_cell(4, 1, "fast"), "log.csv:6: column 'omega_x'");
  expect_bad_input(with_cell(4, 5, "inf"), "log.csv:6");
  expect_bad_input(with_cell(4, 5, "1e300"), "log.csv:6");
  expect_bad_input(with_cell(4, 0, ""), "log.csv:6: column 't'");
  expect_bad_input("time,wx,wy\n0,1,2\n", "log.csv");
  std::string without_rotation = good_;
  without_rotation.replace(without_rotation.find("omega_x"), 7, "omega_q");
  expect_bad_input(without_rotation, "omega");
}

TEST_F(BadLog, IsRejectedByNameWhereAsked) {
  const Outcome outcome = observe(with_cell(4, 5, "broken"), {"--skip-bad", "--json"});
  ASSERT_EQ(outcome.code, 0) << outcome.err;
  const auto document = nlohmann::json::parse(outcome.out);
  EXPECT_EQ(document["counts"]["given"], 91);
  EXPECT_EQ(document["counts"]["skipped"].size(), 1u);
  EXPECT_NE(document["counts"]["skipped"].dump().find("6"), std::string::npos);
}

TEST_F(BadLog, GoodRowsGiveTheNamesOfTheContract) {
  const Outcome outcome = observe(good_, {"--json"});
  ASSERT_EQ(outcome.code, 0) << outcome.err;
  const auto document = nlohmann::json::parse(outcome.out);
  EXPECT_EQ(document["command"], "observe");
  for (const char* name : {"fx", "fy", "cx", "cy"}) {
    const double value = document["estimate"]["camera"][name], sigma = document["stddev"]["camera"][name],
                 bound = document["estimate"]["bound"][name];
    EXPECT_GT(value, 100.0);
    EXPECT_GT(sigma, 0.5 * bound);
    EXPECT_LT(sigma, 2.0 * bound);
  }
  EXPECT_NEAR(document["estimate"]["camera"]["fx"], 710.0, 5.0 * document["stddev"]["camera"]["fx"].get<double>());
  const std::string table = read_file(path("out/intrinsics.csv"));
  EXPECT_EQ(table.substr(0, table.find('\n')), "t_s,fx,fy,cx,cy,sigma_fx,sigma_fy,sigma_cx,sigma_cy,nis,event");
  EXPECT_EQ(std::ranges::count(table, '\n'), 92);
}

TEST_F(BadLog, RowsFromStandardInputAreAnsweredOneByOne) {
  write_file(path("log.csv"), good_);
  const Outcome outcome =
      testing::run_program({"/bin/sh", "-c",
                            std::string("'") + ALIDADE_EXECUTABLE + "' observe - --size 780x582 --no-report --out '" +
                                path("out") + "' < '" + path("log.csv") + "'"});
  ASSERT_EQ(outcome.code, 0) << outcome.err;
  std::size_t rows = 0;
  for (std::size_t at = 0; (at = outcome.out.find('\n', at)) != std::string::npos; ++at) ++rows;
  EXPECT_GE(rows, 92u);
  EXPECT_EQ(outcome.out.substr(0, 4), "t_s,");
}

/// A rendered video of a textured world: what a user with a pan-tilt camera and its encoders has.
class Film : public testing::CommandTest {
 protected:
  void render(const std::string& duration_s) {
    const Outcome made = testing::run_program(
        {ALIDADE_EXECUTABLE, "simulate", "rotation", "--video", "--source", "head", "--size", "640x480", "--intrinsics",
         "610,600,330,235", "--duration", duration_s, "--rate", "15", "--no-report", "--out", path("film")});
    ASSERT_EQ(made.code, 0) << made.err;
  }
};

TEST_F(Film, GivesFocalLengthsWithinThreePerMilleAndThreeSigma) {
  render("4");
  const Outcome outcome = testing::run_program({ALIDADE_EXECUTABLE, "observe", "--video", path("film/frames"),
                                                "--angles", path("film/angles.csv"), "--json", "--out", path("out")});
  ASSERT_EQ(outcome.code, 0) << outcome.err;
  const auto document = nlohmann::json::parse(outcome.out);
  const std::vector<std::pair<const char*, double>> truth{{"fx", 610.0}, {"fy", 600.0}, {"cx", 330.0}, {"cy", 235.0}};
  for (const auto& [name, value] : truth) {
    const double estimate = document["estimate"]["camera"][name], sigma = document["stddev"]["camera"][name];
    RecordProperty(name, std::to_string(estimate) + " +- " + std::to_string(sigma));
    if (name[0] == 'f') {
      EXPECT_NEAR(estimate, value, 0.003 * value) << name;
    }
    EXPECT_NEAR(estimate, value, 3.0 * sigma) << name;
  }
}

TEST_F(Film, SaysWhatDoesNotFit) {
  render("1");
  const auto expect = [&](const std::vector<std::string>& arguments, int code, const std::string& what) {
    std::vector<std::string> command{ALIDADE_EXECUTABLE, "observe", "--out", path("out")};
    command.insert(command.end(), arguments.begin(), arguments.end());
    const Outcome outcome = testing::run_program(command);
    EXPECT_EQ(outcome.code, code) << outcome.err;
    EXPECT_NE(outcome.err.find(what), std::string::npos) << outcome.err;
    EXPECT_FALSE(std::filesystem::exists(path("out")));
  };
  const std::string frames = path("film/frames"), angles = path("film/angles.csv");
  expect({"--video", frames}, 2, "--video and --angles go together");
  expect({"--video", frames, "--angles", path("none.csv")}, 3, "none.csv");
  expect({"--video", path("none.mp4"), "--angles", angles}, 3, "none.mp4");
  expect({"--video", frames, "--angles", angles, "--rate", "10"}, 3, "angles.csv: covers");
  expect({"--video", frames, "--angles", angles, "--size", "320x240"}, 3, "frames are 640x480");
  write_file(frames + "/000012.png", "not an image");
  expect({"--video", frames, "--angles", angles}, 3, "000012.png");
}

/// Photos and matches of a simulated camera rotated by hand, and what `observe` says of them.
class ObservePhotos : public testing::CommandTest {
 protected:
  Outcome simulate(const std::vector<std::string>& options) {
    return run_in("simulate", "rotation", options, path("sim"));
  }
  Outcome observe(const std::vector<std::string>& options) { return run_in("observe", "", options, path("out")); }
  static double value(const Outcome& outcome, const char* part, const char* name) {
    return nlohmann::json::parse(outcome.out)[part]["camera"][name].get<double>();
  }

 private:
  static Outcome run_in(const std::string& command, const std::string& what, const std::vector<std::string>& options,
                        const std::string& out) {
    std::vector<std::string> line{ALIDADE_EXECUTABLE, command};
    if (!what.empty()) line.push_back(what);
    line.insert(line.end(), {"--out", out, "--no-report", "--json"});
    line.insert(line.end(), options.begin(), options.end());
    return testing::run_program(line);
  }
};

TEST_F(ObservePhotos, TellTheFocalLengthByThemselves) {
  ASSERT_EQ(simulate({"--photos", "6", "--intrinsics", "710,710,395,287", "--wrong", "0.3"}).code, 0);
  const Outcome photos = observe({path("sim/photos"), "--rotation", "free"});
  ASSERT_EQ(photos.code, 0) << photos.err;
  EXPECT_NEAR(value(photos, "estimate", "fx"), 710.0, 3.0 * value(photos, "stddev", "fx"));
  EXPECT_NEAR(value(photos, "estimate", "fx"), 710.0, 4.0);
  EXPECT_TRUE(std::filesystem::exists(path("out/camera.yaml")));
  // what it matched can be used again, and so can external matches of which a third are wrong
  for (const char* pairs : {"out/pairs.csv", "sim/pairs.csv"}) {
    const Outcome again = observe({"--pairs", path(pairs), "--size", "780x582", "--square-pixels"});
    ASSERT_EQ(again.code, 0) << again.err;
    EXPECT_NEAR(value(again, "estimate", "fx"), 710.0, 3.0 * value(again, "stddev", "fx"));
  }
}

TEST_F(ObservePhotos, AreRefusedByNameWhereTheyCannotTell) {
  const auto expect = [&](const std::vector<std::string>& options, int code, const std::string& what) {
    const Outcome outcome = observe(options);
    EXPECT_EQ(outcome.code, code) << outcome.err;
    EXPECT_NE(outcome.err.find(what), std::string::npos) << outcome.err;
  };
  ASSERT_EQ(
      simulate({"--photos", "5", "--zoomed", "1.25", "--size", "640x480", "--intrinsics", "600,600,320,240"}).code, 0);
  expect({path("sim/photos")}, 4, "photo003.png (1.25");
  expect({path("sim/photos/photo001.png"), path("sim/photos/photo002.png")}, 4, "only two photos");
  expect({path("sim/photos"), "--size", "100x100"}, 3, "the photos are 640x480");
  expect({path("sim/photos"), "--rotation", "noisy"}, 2, "--rotation noisy");
  expect({path("sim/photos"), "--estimate", "mount"}, 2, "--estimate is auto, none, k1 or k2");
  expect({path("sim/photos"), "--pairs", path("sim/pairs.csv")}, 2, "give one of");
  expect({path("sim/none.jpg")}, 3, "none.jpg");
  expect({"--pairs", path("sim/pairs.csv"), "--size", "300x200"}, 3, "lie outside");
}

/// Seven photos of a camera rotated by hand, with external matches and with ours. 5.7 mm before a sensor of 1/2.3 inch:
/// 1172 to 1211 px.
TEST(Observe, ARealCameraTurnedByHandTellsItsFocalLengthAndSaysWhatItCannot) {
  const char* data = std::getenv("ALIDADE_DATA");
  if (!data) GTEST_SKIP() << "ALIDADE_DATA is not set: the photos of a real camera are not at hand";
  const testing::TemporaryFolder folder;
  const std::string set = std::string(data) + "/data/rot-prexy";
  const auto observe = [&](const std::vector<std::string>& options) {
    std::vector<std::string> command{ALIDADE_EXECUTABLE, "observe", "--rotation", "free",
                                     "--no-report",      "--json",  "--out",      (folder.path() / "out").string()};
    command.insert(command.end(), options.begin(), options.end());
    return testing::run_program(command);
  };
  const std::string pairs = set + "/correspondences.csv";
  const Outcome free = observe({"--pairs", pairs, "--size", "1280x960"});
  EXPECT_EQ(free.code, 4);
  EXPECT_NE(free.err.find("cannot determine fx / fy"), std::string::npos) << free.err;
  EXPECT_NE(free.err.find("--square-pixels"), std::string::npos) << free.err;
  for (const std::vector<std::string>& options :
       {std::vector<std::string>{"--pairs", pairs, "--size", "1280x960", "--square-pixels"},
        std::vector<std::string>{set}}) {
    const Outcome outcome = observe(options);
    ASSERT_EQ(outcome.code, 0) << outcome.err;
    const auto document = nlohmann::json::parse(outcome.out);
    EXPECT_NEAR(document["estimate"]["camera"]["fx"], 1190.0, 0.03 * 1190.0);
    EXPECT_NEAR(document["estimate"]["camera"]["fx"], 1190.0, 3.0 * document["stddev"]["camera"]["fx"].get<double>());
    EXPECT_EQ(document["counts"]["used"], 7);
  }
  const Outcome held = observe({"--pairs", pairs, "--size", "1280x960", "--square-pixels", "--fix-centre"});
  ASSERT_EQ(held.code, 0) << held.err;
  const auto document = nlohmann::json::parse(held.out);
  EXPECT_NEAR(document["estimate"]["camera"]["fx"], 1190.0, 0.05 * 1190.0);
  EXPECT_NE(held.out.find("omit --fix-centre"), std::string::npos);
}

}  // namespace
}  // namespace alidade
