#include "cli/app/app.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <tbb/parallel_for.h>

#include <CLI/CLI.hpp>
#include <chrono>
#include <mutex>
#include <nlohmann/json.hpp>
#include <set>
#include <thread>

#include "alidade/geometry/sanitizers.h"
#include "alidade/testing/process.h"
#include "cli/app/option_checks.h"

namespace alidade::cli {
namespace {

using alidade::testing::Outcome;
using alidade::testing::run_in_child;
using alidade::testing::shown_on_terminal;
using alidade::testing::TemporaryFolder;
using ::testing::HasSubstr;
using ::testing::MatchesRegex;
using ::testing::Not;
using ::testing::StartsWith;

/// What a test lets its one command, `work`, do.
std::function<ExitCode(cli::Run&)> work_of_test;

void add_test_commands(App& app) {
  auto length = std::make_shared<double>(1.0);
  static std::vector<double> lengths;
  lengths.clear();
  CLI::App& command =
      app.add_command({"work", "Does what the test says", "  alidade work --length 2", true, true, true},
                      [](cli::Run& run) { return work_of_test(run); });
  command.add_option("--length", *length, "A length [m]")->check(positive_number());
  command.add_option("--lengths", lengths, "Several [m]")->delimiter(',')->check(positive_number());
  app.add_group("camera", "Cameras");
  app.add_command({"camera show", "Shows a camera", "  alidade camera show a.yaml", false, false},
                  [](cli::Run& run) { return work_of_test(run); });
}

int run_words(std::vector<const char*> words) {
  words.insert(words.begin(), "alidade");
  return run_cli(static_cast<int>(words.size()), words.data(), add_test_commands);
}

Outcome outcome_of(const std::vector<const char*>& words, std::function<ExitCode(cli::Run&)> work = {},
                   const std::function<void(pid_t)>& meanwhile = {}) {
  work_of_test = std::move(work);
  return run_in_child([&] { return run_words(words); }, meanwhile);
}

Verdict good() { return {State::good, ExitCode::ok, "All is well", "", {}}; }

std::function<ExitCode(cli::Run&)> throwing(const std::function<void()>& thrower) {
  return [thrower](cli::Run& run) {
    thrower();
    return run.finish(good());
  };
}

/// Exactly one line, in the format of every error.
::testing::Matcher<std::string> is_fault(const std::string& message) {
  return ::testing::StrEq("alidade: error: " + message + "\n");
}

TEST(App, HelpNamesEveryCommandAndCommandHelpEndsWithExamples) {
  const Outcome help = outcome_of({"--help"});
  EXPECT_EQ(help.code, 0);
  EXPECT_THAT(help.out, HasSubstr("Does what the test says"));
  EXPECT_EQ(help.err, "");
  const Outcome of_command = outcome_of({"work", "--help"});
  EXPECT_EQ(of_command.code, 0);
  for (const char* option : {"--length", "--out", "--json", "--quiet", "--threads", "--seed", "--no-report"}) {
    EXPECT_THAT(of_command.out, HasSubstr(option));
  }
  EXPECT_THAT(of_command.out, HasSubstr("Examples:\n  alidade work --length 2"));
  EXPECT_THAT(outcome_of({"camera", "show", "--help"}).out, Not(HasSubstr("--seed"))) << "nothing is drawn there";
}

TEST(App, VersionIsOneLine) {
  const Outcome outcome = outcome_of({"--version"});
  EXPECT_EQ(outcome.code, 0);
  EXPECT_THAT(outcome.out, MatchesRegex("alidade [0-9]+\\.[0-9]+\\.[0-9]+\n"));
}

TEST(App, WrongUsageIsOneLineAndExitCode2) {
  const std::vector<std::pair<std::vector<const char*>, std::string>> cases{
      {{}, "a command is required; see alidade --help"},
      {{"wrok"}, "unknown command 'wrok'; did you mean 'work'?"},
      {{"levitate"}, "unknown command 'levitate'"},
      {{"--lenght", "2"}, "unknown option '--lenght'"},
      {{"work", "--lenght", "2"}, "work: unknown option '--lenght'; did you mean '--length'?"},
      {{"work", "--lenght=2"}, "work: unknown option '--lenght'; did you mean '--length'?"},
      {{"work", "extra"}, "work: unexpected argument 'extra'"},
      {{"work", "--length", "nan"}, "work: --length: 'nan' is not a finite number"},
      {{"work", "--length", "1e999"}, "work: --length: '1e999' is not a finite number"},
      {{"work", "--length", "-1"}, "work: --length: '-1' is not above zero"},
      {{"work", "--lengths", "1,,2"}, "work: '1,,2' lacks a number"},
      {{"work", "--lengths=1,2,"}, "work: '--lengths=1,2,' lacks a number"},
      {{"work", "--threads", "-1"}, "work: --threads: Value -1 not in range 0 to 1024"},
      {{"camera"}, "camera: a command is required: show; see alidade camera --help"},
      {{"camera", "shwo"}, "camera: unknown command 'shwo'; did you mean 'show'?"},
      {{"camera", "show", "--x"}, "camera show: unknown option '--x'"},
  };
  for (const auto& [words, message] : cases) {
    const Outcome outcome = outcome_of(words);
    EXPECT_EQ(outcome.code, 2) << message;
    EXPECT_THAT(outcome.err, is_fault(message));
    EXPECT_EQ(outcome.out, "");
  }
}

TEST(App, EverythingThrownBecomesItsExitCodeAndOneLine) {
  const std::string bug = " (a bug in alidade; please report it)";
  const auto check = [](const std::function<void()>& thrower, int code, const std::string& message) {
    const Outcome outcome = outcome_of({"work"}, throwing(thrower));
    EXPECT_EQ(outcome.code, code);
    EXPECT_THAT(outcome.err, is_fault(message));
    EXPECT_EQ(outcome.out, "");
  };
  check([] { throw UsageError("--fix: 'k9' is unknown"); }, 2, "work: --fix: 'k9' is unknown");
  check([] { throw InputError("a.csv:3: two\nlines\r\n"); }, 3, "a.csv:3: two lines");
  check([] { (void)std::filesystem::file_size("/no/such"); }, 3, "/no/such: No such file or directory");
  check([] { throw std::logic_error("R is not symmetric"); }, 1, "internal: R is not symmetric" + bug);
  check([] { throw 7; }, 1, "internal: unknown" + bug);
  check([] { throw std::bad_alloc(); }, 1, "internal: not enough memory; use fewer or smaller inputs");
  check([] { std::thread([] {}).detach(), throw std::out_of_range("index"); }, 1, "internal: index" + bug);
}

TEST(App, AnOutThatIsAFileIsBadInputBeforeAnyWork) {
  const TemporaryFolder folder;
  const std::string file = (folder.path() / "file").string();
  write_file(file, "x");
  const Outcome outcome =
      outcome_of({"work", "--out", file.c_str()}, throwing([] { throw std::logic_error("worked"); }));
  EXPECT_EQ(outcome.code, 3);
  EXPECT_THAT(outcome.err, is_fault(file + ": is a file, not a folder; give another --out"));
}

TEST(App, AnEmptyOutIsWrongUsage) {
  const Outcome outcome = outcome_of({"work", "--out", ""}, throwing([] { throw std::logic_error("worked"); }));
  EXPECT_EQ(outcome.code, 2);
  EXPECT_THAT(outcome.err, is_fault("--out: is empty; a folder is needed"));
}

TEST(App, ARunLeavesItsFilesAndTellsAPerson) {
  const TemporaryFolder folder;
  const std::string out = (folder.path() / "out").string();
  const Outcome outcome = outcome_of({"work", "--out", out.c_str(), "--seed", "7", "--no-report"}, [](cli::Run& run) {
    run.add_input("photo", "a.jpg", "abc");
    run.add_file("camera.yaml", "fx: 1\n");
    run.document.estimate["fx"] = 1.0;
    run.lap("solve");
    run.say("fx 1.00 ± 0.03 px");
    return run.finish(good());
  });
  EXPECT_EQ(outcome.code, 0);
  EXPECT_EQ(outcome.out, "fx 1.00 ± 0.03 px\n● All is well\nresult: " + out + "/result.json\n");
  EXPECT_EQ(outcome.err, "");
  EXPECT_EQ(read_file(out + "/camera.yaml"), "fx: 1\n");
  const auto result = nlohmann::json::parse(read_file(out + "/result.json"));
  EXPECT_EQ(result["command"], "work");
  EXPECT_EQ(result["seed"], 7);
  EXPECT_EQ(result["argv"][1], "work");
  EXPECT_EQ(result["estimate"]["fx"], 1.0);
  EXPECT_EQ(result["inputs"][0]["bytes"], 3);
  EXPECT_GE(result["seconds"]["total"].get<double>(), result["seconds"]["solve"].get<double>());
  EXPECT_THAT(result["created_utc"].get<std::string>(), MatchesRegex("20..-..-..T..:..:..Z"));
}

TEST(App, FilesTooLargeForMemoryAreWrittenAtTheEndAsWell) {
  const TemporaryFolder folder;
  const std::string out = (folder.path() / "out").string();
  const auto content = [](int i) { return std::string(90u << 20, static_cast<char>('a' + i)); };
  const Outcome outcome = outcome_of({"work", "--out", out.c_str(), "--no-report"}, [&](cli::Run& run) {
    for (int i = 0; i < 4; ++i) run.add_file(std::to_string(i), content(i));  // the third passes 256 MiB
    run.add_file("small", "s");
    if (std::filesystem::exists(out)) throw std::logic_error("something is written before the end");
    return run.finish(good());
  });
  ASSERT_EQ(outcome.code, 0) << outcome.err;
  for (int i = 0; i < 4; ++i) EXPECT_TRUE(read_file(out + "/" + std::to_string(i)) == content(i)) << i;
  EXPECT_EQ(read_file(out + "/small"), "s");
}

TEST(App, JsonPrintsTheDocumentAndNothingElse) {
  const TemporaryFolder folder;
  const std::string out = (folder.path() / "out").string();
  const Outcome outcome = outcome_of({"work", "--out", out.c_str(), "--json"}, [](cli::Run& run) {
    run.say("not for scripts");
    return run.finish(good());
  });
  EXPECT_EQ(outcome.out, read_file(out + "/result.json"));
  EXPECT_EQ(nlohmann::json::parse(outcome.out)["verdict"]["exit_code"], 0);
  EXPECT_EQ(outcome.err, "");
}

TEST(App, QuietPrintsNothing) {
  const TemporaryFolder folder;
  const std::string out = (folder.path() / "out").string();
  const Outcome outcome = outcome_of({"work", "--out", out.c_str(), "--quiet"}, [](cli::Run& run) {
    run.say("a line");
    return run.finish(good());
  });
  EXPECT_EQ(outcome.out + outcome.err, "");
  EXPECT_TRUE(std::filesystem::exists(out + "/result.json"));
}

TEST(App, ARefusalIsWrittenAndSaysWhatToAdd) {
  const TemporaryFolder folder;
  const std::string out = (folder.path() / "out").string();
  const Outcome outcome = outcome_of({"work", "--out", out.c_str()}, [](cli::Run& run) {
    return run.finish(
        {State::refused, ExitCode::undetermined, "pan only: fy cannot be determined", "tilt the camera as well", {}});
  });
  EXPECT_EQ(outcome.code, 4);
  EXPECT_THAT(outcome.err, is_fault("work: pan only: fy cannot be determined; tilt the camera as well"));
  EXPECT_EQ(nlohmann::json::parse(read_file(out + "/result.json"))["verdict"]["state"], "refused");
}

TEST(App, ACommandThatOnlyShowsLeavesNothingUnlessOutIsGiven) {
  const TemporaryFolder folder;
  const auto in_folder = [&](std::vector<const char*> words) {
    work_of_test = [](cli::Run& run) { return run.finish(good()); };
    return run_in_child([&] {
      std::filesystem::current_path(folder.path());
      return run_words(words);
    });
  };
  EXPECT_EQ(in_folder({"camera", "show"}).code, 0);
  EXPECT_TRUE(std::filesystem::is_empty(folder.path()));
  EXPECT_EQ(in_folder({"camera", "show", "--out", "x"}).code, 0);
  EXPECT_TRUE(std::filesystem::exists(folder.path() / "x" / "result.json"));
  EXPECT_EQ(in_folder({"work"}).code, 0);
  EXPECT_TRUE(std::filesystem::exists(folder.path() / "alidade-out" / "work" / "result.json"));
}

TEST(App, ThreadsLimitsTheParallelWork) {
  const auto num_threads = [](const char* asked) {
    return outcome_of({"work", "--threads", asked},
                      [](cli::Run&) {
                        std::mutex mutex;
                        std::set<std::thread::id> threads;
                        tbb::parallel_for(0, 50, [&](int) {
                          std::this_thread::sleep_for(std::chrono::milliseconds(1));
                          const std::scoped_lock lock(mutex);
                          threads.insert(std::this_thread::get_id());
                        });
                        return static_cast<ExitCode>(threads.size());
                      })
        .code;
  };
  EXPECT_EQ(num_threads("1"), 1);
  EXPECT_LE(num_threads("2"), 2);
}

/// Work that goes on until it is stopped; `ready` is a file that appears when it has begun.
ExitCode work_forever(cli::Run& run, const std::string& ready) {
  run.add_file("camera.yaml", "half");
  write_file(ready, "");
  for (std::size_t i = 0;; ++i) {
    report_progress(run.progress, "working", i, 0);
    std::this_thread::sleep_for(std::chrono::milliseconds(1));
  }
}

/// Sends signals to the child once its work has begun.
std::function<void(pid_t)> interrupt_when_ready(std::string ready, std::vector<int> signals) {
  return [ready = std::move(ready), signals = std::move(signals)](pid_t child) {
    while (!std::filesystem::exists(ready)) std::this_thread::sleep_for(std::chrono::milliseconds(1));
    for (const int signal : signals) {
      ::kill(child, signal);
      std::this_thread::sleep_for(std::chrono::milliseconds(20));
    }
  };
}

TEST(App, CtrlCStopsTheWorkAndLeavesNothing) {
  const TemporaryFolder folder;
  const std::string out = (folder.path() / "out").string(), ready = (folder.path() / "ready").string();
  const Outcome outcome = outcome_of(
      {"work", "--out", out.c_str()}, [&](cli::Run& run) { return work_forever(run, ready); },
      interrupt_when_ready(ready, {SIGINT}));
  EXPECT_EQ(outcome.code, 130);
  EXPECT_THAT(outcome.err, is_fault("interrupted; nothing written"));
  EXPECT_FALSE(std::filesystem::exists(out));
}

TEST(App, ASecondCtrlCDoesNotWaitForTheWork) {
  const TemporaryFolder folder;
  const std::string ready = (folder.path() / "ready").string();
  const auto deaf = [&](cli::Run&) -> ExitCode {
    write_file(ready, "");
    while (true) std::this_thread::sleep_for(std::chrono::seconds(1));
  };
  EXPECT_EQ(outcome_of({"work"}, deaf, interrupt_when_ready(ready, {SIGINT, SIGINT})).code, 130);
}

/// A fit that never looks whether it shall stop; what began to be written is not left in halves.
TEST(App, WorkThatDoesNotLookIsStoppedAtOnceWhileNothingIsWritten) {
  for (const int signal : {SIGINT, SIGTERM}) {
    const TemporaryFolder folder;
    const std::string out = (folder.path() / "out").string(), ready = (folder.path() / "ready").string();
    std::chrono::steady_clock::time_point sent;
    const auto deaf = [&](cli::Run& run) -> ExitCode {
      run.add_file("camera.yaml", "half");
      write_file(ready, "");
      while (true) std::this_thread::sleep_for(std::chrono::seconds(1));
    };
    const Outcome outcome = outcome_of({"work", "--out", out.c_str()}, deaf, [&](pid_t child) {
      interrupt_when_ready(ready, {signal})(child);
      sent = std::chrono::steady_clock::now();
    });
    EXPECT_LT(std::chrono::steady_clock::now() - sent, std::chrono::seconds(2));  // 0.3 s, and a busy machine
    EXPECT_EQ(outcome.code, 128 + signal);
    EXPECT_THAT(outcome.err, is_fault("interrupted; nothing written"));
    EXPECT_FALSE(std::filesystem::exists(out));
  }
}

TEST(App, WhatHasBegunToBeWrittenIsNotStoppedInTheMiddle) {
  const TemporaryFolder folder;
  const std::filesystem::path there = folder.path() / "there";
  const std::string out = (folder.path() / "out").string(), ready = (folder.path() / "ready").string();
  std::filesystem::create_directory(there);
  const auto slow = [&](cli::Run& run) {
    run.add_file_elsewhere(there / "file", "whole");
    write_file(ready, "");
    std::this_thread::sleep_for(std::chrono::seconds(1));
    return run.finish(good());
  };
  const Outcome outcome = outcome_of({"work", "--out", out.c_str()}, slow, interrupt_when_ready(ready, {SIGTERM}));
  EXPECT_EQ(outcome.code, 143);
  EXPECT_TRUE(std::filesystem::is_empty(there));
  EXPECT_FALSE(std::filesystem::exists(out));
}

TEST(App, ProgressIsShownOnATerminalAndWipedBeforeTheResult) {
  const TemporaryFolder folder;
  const std::string out = (folder.path() / "out").string();
  work_of_test = [](cli::Run& run) {
    report_progress(run.progress, "looking at photos", 3, 13);
    run.say("done");
    return run.finish(good());
  };
  const std::string shown = shown_on_terminal([&] { return run_words({"work", "--out", out.c_str()}); });
  EXPECT_THAT(shown, StartsWith("\r\033[Klooking at photos 3/13"));
  EXPECT_THAT(shown, HasSubstr("\r\033[Kdone\r\n"));
  EXPECT_EQ(shown_on_terminal([&] { return run_words({"work", "--out", out.c_str(), "--quiet"}); }), "");
}

TEST(App, WhatLibrariesSayOnStderrIsNotAmongOurLines) {
  if (ALIDADE_IS_SANITIZED) GTEST_SKIP() << "a sanitizer keeps stderr";
  const auto noisy = [](cli::Run&) -> ExitCode {
    std::fputs("Premature end of JPEG file\n", stderr);
    throw InputError("a.jpg: broken");
  };
  EXPECT_THAT(outcome_of({"work"}, noisy).err, is_fault("a.jpg: broken"));
}

TEST(App, AFullDiskOnStdoutIsAFault) {
  work_of_test = [](cli::Run& run) {
    run.say("x");
    return run.finish(good());
  };
  const Outcome outcome = run_in_child([] {
    ::dup2(::open("/dev/full", O_WRONLY), STDOUT_FILENO);
    return run_words({"camera", "show"});
  });
  EXPECT_EQ(outcome.code, 3);
  EXPECT_THAT(outcome.err, is_fault("stdout: cannot be written"));
}

}  // namespace
}  // namespace alidade::cli
