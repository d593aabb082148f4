#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <chrono>
#include <csignal>
#include <filesystem>
#include <nlohmann/json.hpp>
#include <thread>

#include "alidade/files/files.h"
#include "alidade/live/server.h"
#include "alidade/testing/command_test.h"

namespace alidade {
namespace {

using ::testing::HasSubstr;
using testing::Outcome;
using ::testing::StartsWith;
using Json = nlohmann::json;

class LiveCommand : public testing::CommandTest {
 protected:
  [[nodiscard]] Outcome servo(const std::vector<std::string>& options) {
    write_file(path("scenario.yaml"), "seeds: 1\nduration_s: 4\n");
    return alidade({"servo", path("scenario.yaml"), "--no-robustness", "--no-report", "--out", path("out")}, options);
  }
};

/// Of the result, what does not depend on when it was made, or how it was called.
Json lasting(const std::string& file) {
  Json json = Json::parse(read_file(file));
  for (const char* name : {"argv", "created_utc", "seconds"}) json.erase(name);
  return json;
}

TEST_F(LiveCommand, TellsWhereAndLeavesTheSameResult) {
  ASSERT_EQ(servo({}).code, 0);
  const Json alone = lasting(path("out/result.json"));
  const Outcome watched = servo({"--live", "0", "--json"});
  ASSERT_EQ(watched.code, 0) << watched.err;
  EXPECT_THAT(watched.err, ::testing::MatchesRegex("live: http://127\\.0\\.0\\.1:[0-9]+/\n"));
  EXPECT_EQ(Json::parse(watched.out)["command"], "servo");  // nothing but the document
  EXPECT_EQ(lasting(path("out/result.json")), alone);
}

TEST_F(LiveCommand, APortInUseIsOneLineAndWritesNothing) {
  live::ServerConfig config;
  config.port = 0;
  const live::Server other(config);
  const Outcome outcome = servo({"--live", std::to_string(other.port())});
  EXPECT_EQ(outcome.code, 3);
  EXPECT_EQ(outcome.err, "alidade: error: --live: port " + std::to_string(other.port()) +
                             " of 127.0.0.1 is in use; give another one, or 0 for any that is free\n");
  EXPECT_FALSE(std::filesystem::exists(path("out")));
}

TEST_F(LiveCommand, OptionsThatDoNotFitAreNamed) {
  const auto fault = [&](const std::vector<std::string>& options, int code, const std::string& what) {
    const Outcome outcome = servo(options);
    EXPECT_EQ(outcome.code, code) << outcome.err;
    EXPECT_THAT(outcome.err, HasSubstr(what));
  };
  fault({"--live", "70000"}, 2, "'70000' is not a port");
  fault({"--live", "file.csv"}, 2, "'file.csv' is not a port");
  fault({"--live-address", "0.0.0.0"}, 2, "only with --live");
  fault({"--live-pace", "1"}, 2, "only with --live");
  fault({"--live=0", "--live-pace", "0"}, 2, "not above zero");
  fault({"--live=0", "--live-address", "here"}, 3, "'here' is not a numeric address");
  fault({"--live=0", "--live-address", "203.0.113.7"}, 3, "port 0 of 203.0.113.7");  // of no machine: RFC 5737
  const Outcome observe = alidade({"observe", path("log.csv"), "--live"});
  EXPECT_EQ(observe.code, 2);
  EXPECT_THAT(observe.err, HasSubstr("only for rows from standard input"));
}

TEST_F(LiveCommand, AnotherAddressHasAToken) {
  const Outcome outcome = servo({"--live", "0", "--live-address", "0.0.0.0"});
  EXPECT_EQ(outcome.code, 0) << outcome.err;
  EXPECT_THAT(outcome.err, ::testing::MatchesRegex("live: http://.*/\\?token=[0-9a-f]{32}\n"));
}

TEST_F(LiveCommand, PaceIsThatOfTheRecording) {
  const auto begin = std::chrono::steady_clock::now();
  ASSERT_EQ(servo({"--controller", "pi", "--live=0", "--live-pace", "4"}).code, 0);  // 4 s
  EXPECT_GE(std::chrono::steady_clock::now() - begin, std::chrono::milliseconds(950));
}

TEST_F(LiveCommand, CtrlCEndsAPacedRunAndWritesNothing) {
  write_file(path("scenario.yaml"), "seeds: 1\nduration_s: 600\n");
  const std::vector<std::string> words{
      ALIDADE_EXECUTABLE, "servo", path("scenario.yaml"), "--live=0", "--live-pace", "1", "--out", path("out")};
  const Outcome outcome = testing::run_program(words, "", testing::interrupt_after(std::chrono::seconds(1)));
  EXPECT_EQ(outcome.code, 130);
  EXPECT_THAT(outcome.err, HasSubstr("interrupted; nothing written\n"));
  EXPECT_FALSE(std::filesystem::exists(path("out")));
}

class ViewCommand : public LiveCommand {
 protected:
  /// What `view` says until Ctrl-C.
  [[nodiscard]] Outcome view(const std::vector<std::string>& folders) {
    std::vector<std::string> words{ALIDADE_EXECUTABLE, "view", "--port", "0"};
    words.insert(words.end(), folders.begin(), folders.end());
    return testing::run_program(words, "", testing::interrupt_after(std::chrono::seconds(1)));
  }
};

TEST_F(ViewCommand, NamesTheResultsAndWhereTheyAre) {
  ASSERT_EQ(servo({}).code, 0);
  std::filesystem::create_directories(path("all"));
  std::filesystem::copy(path("out"), path("all/a"), std::filesystem::copy_options::recursive);
  std::filesystem::copy(path("out"), path("all/b"), std::filesystem::copy_options::recursive);
  for (const std::string folder : {"out", "all"}) {
    const Outcome outcome = view({path(folder)});
    EXPECT_EQ(outcome.code, 0) << outcome.err;
    EXPECT_THAT(outcome.out, HasSubstr("http://127.0.0.1:"));
    EXPECT_THAT(outcome.out, StartsWith(folder == "out" ? "out " : "a "));
    EXPECT_EQ(outcome.out.find("\nb ") != std::string::npos, folder == "all");
  }
}

TEST_F(ViewCommand, SaysWhatIsNoResult) {
  std::filesystem::create_directories(path("empty"));
  write_file(path("other/result.json"), "{}");
  const std::vector<std::pair<std::string, std::string>> faults{
      {"none", "is not a folder"}, {"empty", "has no result.json"}, {"other", "is not a result of alidade"}};
  for (const auto& [folder, what] : faults) {
    const Outcome outcome = alidade({"view", path(folder)});
    EXPECT_EQ(outcome.code, 3);
    EXPECT_THAT(outcome.err, HasSubstr(what));
  }
}

}  // namespace
}  // namespace alidade
