#include "alidade/results/result_document.h"

#include <gtest/gtest.h>

#include <limits>
#include <nlohmann/json.hpp>

namespace alidade {
namespace {

using nlohmann::json;

json parsed(const ResultDocument& document) { return json::parse(result_text(document)); }

TEST(JsonValue, KeepsOrderAndNesting) {
  JsonValue value;
  value["z"]["a"] = 1;
  value["b"].push_back("x");
  value["b"].push_back(2.5);
  value["c"] = std::vector<bool>{true, false};
  value["d"] = std::vector<std::string>{"p", "q"};
  value["e"] = std::vector<int>{3, 4};
  value["z"]["a"] = 7;
  EXPECT_EQ(value.text(), R"({"z":{"a":7},"b":["x",2.5],"c":[true,false],"d":["p","q"],"e":[3,4]})");
}

TEST(JsonValue, NumbersThatAreNotFiniteAreNull) {
  JsonValue value;
  value["a"] = std::numeric_limits<double>::quiet_NaN();
  value["b"] = std::vector<double>{1.5, -std::numeric_limits<double>::infinity()};
  EXPECT_EQ(value.text(), R"({"a":null,"b":[1.5,null]})");
}

TEST(JsonValue, NumbersSurviveTheText) {
  for (const double x : {0.1, 1.0 / 3.0, 5e-324, 1.7976931348623157e308, -532.8123456789012}) {
    EXPECT_EQ(json::parse(JsonValue(x).text()).get<double>(), x);
  }
}

TEST(JsonValue, TextThatIsNotUtf8StillMakesJson) {
  EXPECT_EQ(json::parse(JsonValue("M\xFCnchen\n\"<").text()).get<std::string>(), "M\xEF\xBF\xBDnchen\n\"<");
}

TEST(JsonValue, RoundedNumbersAreShort) {
  EXPECT_EQ(JsonValue(rounded({0.123456, -0.00004, 12.0}, 4)).text(), "[0.1235,0.0,12.0]");
}

TEST(ResultDocument, HasEveryMemberThoughNothingIsFilledIn) {
  const json value = parsed({});
  std::vector<std::string> missing;
  for (const char* key : {"schema", "command", "version", "argv", "created_utc", "seed", "seconds", "inputs", "verdict",
                          "counts", "estimate", "stddev", "covariance", "data", "grids"}) {
    if (!value.contains(key)) missing.emplace_back(key);
  }
  EXPECT_TRUE(missing.empty()) << missing.front();
  EXPECT_EQ(value["schema"], "alidade-result/1");
  EXPECT_TRUE(value["seed"].is_null());
  EXPECT_EQ(value["verdict"]["state"], "good");
}

TEST(ResultDocument, CarriesWhatItIsGiven) {
  ResultDocument document;
  document.command = "calibrate";
  document.argv = {"alidade", "calibrate", "a.jpg"};
  document.seed = 7;
  document.seconds = {{"total", 0.5}};
  document.inputs = {{"photo", "a.jpg", 3, "abc"}};
  document.verdict = {State::refused,
                      ExitCode::undetermined,
                      "two photos",
                      "add one",
                      {{"coverage", State::bad, "worst 3σ 2 px", 2.0, 0.5, "px", "trust"}}};
  document.counts = {3, 2, 0, {{"b.jpg", 0, "no board"}}};
  document.covariance_names = {"fx", "fy"};
  document.covariance_upper = {4.0, 0.5, 9.0};
  document.data = {{"photos", {{"name", std::vector<std::string>{"a", "b"}}, {"rms_px", std::vector<double>{1, 2}}}}};
  document.grids = {{"sigma", 2, 1, 0.0, 0.0, 10.0, 10.0, {{"sigma_px", {0.1, 0.2}}}}};
  const json value = parsed(document);
  EXPECT_EQ(value["argv"][1], "calibrate");
  EXPECT_EQ(value["seed"], 7);
  EXPECT_EQ(value["seconds"]["total"], 0.5);
  EXPECT_EQ(value["inputs"][0]["sha256"], "abc");
  EXPECT_EQ(value["verdict"]["exit_code"], 4);
  EXPECT_EQ(value["verdict"]["checks"][0]["state"], "bad");
  EXPECT_EQ(value["counts"]["skipped"][0]["reason"], "no board");
  EXPECT_EQ(value["covariance"]["upper"][2], 9.0);
  EXPECT_EQ(value["data"]["photos"]["name"][1], "b");
  EXPECT_EQ(value["grids"]["sigma"]["sigma_px"][1], 0.2);
}

TEST(ResultDocument, RefusesTablesOfUnequalColumns) {
  ResultDocument document;
  document.data = {{"t", {{"a", std::vector<double>{1, 2}}, {"b", std::vector<int>{1}}}}};
  EXPECT_THROW((void)result_text(document), std::logic_error);
  document.data = {{"t", {{"a", "not a list"}}}};
  EXPECT_THROW((void)result_text(document), std::logic_error);
}

TEST(ResultDocument, RefusesGridsAndCovariancesOfAnotherSize) {
  ResultDocument grid;
  grid.grids = {{"g", 2, 2, 0.0, 0.0, 1.0, 1.0, {{"x", {1.0}}}}};
  EXPECT_THROW((void)result_text(grid), std::logic_error);
  ResultDocument covariance;
  covariance.covariance_names = {"fx", "fy"};
  covariance.covariance_upper = {1.0, 2.0};
  EXPECT_THROW((void)result_text(covariance), std::logic_error);
}

}  // namespace
}  // namespace alidade
