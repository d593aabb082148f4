#include <fcntl.h>
#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <sys/mount.h>
#include <sys/resource.h>

#include <CLI/CLI.hpp>
#include <map>
#include <nlohmann/json.hpp>
#include <random>
#include <thread>

#include "alidade/testing/process.h"
#include "cli/app/app.h"

// A run that fails, however it fails, leaves the results of earlier runs exactly as they were; one that does not fail
// replaces them whole.

namespace alidade::cli::nothing_lost {
namespace {

namespace fs = std::filesystem;
using alidade::testing::Outcome;
using alidade::testing::run_in_child;
using alidade::testing::TemporaryFolder;
using ::testing::HasSubstr;
using ::testing::MatchesRegex;
using ::testing::Not;
using Work = std::function<ExitCode(Run&)>;

Work work_to_do;

void add_work(App& app) {
  app.add_command({"work", "Does what the test says", "  alidade work"}, [](Run& run) { return work_to_do(run); });
}

/// A run of `work` into `out`; `before` happens in its process first.
Outcome run_into(const fs::path& out, Work work, std::vector<std::string> more = {},
                 const std::function<void()>& before = {}, const std::function<void(pid_t)>& meanwhile = {}) {
  work_to_do = std::move(work);
  std::vector<std::string> words{"alidade", "work", "--out", out.string()};
  words.insert(words.end(), more.begin(), more.end());
  return run_in_child(
      [&] {
        if (before) before();
        std::vector<const char*> argv;
        for (const std::string& word : words) argv.push_back(word.c_str());
        return run_cli(static_cast<int>(argv.size()), argv.data(), add_work);
      },
      meanwhile);
}

Verdict verdict_of(State state) {
  const ExitCode code = state == State::refused         ? ExitCode::undetermined
                        : state == State::not_converged ? ExitCode::no_convergence
                                                        : ExitCode::ok;
  return {state, code, "what was found", "what to do", {}};
}

/// Writes files of so many bytes.
Work writing(const std::vector<std::string>& names, State state, char letter = 'x', std::size_t bytes = 10) {
  return [=](cli::Run& run) {
    for (const std::string& name : names) run.add_file(name, std::string(bytes, letter));
    run.document.estimate["letter"] = std::string(1, letter);
    return run.finish(verdict_of(state));
  };
}

/// Every file of a folder, hidden ones too, with its content.
std::map<std::string, std::string> files_of(const fs::path& folder) {
  std::map<std::string, std::string> content;
  for (const auto& entry : fs::recursive_directory_iterator(folder)) {
    if (!entry.is_directory()) content[entry.path().lexically_relative(folder)] = read_file(entry.path());
  }
  return content;
}

std::vector<std::string> names_of(const fs::path& folder) {
  std::vector<std::string> names;
  for (const auto& [name, content] : files_of(folder)) names.push_back(name);
  return names;
}

nlohmann::json verdict_in(const fs::path& folder) {
  return nlohmann::json::parse(read_file(folder / "result.json"))["verdict"];
}

/// Exit code 3 and one line that names the place; what was there is there, and nothing else.
void expect_failed(const Outcome& outcome, const fs::path& out, const std::map<std::string, std::string>& before,
                   const std::string& named) {
  EXPECT_EQ(outcome.code, 3) << outcome.err;
  EXPECT_THAT(outcome.err, MatchesRegex("alidade: error: [^\n]+\n"));
  EXPECT_THAT(outcome.err, HasSubstr(named));
  EXPECT_EQ(files_of(out), before);
}

TEST(NothingLost, ARefusalLeavesAnEarlierEstimateAndStandsBesideIt) {
  const TemporaryFolder folder;
  const fs::path out = folder.path();
  ASSERT_EQ(run_into(out, writing({"camera.yaml", "corners.csv"}, State::good)).code, 0);
  const auto before = files_of(out);
  for (const State state : {State::refused, State::not_converged}) {
    const Outcome outcome = run_into(out, writing({"steps.csv"}, state));
    EXPECT_EQ(outcome.code, state == State::refused ? 4 : 5);
    EXPECT_THAT(outcome.out,
                HasSubstr("the results of an earlier run in " + out.string() + " are left as they were\n"));
    EXPECT_THAT(outcome.out, HasSubstr("result: " + (out / "refused/result.json").string()));
    auto now = files_of(out);
    for (const auto& [name, content] : before) EXPECT_EQ(now[name], content) << name;
    EXPECT_THAT(names_of(out / "refused"), ::testing::ElementsAre("report.html", "result.json", "steps.csv"));
    EXPECT_EQ(verdict_in(out / "refused")["exit_code"], outcome.code);
  }
  ASSERT_EQ(run_into(out, writing({"camera.yaml"}, State::care)).code, 0);
  EXPECT_THAT(names_of(out), ::testing::ElementsAre("camera.yaml", "report.html", "result.json"));
  EXPECT_FALSE(fs::exists(out / "refused")) << "the newest result stands alone";
}

TEST(NothingLost, ARefusalReplacesARefusal) {
  const TemporaryFolder folder;
  ASSERT_EQ(run_into(folder.path(), writing({"steps.csv"}, State::refused)).code, 4);
  ASSERT_EQ(run_into(folder.path(), writing({}, State::not_converged)).code, 5);
  EXPECT_THAT(names_of(folder.path()), ::testing::ElementsAre("report.html", "result.json"));
  EXPECT_EQ(verdict_in(folder.path())["exit_code"], 5);
}

TEST(NothingLost, AnEstimateThatIsNotToBeTrustedIsCode6WithItsFilesAndItsSentence) {
  const TemporaryFolder folder;
  ASSERT_EQ(run_into(folder.path(), writing({"poses.csv"}, State::good)).code, 0);
  const Outcome outcome = run_into(folder.path(), writing({"camera.yaml"}, State::bad));
  EXPECT_EQ(outcome.code, 6);
  EXPECT_EQ(outcome.err, "alidade: error: work: not to be trusted: what was found; what to do\n");
  EXPECT_THAT(outcome.out, HasSubstr("▲ what was found\n  next: what to do\n"));
  EXPECT_THAT(names_of(folder.path()), ::testing::ElementsAre("camera.yaml", "report.html", "result.json"));
  EXPECT_EQ(verdict_in(folder.path())["exit_code"], 6);
  EXPECT_EQ(run_into(folder.path(), writing({}, State::refused)).code, 4);
  EXPECT_EQ(verdict_in(folder.path())["exit_code"], 6) << "it is an estimate all the same: a refusal leaves it";
}

TEST(NothingLost, WhatTheRunHasReadIsNotRemoved) {
  const TemporaryFolder folder;
  ASSERT_EQ(run_into(folder.path(), writing({"1.png", "2.png", "truth.csv"}, State::good)).code, 0);
  const auto reading = [&](cli::Run& run) {
    run.add_input("photo", folder.path() / "." / "1.png");
    run.add_file("camera.yaml", "x");
    return run.finish(verdict_of(State::good));
  };
  ASSERT_EQ(run_into(folder.path(), reading, {"--no-report"}).code, 0);
  EXPECT_THAT(names_of(folder.path()),
              ::testing::ElementsAre("1.png", "2.png", "camera.yaml", "result.json", "truth.csv"));
}

TEST(NothingLost, AnOutThatCannotBeWrittenIsSaidBeforeTheWork) {
  const TemporaryFolder folder;
  write_file(folder.path() / "file", "x");
  const Work never = [](cli::Run&) -> ExitCode { throw std::logic_error("it worked"); };
  for (const fs::path& out :
       {fs::path("/proc/alidade/out"), folder.path() / "file" / "out", folder.path() / "new" / std::string(300, 'n')}) {
    const Outcome outcome = run_into(out, never);
    expect_failed(outcome, folder.path(), {{"file", "x"}}, out.string() + ": cannot be made: ");
    EXPECT_THAT(outcome.err, HasSubstr("; give another --out\n"));
  }
  EXPECT_FALSE(fs::exists(folder.path() / "new"));
}

TEST(NothingLost, AFileBeyondTheSizeAllowedLeavesTheOlderResults) {
  const TemporaryFolder folder;
  ASSERT_EQ(run_into(folder.path(), writing({"camera.yaml", "old.csv"}, State::good)).code, 0);
  const auto before = files_of(folder.path());
  const auto limit_size = [] {
    const rlimit limit{100'000, 100'000};
    ::setrlimit(RLIMIT_FSIZE, &limit);
  };
  expect_failed(run_into(folder.path(), writing({"camera.yaml", "new.csv"}, State::good, 'n', 200'000), {}, limit_size),
                folder.path(), before, "camera.yaml: cannot be written: File too large");
  expect_failed(run_into(folder.path(), writing({"a.csv"}, State::refused, 'n', 200'000), {}, limit_size),
                folder.path(), before, "refused/a.csv: cannot be written: File too large");
}

TEST(NothingLost, AReportThatCannotBeWrittenIsSaidAndFailsNothing) {
  const TemporaryFolder folder;
  ASSERT_EQ(run_into(folder.path(), writing({"camera.yaml"}, State::good)).code, 0);
  const auto report_bytes = fs::file_size(folder.path() / "report.html");
  const auto limit_size = [&] {
    const rlimit limit{report_bytes - 1000, report_bytes - 1000};
    ::setrlimit(RLIMIT_FSIZE, &limit);
  };
  const Outcome outcome = run_into(folder.path(), writing({"camera.yaml"}, State::good, 'n'), {}, limit_size);
  EXPECT_EQ(outcome.code, 0) << outcome.err;
  EXPECT_THAT(outcome.out, HasSubstr("report: not written: "));
  EXPECT_THAT(names_of(folder.path()), ::testing::ElementsAre("camera.yaml", "result.json")) << "nor an older report";
  fs::create_directory(folder.path() / "report.html");
  const Outcome quiet = run_into(folder.path(), writing({"camera.yaml"}, State::good, 'm'), {"--json"});
  EXPECT_EQ(quiet.code, 0);
  EXPECT_EQ(nlohmann::json::parse(quiet.out)["estimate"]["letter"], "m");
  EXPECT_THAT(quiet.err, MatchesRegex("alidade: report: not written: [^\n]+ is a folder, not a file\n"));
}

TEST(NothingLost, AFullDiskLeavesTheOlderResults) {
  const TemporaryFolder folder;
  if (::mount("none", folder.path().c_str(), "tmpfs", 0, "size=600k") != 0) GTEST_SKIP() << "may not mount";
  const fs::path out = folder.path() / "out";
  ASSERT_EQ(run_into(out, writing({"camera.yaml", "poses.csv"}, State::good), {"--no-report"}).code, 0);
  const auto before = files_of(out);
  for (const std::size_t bytes : {100'000u, 150'000u, 250'000u, 500'000u}) {
    for (const State state : {State::good, State::refused}) {
      expect_failed(run_into(out, writing({"a", "b", "c", "d", "camera.yaml", "e", "f"}, state, 'n', bytes)), out,
                    before, "No space left on device");
    }
  }
  const Outcome outcome = run_into(out, writing({"camera.yaml"}, State::good, 'n', 300'000));
  EXPECT_EQ(outcome.code, 0) << outcome.err;  // the report, of 800 kB, has no room; the results have
  EXPECT_THAT(outcome.out, AnyOf(HasSubstr("report: not written: "), HasSubstr("report.html")));
  EXPECT_EQ(read_file(out / "camera.yaml"), std::string(300'000, 'n'));
  ::umount(folder.path().c_str());
}

/// Stdout becomes a pipe without a reader.
void nobody_reads() {
  int ends[2] = {-1, -1};
  if (::pipe(ends) != 0) ::_exit(99);
  ::close(ends[0]);
  ::dup2(ends[1], STDOUT_FILENO);
}

void full_stdout() { ::dup2(::open("/dev/full", O_WRONLY), STDOUT_FILENO); }

TEST(NothingLost, ADocumentThatItsReaderCannotHaveIsAFailure) {
  const TemporaryFolder folder;
  ASSERT_EQ(run_into(folder.path(), writing({"camera.yaml"}, State::good)).code, 0);
  const auto before = files_of(folder.path());
  const Work large = [](cli::Run& run) {
    run.document.data.push_back({"t", {{"x", std::vector<double>(15'000, 0.123456789)}}});
    return run.finish(verdict_of(State::good));
  };
  int num_checked = 0;
  for (const auto& stdout_of : {std::function<void()>(full_stdout), std::function<void()>(nobody_reads),
                                std::function<void()>([] { ::close(STDOUT_FILENO); })}) {
    for (const Work& work : {large, writing({"camera.yaml"}, State::good, 'n')}) {
      expect_failed(run_into(folder.path(), work, {"--json"}, stdout_of), folder.path(), before,
                    "stdout: cannot be written");
      ++num_checked;
    }
  }
  EXPECT_EQ(num_checked, 6);
  expect_failed(run_into(folder.path(), large, {}, full_stdout), folder.path(), before, "stdout: cannot be written");
}

TEST(NothingLost, ATableForTheNextProgramIsAllThatIsPrintedOrTheRunFails) {
  const TemporaryFolder folder;
  const auto table_of = [](State state) -> Work {
    return [state](cli::Run& run) {
      run.print_file("a.csv");
      run.say("a line for a person");
      if (state != State::refused) run.add_file("a.csv", std::string(100'000, state == State::good ? 'g' : 'b'));
      return run.finish(verdict_of(state));
    };
  };
  ASSERT_EQ(run_into(folder.path(), table_of(State::good)).out, std::string(100'000, 'g'));
  const auto before = files_of(folder.path());
  for (const auto& stdout_of : {full_stdout, nobody_reads}) {
    expect_failed(run_into(folder.path(), table_of(State::bad), {}, stdout_of), folder.path(), before,
                  "stdout: cannot be written");
  }
  EXPECT_EQ(run_into(folder.path(), table_of(State::refused)).out, "");
  const Outcome bad = run_into(folder.path(), table_of(State::bad));
  EXPECT_EQ(bad.code, 6);
  EXPECT_EQ(bad.out, std::string(100'000, 'b')) << "not to be trusted, and there";
}

TEST(NothingLost, WhoStopsReadingTheLinesForPeopleHasReadEnough) {
  const TemporaryFolder folder;
  const Work work = [](cli::Run& run) {
    for (int i = 0; i < 5000; ++i) run.say("a line for a person");
    return run.finish(verdict_of(State::good));
  };
  const Outcome outcome = run_into(folder.path(), work, {}, nobody_reads);
  EXPECT_EQ(outcome.code, 0);
  EXPECT_EQ(outcome.err, "");
  EXPECT_TRUE(fs::exists(folder.path() / "result.json"));
}

TEST(NothingLost, KilledAtAnyMomentTheOlderResultsStandOrTheNewOnes) {
  const TemporaryFolder folder;
  const fs::path out = folder.path() / "out";
  std::mt19937 random(5);
  std::uniform_real_distribution<double> share(0.0, 1.0);
  double max_wait_us = 40'000.0;  // grows while no run comes to its end, as a busy disk makes all of them slower
  int num_old = 0, num_new = 0;
  ASSERT_EQ(run_into(out, writing({"a", "b", "old"}, State::good, '0', 1000), {"--no-report"}).code, 0);
  for (int i = 0; i < 60; ++i) {
    const char letter = static_cast<char>('A' + i % 26);
    const auto before = files_of(out);
    (void)run_into(out,
                   writing({"a", "b", "c", "d", "e", letter % 2 == 0 ? "even" : "odd"}, State::good, letter, 300'000),
                   {"--no-report"}, {}, [&](pid_t child) {
                     const double wait_us = max_wait_us * share(random);
                     std::this_thread::sleep_for(std::chrono::microseconds(static_cast<int>(wait_us)));
                     ::kill(child, SIGKILL);
                   });
    run_into(out, [](cli::Run&) -> ExitCode { throw InputError("bad data"); });  // clears what the other left
    const auto now = files_of(out);
    ++(now == before ? num_old : num_new);
    max_wait_us *= now == before ? 1.1 : 0.9;
    if (now == before) continue;
    EXPECT_EQ(now.size(), 7u);
    for (const auto& [name, content] : now) EXPECT_EQ(content.find_first_not_of(letter) == 0, name == "result.json");
  }
  EXPECT_GT(num_old, 0);
  EXPECT_GT(num_new, 0);
}

TEST(NothingLost, APageOfManyImagesKeepsToItsSize) {
  const TemporaryFolder folder;
  const Work work = [](cli::Run& run) {
    for (int i = 0; i < 1000; ++i) run.add_image(std::to_string(i) + ".jpg", std::string(30'000, 'j'));
    return run.finish(verdict_of(State::good));
  };
  ASSERT_EQ(run_into(folder.path(), work).code, 0);
  const std::string page = read_file(folder.path() / "report.html");
  if (page.size() < 100'000) GTEST_SKIP() << "built without the page of web/";
  EXPECT_LE(page.size(), 12'000'000u);
  EXPECT_GE(page.size(), 11'000'000u);
  EXPECT_THAT(page, HasSubstr("data-name=\"0.jpg\""));
  EXPECT_THAT(page, Not(HasSubstr("data-name=\"999.jpg\"")));
}

TEST(NothingLost, AFileElsewhereIsWrittenAsTheOthersAre) {
  const TemporaryFolder folder;
  write_file(folder.path() / "b.yaml", "old");
  const Work work = [&](cli::Run& run) {
    run.add_file_elsewhere(folder.path() / "b.yaml", "new");
    return run.finish(verdict_of(State::good));
  };
  const fs::path out = folder.path() / "out";
  EXPECT_EQ(run_into(out, work, {"--json"}, full_stdout).code, 3);
  EXPECT_EQ(files_of(folder.path()), (std::map<std::string, std::string>{{"b.yaml", "old"}}));
  EXPECT_EQ(run_into(out, work, {"--json"}).code, 0);
  EXPECT_EQ(read_file(folder.path() / "b.yaml"), "new");
}

}  // namespace
}  // namespace alidade::cli::nothing_lost
