#include <fmt/format.h>
#include <netinet/in.h>
#include <sys/socket.h>
#include <unistd.h>

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

TEST_F(HeadCommand, RefusesWhatCannotBe) {
  EXPECT_EQ(alidade({"head", "sim://", "--identify"}).code, 2);
  EXPECT_EQ(alidade({"head", "sim://", "--pan-range", "5,-5"}).code, 2);
  EXPECT_EQ(alidade({"head", "sim://", "--pan-range", "nan,5"}).code, 2);
  EXPECT_EQ(alidade({"head", "sim://?lie=often"}).code, 3);
  EXPECT_EQ(alidade({"head", "ftp://here"}).code, 3);
  EXPECT_EQ(alidade({"head", fmt::format("rotctl://127.0.0.1:{}", free_port())}).code, 3);
  const testing::Outcome secret = alidade({"head", "rotctl://me:hunter2@127.0.0.1:4533", "--out", path("out")});
  EXPECT_EQ(secret.code, 3);
  EXPECT_EQ((secret.out + secret.err).find("hunter2"), std::string::npos);
}

/// Pan and tilt at the end of a truth file, and whether they stood for the last half second.
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
    EXPECT_FALSE(std::filesystem::exists(path("out")));
    std::this_thread::sleep_for(std::chrono::milliseconds(1200));
    const TruthEnd end = end_of(path("truth.csv"));
    EXPECT_GT(std::hypot(end.pan, end.tilt), 0.01);
    EXPECT_LT(end.moved, 1e-6);
  });
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
