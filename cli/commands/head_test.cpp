#include <fmt/format.h>
#include <netinet/in.h>
#include <sys/socket.h>
#include <unistd.h>

#include <algorithm>
#include <array>
#include <chrono>
#include <cmath>
#include <cstdio>
#include <nlohmann/json.hpp>
#include <sstream>
#include <thread>

#include "alidade/testing/command_test.h"

// Heads by the command: simulated ones, and Hamlib's where it is installed.

namespace alidade {
namespace {

class HeadCommand : public testing::CommandTest {};

constexpr double degree_rad = 0.017453292519943295;

/// A port of this machine that nobody uses now.
int free_port() {
  const int socket = ::socket(AF_INET, SOCK_STREAM, 0);
  sockaddr_in address{};
  address.sin_family = AF_INET;
  address.sin_addr.s_addr = htonl(INADDR_LOOPBACK);
  ::bind(socket, reinterpret_cast<sockaddr*>(&address), sizeof address);
  socklen_t size = sizeof address;
  ::getsockname(socket, reinterpret_cast<sockaddr*>(&address), &size);
  ::close(socket);
  return ntohs(address.sin_port);
}

TEST_F(HeadCommand, AsksAndMovesNothing) {
  const testing::Outcome outcome = alidade({"head", "sim://?clock=free", "--json", "--out", path("out")});
  ASSERT_EQ(outcome.code, 0) << outcome.err;
  const auto document = nlohmann::json::parse(outcome.out);
  EXPECT_EQ(document["data"]["readings"]["t_s"].size(), 100u);
  EXPECT_FALSE(document["estimate"].contains("rate_rad_s"));
}

TEST_F(HeadCommand, IdentifiesASimulatedHead) {
  const testing::Outcome outcome = alidade({"head", "sim://?rate=30&accel=200&tau=0.08&latency=0.06&clock=free",
                                            "--identify", "--move", "--json", "--out", path("out")});
  ASSERT_EQ(outcome.code, 0) << outcome.err;
  const auto document = nlohmann::json::parse(outcome.out);
  for (const char* axis : {"pan", "tilt"}) {
    const auto &estimate = document["estimate"]["axes"][axis], &stddev = document["stddev"]["axes"][axis];
    for (const char* name : {"rate_rad_s", "acceleration_rad_s2", "time_constant_s", "latency_s", "backlash_rad",
                             "dead_band_rad", "resolution_rad", "repeatability_rad"}) {
      EXPECT_TRUE(estimate[name].is_number()) << name;
      EXPECT_TRUE(stddev[name].is_number()) << name;
    }
    EXPECT_NEAR(estimate["rate_rad_s"].get<double>(), 30.0 * degree_rad, 3.0 * stddev["rate_rad_s"].get<double>());
  }
}

TEST_F(HeadCommand, CalibratesAndFollows) {
  const std::string head = "sim://?rate=8&clock=free";
  const testing::Outcome calibrated = alidade({"head", head, "--stream", "sim://?delay=0.04", "--calibrate", "--move",
                                               "--pan-range", "-60,60", "--until", "0.5%", "--out", path("out")});
  ASSERT_EQ(calibrated.code, 0) << calibrated.err;
  for (const char* file : {"camera.yaml", "rig.yaml", "log.csv", "result.json", "report.html"})
    EXPECT_TRUE(std::filesystem::exists(path("out") + "/" + file)) << file;
  const testing::Outcome followed =
      alidade({"head", head, "--stream", "sim://?delay=0.04&target=4:0:3:20:1.2", "--rig", path("out") + "/rig.yaml",
               "--follow", "bright", "--move", "--most", "15", "--latency", "0.04", "--delay", "-0.04", "--json",
               "--out", path("followed")});
  ASSERT_EQ(followed.code, 0) << followed.err;
  const auto document = nlohmann::json::parse(followed.out);
  EXPECT_LT(document["estimate"]["rms_px"].get<double>(), 12.0);
  EXPECT_GT(document["estimate"]["central_third"].get<double>(), 0.9);
}

TEST_F(HeadCommand, RefusesWhatCannotBe) {
  EXPECT_EQ(alidade({"head", "sim://", "--identify"}).code, 2);
  EXPECT_EQ(alidade({"head", "sim://", "--pan-range", "5,-5"}).code, 2);
  EXPECT_EQ(alidade({"head", "sim://", "--follow", "bright", "--move"}).code, 2);
  EXPECT_EQ(alidade({"head", "sim://", "--calibrate", "--move"}).code, 2);
  EXPECT_EQ(alidade({"head", "sim://", "--pan-range", "nan,5"}).code, 2);
  EXPECT_EQ(alidade({"head", "sim://?lie=often"}).code, 3);
  EXPECT_EQ(alidade({"head", "ftp://here"}).code, 3);
  EXPECT_EQ(alidade({"head", fmt::format("rotctl://127.0.0.1:{}", free_port())}).code, 3);
  EXPECT_EQ(alidade({"head", "sim://", "--resume", "somewhere"}).code, 2);
  EXPECT_EQ(
      alidade({"head", "sim://?clock=free", "--stream", "sim://", "--calibrate", "--move", "--resume", path("none")})
          .code,
      3);
  EXPECT_EQ(alidade({"head", "sim://?clock=free", "--password-file", path("none")}).code, 3);
  EXPECT_EQ(alidade({"simulate", "head", "--onvif", "0", "--user", "me"}).code, 2);
}

TEST_F(HeadCommand, PasswordsAreRefusedInAddressesAndAppearNowhere) {
  const std::string sim = "sim://?clock=free";
  const std::vector<std::vector<std::string>> lines{
      {"head", "rotctl://me:hunter2@127.0.0.1:4533"},
      {"head", "onvif://me:hunter2@127.0.0.1"},
      {"head", "indi://me:hunter2@127.0.0.1/Mount"},
      {"head", "telnet://me:hunter2@127.0.0.1"},
      {"head", sim, "--stream", "http://me:hunter2@127.0.0.1/", "--calibrate", "--move"},
      {"head", sim, "--stream", "rtsp://me:hunter2@127.0.0.1/", "--calibrate", "--move"},
      {"head", sim, "--stream", "http://127.0.0.1/a?user=me&pwd=hunter2", "--calibrate", "--move"},
      {"head", sim, "--stream", "ftp://me:hunter2@127.0.0.1/", "--calibrate", "--move"}};
  for (std::vector<std::string> line : lines) {
    line.insert(line.end(), {"--out", path("out")});
    const testing::Outcome outcome = alidade(line);
    EXPECT_EQ(outcome.code, 3) << line[1];
    EXPECT_EQ((outcome.out + outcome.err).find("hunter2"), std::string::npos) << outcome.err;
    EXPECT_FALSE(std::filesystem::exists(path("out"))) << line[1];
  }
}

/// Every file below and both outputs, in one text.
std::string all_text(const testing::Outcome& outcome, const std::string& folder) {
  std::string text = outcome.out + outcome.err;
  for (const auto& each : std::filesystem::recursive_directory_iterator(folder))
    if (each.is_regular_file()) text += read_file(each.path());
  return text;
}

TEST_F(HeadCommand, AsksANetworkCameraWithItsPasswordFromAFile) {
  const int port = free_port();
  write_file(path("secret.txt"), "hunter2-of-the-camera\n");
  const std::string url = fmt::format("onvif://admin@127.0.0.1:{}/?az=-170:170&el=-30:60", port);
  const auto meanwhile = [&](pid_t server) {
    std::this_thread::sleep_for(std::chrono::milliseconds(700));
    const testing::Outcome asked =
        alidade({"head", url, "--password-file", path("secret.txt"), "--move", "--json", "--out", path("out")});
    EXPECT_EQ(asked.code, 0) << asked.err;
    EXPECT_EQ(all_text(asked, path("out")).find("hunter2"), std::string::npos);
    const auto document = nlohmann::json::parse(asked.out);
    EXPECT_NEAR(document["estimate"]["high_rad"][0].get<double>(), 170.0 * degree_rad, 1e-6);
    EXPECT_GT(document["estimate"]["rate_rad_s"][0].get<double>(), 3.0 * degree_rad);
    write_file(path("wrong.txt"), "hunter3\n");
    const testing::Outcome refused =
        alidade({"head", url, "--password-file", path("wrong.txt"), "--out", path("none")});
    EXPECT_EQ(refused.code, 3);
    EXPECT_NE(refused.err.find("refuses the user or the password"), std::string::npos) << refused.err;
    EXPECT_EQ(refused.err.find("hunter3"), std::string::npos) << refused.err;
    ::kill(server, SIGTERM);
  };
  ::setenv("ALIDADE_PASSWORD", "hunter2-of-the-camera", 1);
  (void)testing::run_program(
      {ALIDADE_EXECUTABLE, "simulate", "head", "--onvif", std::to_string(port), "--user", "admin", "--seconds", "30"},
      "", meanwhile);
  ::unsetenv("ALIDADE_PASSWORD");
}

std::vector<std::string> calibrating_simulated(const std::string& camera, const std::string& out) {
  return {"head",
          "sim://?rate=8&clock=free",
          "--stream",
          "sim://?delay=0.04" + camera,
          "--calibrate",
          "--move",
          "--pan-range",
          "-60,60",
          "--most",
          "45",
          "--json",
          "--out",
          out};
}

TEST_F(HeadCommand, WhatWasMeasuredBeforeCountsAfterResume) {
  std::vector<std::string> second = calibrating_simulated("", path("second"));
  second.insert(second.end(), {"--resume", path("first")});
  const testing::Outcome before = alidade(calibrating_simulated("", path("first"))), after = alidade(second);
  ASSERT_EQ(before.code, 0) << before.err;
  ASSERT_EQ(after.code, 0) << after.err;
  const auto one = nlohmann::json::parse(before.out), two = nlohmann::json::parse(after.out);
  EXPECT_GT(two["counts"]["given"].get<int>(), 3 * one["counts"]["given"].get<int>() / 2);
  // By the pixels' noise: typical instrument errors, which are added, do not decrease with rows.
  for (const char* name : {"fx", "fy", "cx", "cy"})
    EXPECT_LT(two["stddev_model"]["camera"][name].get<double>(),
              0.85 * one["stddev_model"]["camera"][name].get<double>())  // of twice the rows: 0.71
        << name;
  EXPECT_NEAR(two["estimate"]["camera"]["fx"].get<double>(), 350.0, 4.0 * two["stddev"]["camera"]["fx"].get<double>());
  EXPECT_FALSE(std::filesystem::exists(path("second") + "/so-far"));  // it ended
  // The log of a run that was killed while it replaced it.
  const std::filesystem::path so_far = path("first") + "/so-far", hidden = so_far / ".alidade-killed";
  std::filesystem::create_directories(hidden / "new");
  std::filesystem::create_directories(hidden / "older");
  std::filesystem::copy(path("first") + "/log.csv", hidden / "older/log.csv");
  *std::ranges::find(second, "45") = "15";
  const testing::Outcome after_kill = alidade(second);
  ASSERT_EQ(after_kill.code, 0) << after_kill.err;
  EXPECT_EQ(nlohmann::json::parse(after_kill.out)["inputs"][0]["name"], (so_far / "log.csv").string())
      << "not the log of the run before it";
}

TEST_F(HeadCommand, TimeStampsThatJumpAreNamedAndNotUsed) {
  const testing::Outcome outcome = alidade(calibrating_simulated("&jump=0.3", path("out")));
  ASSERT_EQ(outcome.code, 0) << outcome.err;
  const auto document = nlohmann::json::parse(outcome.out);
  EXPECT_GT(document["estimate"]["time_stamp_jumps"].get<int>(), 3);
  EXPECT_EQ(document["estimate"]["frame_times"], "arrival");
  EXPECT_NE(document["verdict"]["sentence"].get<std::string>().find("time stamps jump"), std::string::npos);
  EXPECT_NEAR(document["estimate"]["camera"]["fx"].get<double>(), 350.0,
              4.0 * document["stddev"]["camera"]["fx"].get<double>());
}

/// Pan and tilt at the end of a truth file, and whether they were constant for the last half second.
struct TruthEnd {
  double pan = 0.0, tilt = 0.0, moved = 0.0;
};
TruthEnd end_of(const std::string& csv) {
  std::istringstream lines(read_file(csv));
  std::vector<std::array<double, 2>> rows;
  for (std::string line; std::getline(lines, line);) {
    double number = 0, t = 0, shown = 0, pan = 0, tilt = 0;
    if (std::sscanf(line.c_str(), "%lf,%lf,%lf,%lf,%lf", &number, &t, &shown, &pan, &tilt) == 5)
      rows.push_back({pan, tilt});
  }
  TruthEnd end;
  if (rows.size() < 10) return end;
  end.pan = rows.back()[0];
  end.tilt = rows.back()[1];
  const auto& before = rows[rows.size() - 6];
  end.moved = std::hypot(end.pan - before[0], end.tilt - before[1]);
  return end;
}

/// Our head as a server while `during` runs, with the ports.
void with_server(const std::string& truth, const std::function<void(int rotctl, int stream, pid_t server)>& during) {
  const int rotctl = free_port(), stream = free_port();
  const auto meanwhile = [&](pid_t server) {
    std::this_thread::sleep_for(std::chrono::milliseconds(1200));
    during(rotctl, stream, server);
    ::kill(server, SIGTERM);
  };
  (void)testing::run_program({ALIDADE_EXECUTABLE, "simulate", "head", "--rotctl", std::to_string(rotctl), "--stream",
                              std::to_string(stream), "--head", "rate=3", "--truth", truth, "--seconds", "60"},
                             "", meanwhile);
}

std::vector<std::string> calibrating(int rotctl, int stream, const std::string& out) {
  return {ALIDADE_EXECUTABLE,
          "head",
          fmt::format("rotctl://127.0.0.1:{}", rotctl),
          "--stream",
          fmt::format("http://127.0.0.1:{}/stream.mjpg", stream),
          "--calibrate",
          "--move",
          "--out",
          out};
}

TEST_F(HeadCommand, StandsAfterCtrlC) {
  with_server(path("truth.csv"), [&](int rotctl, int stream, pid_t) {
    const testing::Outcome outcome = testing::run_program(calibrating(rotctl, stream, path("out")), "",
                                                          testing::interrupt_after(std::chrono::milliseconds(4000)));
    EXPECT_EQ(outcome.code, 130) << outcome.err;
    EXPECT_FALSE(std::filesystem::exists(path("out") + "/result.json"));  // at most DIR/so-far, whole
    std::this_thread::sleep_for(std::chrono::milliseconds(1200));
    const TruthEnd end = end_of(path("truth.csv"));
    EXPECT_GT(std::hypot(end.pan, end.tilt), 0.01);
    EXPECT_LT(end.moved, 1e-6);
  });
}

TEST_F(HeadCommand, SaysThatTheHeadIsStoppedAfterCtrlC) {
  const testing::Outcome outcome =
      testing::run_program({ALIDADE_EXECUTABLE, "head", "sim://?rate=5", "--identify", "--move", "--out", path("out")},
                           "", testing::interrupt_after(std::chrono::milliseconds(2500)));
  EXPECT_EQ(outcome.code, 130) << outcome.err;
  EXPECT_NE(outcome.err.find("interrupted; the head is stopped; nothing written"), std::string::npos) << outcome.err;
}

TEST_F(HeadCommand, WhatWasFollowedUntilCtrlCIsAResult) {
  write_file(
      path("camera.yaml"),
      "model: brown\nwidth: 320\nheight: 240\nfx: 350\nfy: 348\ncx: 163.2\ncy: 117.9\nskew: 0\nk1: -0.08\nk2: 0\n"
      "p1: 0\np2: 0\nk3: 0\n");
  write_file(path("rig.yaml"), "heads:\n- {id: 1, camera: camera.yaml}\n");
  const testing::Outcome outcome = testing::run_program(
      {ALIDADE_EXECUTABLE, "head", "sim://?rate=40", "--stream", "sim://?fps=20&target=6:0:3:20:1.2", "--rig",
       path("rig.yaml"), "--follow", "bright", "--move", "--out", path("out")},
      "", testing::interrupt_after(std::chrono::milliseconds(4500)));
  EXPECT_EQ(outcome.code, 130) << outcome.err;
  EXPECT_NE(outcome.err.find("interrupted"), std::string::npos) << outcome.err;
  const auto document = nlohmann::json::parse(read_file(path("out") + "/result.json"));
  EXPECT_GT(document["data"]["follow"]["t_s"].size(), 20u);
  EXPECT_EQ(document["verdict"]["state"], "care");  // no run that ended as it should
  EXPECT_TRUE(std::filesystem::exists(path("out") + "/follow.csv"));
  EXPECT_FALSE(std::filesystem::exists(path("out") + "/so-far"));
}

TEST_F(HeadCommand, StandsAfterAKillByTheServersWatchdog) {
  with_server(path("truth.csv"), [&](int rotctl, int stream, pid_t) {
    const auto kill_soon = [](pid_t child) {
      std::this_thread::sleep_for(std::chrono::milliseconds(4000));
      ::kill(child, SIGKILL);
    };
    (void)testing::run_program(calibrating(rotctl, stream, path("out")), "", kill_soon);
    std::this_thread::sleep_for(std::chrono::milliseconds(2000));
    const TruthEnd end = end_of(path("truth.csv"));
    EXPECT_GT(std::hypot(end.pan, end.tilt), 0.01);
    EXPECT_LT(end.moved, 1e-6);
  });
}

TEST_F(HeadCommand, ALostServerIsSaid) {
  with_server(path("truth.csv"), [&](int rotctl, int stream, pid_t server) {
    const auto kill_server = [server](pid_t) {
      std::this_thread::sleep_for(std::chrono::milliseconds(4000));
      ::kill(server, SIGKILL);
    };
    const testing::Outcome outcome = testing::run_program(calibrating(rotctl, stream, path("out")), "", kill_server);
    EXPECT_TRUE(outcome.code == 3 || outcome.code == 4) << outcome.code << outcome.err;
    EXPECT_EQ(std::count(outcome.err.begin(), outcome.err.end(), '\n'), 1) << outcome.err;
  });
}

TEST_F(HeadCommand, IdentifiesHamlibsDummy) {
  if (::access("/usr/bin/rotctld", X_OK) != 0) GTEST_SKIP() << "rotctld is not installed: libhamlib-utils";
  const int port = free_port();
  const auto head = [&](pid_t server) {
    std::this_thread::sleep_for(std::chrono::milliseconds(700));
    const testing::Outcome outcome = alidade({"head", fmt::format("rotctl://127.0.0.1:{}", port), "--identify",
                                              "--move", "--pan-range", "-15,15", "--json", "--out", path("out")});
    ::kill(server, SIGTERM);
    ASSERT_EQ(outcome.code, 0) << outcome.err;
    const auto document = nlohmann::json::parse(outcome.out);
    for (const char* axis : {"pan", "tilt"})
      EXPECT_NEAR(document["estimate"]["axes"][axis]["rate_rad_s"].get<double>(), 6.0 * degree_rad,
                  0.02 * 6.0 * degree_rad);
  };
  (void)testing::run_program({"rotctld", "-m", "1", "-T", "127.0.0.1", "-t", std::to_string(port)}, "", head);
}

}  // namespace
}  // namespace alidade
