#include <fmt/format.h>
#include <netinet/in.h>
#include <sys/socket.h>
#include <unistd.h>

#include <chrono>
#include <nlohmann/json.hpp>
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
