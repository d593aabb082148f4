#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <filesystem>
#include <sstream>

#include "alidade/testing/process.h"

// The executable as a user, or a script, meets it.

namespace alidade {
namespace {

using ::testing::HasSubstr;
using ::testing::MatchesRegex;
using testing::Outcome;
using testing::run_program;

Outcome run_alidade(std::vector<std::string> words) {
  words.insert(words.begin(), ALIDADE_EXECUTABLE);
  return run_program(words);
}

/// The commands that a help text lists.
std::vector<std::string> listed_commands(const std::string& help) {
  std::vector<std::string> names;
  const std::size_t at = help.find("Subcommands:");
  if (at == std::string::npos) return names;
  std::istringstream lines(help.substr(at));
  for (std::string line, name; std::getline(lines, line);) {
    if (!line.starts_with("  ") || line.starts_with("   ")) continue;  // a heading, or a description's second line
    std::istringstream(line) >> name;
    names.push_back(name);
  }
  return names;
}

/// Every command line that has a --help of its own: "calibrate", "camera show", …
void collect_commands(const std::vector<std::string>& group, std::vector<std::vector<std::string>>& commands) {
  std::vector<std::string> words = group;
  words.emplace_back("--help");
  for (const std::string& name : listed_commands(run_alidade(words).out)) {
    std::vector<std::string> command = group;
    command.push_back(name);
    const std::size_t before = commands.size();
    collect_commands(command, commands);
    if (commands.size() == before) commands.push_back(command);
  }
}

std::vector<std::vector<std::string>> all_commands() {
  std::vector<std::vector<std::string>> commands;
  collect_commands({}, commands);
  return commands;
}

std::string joined(const std::vector<std::string>& words) {
  std::string text;
  for (const std::string& word : words) text += (text.empty() ? "" : " ") + word;
  return text;
}

TEST(Executable, EveryCommandHasHelpWithExamplesOfItself) {
  int num_checked = 0;
  for (std::vector<std::string> command : all_commands()) {
    const std::string name = joined(command);
    command.emplace_back("--help");
    const Outcome outcome = run_alidade(command);
    EXPECT_EQ(outcome.code, 0) << name;
    EXPECT_EQ(outcome.err, "") << name;
    EXPECT_THAT(outcome.out, HasSubstr("Examples:")) << name;
    EXPECT_THAT(outcome.out.substr(outcome.out.find("Examples:")), HasSubstr("alidade " + name));
    EXPECT_THAT(outcome.out, HasSubstr("--json"));
    ++num_checked;
  }
  EXPECT_GE(num_checked, 5);
}

TEST(Executable, EveryCommandRefusesAnUnknownOption) {
  int num_checked = 0;
  for (std::vector<std::string> command : all_commands()) {
    const std::string name = joined(command);
    command.emplace_back("--no-such-option");
    const Outcome outcome = run_alidade(command);
    EXPECT_EQ(outcome.code, 2) << name;
    EXPECT_THAT(outcome.err, MatchesRegex("alidade: error: " + name + ": unknown option '--no-such-option'[^\n]*\n"));
    EXPECT_EQ(outcome.out, "") << name;
    ++num_checked;
  }
  EXPECT_GE(num_checked, 5);
}

TEST(Executable, EveryCommandThatNeedsSomethingSaysSo) {
  int num_refused = 0;
  for (const std::vector<std::string>& command : all_commands()) {
    if (command[0] == "simulate" || command[0] == "study") continue;  // need nothing, and would write here
    if (joined(command) == "fleet watch") continue;                   // a broker on this machine is its default
    const Outcome outcome = run_alidade(command);
    EXPECT_EQ(outcome.code, 2) << joined(command) << ": " << outcome.err;
    EXPECT_THAT(outcome.err, MatchesRegex("alidade: error: [^\n]+\n"));
    ++num_refused;
  }
  EXPECT_GE(num_refused, 5);
}

TEST(Executable, UnknownCommandsAndNoCommandAreWrongUsage) {
  EXPECT_EQ(run_alidade({}).code, 2);
  EXPECT_EQ(run_alidade({"levitate"}).err, "alidade: error: unknown command 'levitate'\n");
  EXPECT_THAT(run_alidade({"calibrat"}).err, HasSubstr("did you mean 'calibrate'?"));
  EXPECT_THAT(run_alidade({"calibrat", "photos", "--board", "9x6", "--out", "x", "--none"}).err,
              HasSubstr("unknown command 'calibrat'; did you mean 'calibrate'?"));
  EXPECT_THAT(run_alidade({"camera", "shw", "a.yaml", "--json"}).err, HasSubstr("unknown command 'shw'"));
}

TEST(Executable, HelpIsACommandToo) {
  EXPECT_EQ(run_alidade({"help"}).out, run_alidade({"--help"}).out);
  const Outcome outcome = run_alidade({"help", "camera", "show"});
  EXPECT_EQ(outcome.code, 0);
  EXPECT_EQ(outcome.out, run_alidade({"camera", "show", "--help"}).out);
  for (const std::vector<std::string>& words :
       {std::vector<std::string>{"help", "calibrat"}, {"help", "plan", "nosuch"}, {"simulate", "nosuch", "--help"}}) {
    const Outcome unknown = run_alidade(words);
    EXPECT_EQ(unknown.code, 2) << joined(words);
    EXPECT_THAT(unknown.err,
                HasSubstr("unknown command '" + std::string(words[0] == "help" ? words.back() : words[1])));
  }
}

/// A file is read twice, for its checksum and for its content: of a pipe the second found nothing.
TEST(Executable, InputsMayComeByAPipe) {
  const testing::TemporaryFolder folder;
  const auto in_shell = [&](const std::string& line) {
    return run_program({"/bin/bash", "-c", std::string("alidade() { ") + ALIDADE_EXECUTABLE + " \"$@\"; }; " + line},
                       folder.path().string());
  };
  ASSERT_EQ(in_shell("alidade simulate track --duration 3 --out sim --quiet --no-report").code, 0);
  const std::string asked = " --rig sim/rig.yaml --json --no-report --out ";
  const std::string by_name = in_shell("alidade track sim/events.csv --truth sim/truth.csv" + asked + "a").out;
  const auto estimate_of = [](const std::string& text) {
    const std::size_t at = text.find("\"estimate\""), end = text.find("\"seconds\"");
    return text.substr(at, end == std::string::npos ? end : end - at);
  };
  ASSERT_THAT(by_name, HasSubstr("\"rms_m\""));
  for (const std::string line : {"alidade track <(cat sim/events.csv) --truth=<(cat sim/truth.csv)",
                                 "cat sim/events.csv | alidade track /dev/stdin --truth sim/truth.csv"}) {
    const Outcome outcome = in_shell(line + asked + "b");
    EXPECT_EQ(outcome.code, 0) << outcome.err;
    EXPECT_EQ(estimate_of(outcome.out).substr(0, 2000), estimate_of(by_name).substr(0, 2000)) << line;
  }
  EXPECT_THAT(in_shell("alidade track <(true)" + asked + "c").err, HasSubstr("is empty"));
}

/// Half of a camera's observations are not solved for by design: the schema says so.
TEST(Executable, TheSchemaOfRigSaysWhichObservationsOfAMovingTargetAreUsed) {
  EXPECT_THAT(run_alidade({"schema", "rig"}).out, HasSubstr("four or fewer per knot of the path"));
}

/// The program for fleets may be missing for any reason: what is said is where it was looked for.
TEST(Executable, AFleetWithoutItsProgramSaysWhereItWasLookedFor) {
  const testing::TemporaryFolder folder;
  const std::filesystem::path alone = folder.path() / "alidade";
  std::filesystem::copy_file(ALIDADE_EXECUTABLE, alone);
  const Outcome outcome = run_program({alone.string(), "fleet", "worker", "--size", "640x480"});
  EXPECT_EQ(outcome.code, 3);
  EXPECT_THAT(outcome.err, HasSubstr((folder.path() / "alidade-fleet").string() + ": is not there"));
}

TEST(Executable, AnOptionWithoutItsValueSaysWhatItTakes) {
  EXPECT_EQ(run_alidade({"observe", "log.csv", "--size"}).err,
            "alidade: error: observe: '--size' needs a value: WxH\n");
  EXPECT_EQ(run_alidade({"simulate", "board", "--seed"}).err,
            "alidade: error: simulate board: '--seed' needs a value: N\n");
  EXPECT_EQ(run_alidade({"simulate", "board", "--seed", "1", "--seed", "2"}).err,
            "alidade: error: simulate board: '--seed' is given more than once\n");
}

TEST(Executable, AnOptionBeforeItsCommandIsNamedWithItsPosition) {
  const std::pair<std::vector<std::string>, std::string> cases[] = {
      {{"--json", "calibrate", "a.jpg"}, "'--json' comes after the command: alidade calibrate --json …"},
      {{"--seed=3", "simulate", "board"}, "'--seed' comes after the command: alidade simulate board --seed …"},
      {{"camera", "--json", "show", "a.yaml"}, "'--json' comes after the command: alidade camera show --json …"},
      {{"--json", "camera"}, "'--json' comes after the command: alidade camera COMMAND --json …"},
      {{"--seed", "3"}, "'--seed' comes after the command: alidade COMMAND --seed …"}};
  for (const auto& [words, message] : cases) {
    const Outcome outcome = run_alidade(words);
    EXPECT_EQ(outcome.code, 2) << message;
    EXPECT_EQ(outcome.err, "alidade: error: " + message + "\n");
  }
}

TEST(Executable, NothingIsSuggestedThatIsFarFromWhatWasTyped) {
  EXPECT_EQ(run_alidade({"calibrate", "--heed"}).err, "alidade: error: calibrate: unknown option '--heed'\n");
  EXPECT_EQ(run_alidade({"run"}).err, "alidade: error: unknown command 'run'\n");
  EXPECT_THAT(run_alidade({"calibrate", "--jsno"}).err, HasSubstr("did you mean '--json'?"));
}

TEST(Executable, ABoardShapeThatIsNoWordIsWrongUsageAndAFileThatIsMissingBadInput) {
  const testing::TemporaryFolder folder;  // what is asked of the shape comes before the photos are looked for
  const auto shaped = [&](const std::string& shape) {
    return run_program(
        {ALIDADE_EXECUTABLE, "calibrate", "none.jpg", "--board", "9x6", "--square", "0.025", "--board-shape", shape},
        folder.path().string());
  };
  EXPECT_EQ(shaped("foo").code, 2);
  EXPECT_EQ(
      shaped("foo").err,
      "alidade: error: calibrate: --board-shape: 'foo' is not flat, bow, free or auto, nor a file of points that is "
      "there\n");
  EXPECT_EQ(shaped("points.csv").code, 3);
  EXPECT_THAT(shaped("points.csv").err, MatchesRegex("alidade: error: points.csv: cannot be read: [^\n]*\n"));
  EXPECT_THAT(shaped("auto").err, HasSubstr("none.jpg"));
  EXPECT_EQ(shaped(folder.path().string()).code, 3) << "a folder is there, but no file";
}

}  // namespace
}  // namespace alidade
