#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <nlohmann/json.hpp>
#include <sstream>

#include "alidade/testing/command_test.h"

// `alidade fleet worker` on the rows of a file: whatever is not used is counted, and named with its line.

namespace alidade {
namespace {

using testing::Outcome;

class FleetWorkerCommand : public testing::CommandTest {
 protected:
  FleetWorkerCommand() {
    const Outcome outcome = alidade({"simulate", "fleet", "--cameras", "2", "--rows", "60", "--out", path("fleet")});
    EXPECT_EQ(outcome.code, 0) << outcome.err;
    std::istringstream in(read_file(path("fleet/rows.txt")));
    for (std::string line; std::getline(in, line);) lines_.push_back(line);
  }
  /// The lines, after `change` of each that is of this camera; empty: of any.
  template <class Change>
  [[nodiscard]] Outcome work_on_changed(const std::string& id, const Change& change) const {
    std::string text;
    for (const std::string& line : lines_) {
      const std::size_t space = line.find(' ');
      auto row = nlohmann::json::parse(line.substr(space + 1));
      if (id.empty() || line.substr(0, space) == id) change(row);
      text += line.substr(0, space) + " " + row.dump() + "\n";
    }
    return work_on(text);
  }
  [[nodiscard]] Outcome work_on(const std::string& text) const {
    write_file(path("rows.txt"), text);
    return alidade({"fleet", "worker", "--from", path("rows.txt"), "--size", "640x480", "--out", path("out")},
                   {"--no-report"});
  }
  [[nodiscard]] nlohmann::json result() const { return nlohmann::json::parse(read_file(path("out/result.json"))); }
  [[nodiscard]] std::string id() const { return lines_[0].substr(0, lines_[0].find(' ')); }

 private:
  std::vector<std::string> lines_;
};

TEST_F(FleetWorkerCommand, CountsAndNamesRowsThatSayNothing) {
  const Outcome outcome = work_on_changed(id(), [](nlohmann::json& row) {
    if (row["n"] == 30) row.erase("pan");
    if (row["n"] == 31) row["pan"] = "x";
    if (row["n"] == 32) row["t"] = 1e300;
  });
  EXPECT_EQ(outcome.code, 0) << outcome.err;
  const nlohmann::json counts = result()["counts"];
  EXPECT_EQ(counts["given"], 120);
  EXPECT_EQ(counts["used"], 117);
  EXPECT_EQ(counts["dropped"], 3);
  ASSERT_EQ(counts["skipped"].size(), 3u);
  EXPECT_EQ(counts["skipped"][0]["line"], 59);  // of two cameras in turn
  EXPECT_THAT(counts["skipped"][2]["reason"].get<std::string>(), ::testing::HasSubstr("t is not a number"));
  EXPECT_EQ(result()["verdict"]["state"], "good");
}

TEST_F(FleetWorkerCommand, NamesACameraWhoseRowsSayNothing) {
  const Outcome outcome = work_on_changed(id(), [](nlohmann::json& row) { row.erase("pan"); });
  EXPECT_EQ(outcome.code, 0) << outcome.err;
  EXPECT_EQ(result()["verdict"]["state"], "care");
  EXPECT_EQ(result()["counts"]["dropped"], 60);
  EXPECT_THAT(result()["verdict"]["sentence"].get<std::string>(),
              ::testing::AllOf(::testing::HasSubstr(id()), ::testing::HasSubstr("pan and tilt")));
}

/// A camera that is refused is no success; where all are, nothing has been estimated.
TEST_F(FleetWorkerCommand, IsNotGoodWhereACameraIsRefused) {
  const auto exchange = [](nlohmann::json& row) {
    for (const char* point : {"p1", "p2", "p3", "p4"})
      std::swap(row[std::string(point) + "x"], row[std::string(point) + "y"]);
  };
  const Outcome one = work_on_changed(id(), exchange);
  EXPECT_EQ(one.code, 0) << one.err;
  EXPECT_EQ(result()["verdict"]["state"], "care");
  EXPECT_THAT(
      result()["verdict"]["sentence"].get<std::string>(),
      ::testing::AllOf(::testing::HasSubstr(id()), ::testing::HasSubstr("x and y of the points are exchanged")));
  const Outcome all = work_on_changed("", exchange);
  EXPECT_EQ(all.code, 4) << all.err;
}

TEST_F(FleetWorkerCommand, TellsAClockThatWentBackAndATemperatureThatIsNone) {
  const Outcome clock = work_on_changed(id(), [](nlohmann::json& row) {
    if (row["n"] > 40) row["t"] = row["t"].get<double>() - 3600.0;
  });
  EXPECT_EQ(clock.code, 0) << clock.err;
  EXPECT_EQ(result()["verdict"]["state"], "care");
  EXPECT_THAT(result()["verdict"]["sentence"].get<std::string>(),
              ::testing::HasSubstr("its clock went back by 3599 s"));
  const Outcome hot = work_on_changed(id(), [](nlohmann::json& row) { row["temperature_c"] = "hot"; });
  EXPECT_EQ(hot.code, 0) << hot.err;
  EXPECT_EQ(result()["verdict"]["state"], "care");
  EXPECT_EQ(result()["counts"]["used"], 120);
  EXPECT_THAT(result()["counts"]["skipped"][0]["reason"].get<std::string>(),
              ::testing::HasSubstr("temperature_c is not"));
}

TEST_F(FleetWorkerCommand, WhatIsNoRowIsNamedWithItsLine) {
  const Outcome broken = work_on(id() + " {\"n\":1}\n" + id() + " nonsense\n");
  EXPECT_EQ(broken.code, 3);
  EXPECT_THAT(broken.err, ::testing::HasSubstr("rows.txt:2: "));
  EXPECT_EQ(work_on("").code, 3);
}

}  // namespace
}  // namespace alidade
