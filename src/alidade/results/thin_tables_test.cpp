#include "alidade/results/thin_tables.h"

#include <gtest/gtest.h>

#include <cmath>
#include <map>
#include <nlohmann/json.hpp>
#include <set>
#include <sstream>

namespace alidade {
namespace {

using nlohmann::json;
using Files = std::map<std::string, std::string>;

/// The document as it is written, and the files beside it.
std::pair<json, Files> written(ResultDocument document, std::size_t* size = nullptr) {
  Files files;
  const std::string text =
      result_text_of_size(document, [&](const std::string& name, std::string csv) { files[name] = std::move(csv); });
  if (size != nullptr) *size = text.size();
  return {json::parse(text), files};
}

/// Corners of so many photos, 54 each; every 1000th is rejected, one has by far the largest residual.
DataTable corners_of(int num_photos, std::size_t extreme) {
  std::vector<int> photo, col;
  std::vector<double> u, residual_u, residual_v, weight;
  for (int k = 0; k < num_photos; ++k) {
    for (int i = 0; i < 54; ++i) {
      const std::size_t row = photo.size();
      photo.push_back(k);
      col.push_back(i);
      u.push_back(std::round(100.0 * (300.0 + 200.0 * std::sin(static_cast<double>(row)))) / 100.0);
      residual_u.push_back(row == extreme ? 77.0 : std::round(1e4 * std::cos(static_cast<double>(row))) / 1e4);
      residual_v.push_back(std::round(1e4 * std::sin(3.0 * static_cast<double>(row))) / 1e4);
      weight.push_back(row % 1000 == 0 ? 0.0 : 1.0);
    }
  }
  return {"corners",
          {{"photo", photo},
           {"col", col},
           {"u_px", u},
           {"residual_u_px", residual_u},
           {"residual_v_px", residual_v},
           {"weight", weight}}};
}

TEST(ThinTables, TablesThatAreNotLongAreLeftAlone) {
  ResultDocument document;
  document.data.push_back(corners_of(1111, 5));  // 59 994 rows
  const auto [value, files] = written(document);
  EXPECT_TRUE(files.empty());
  EXPECT_FALSE(value["data"]["corners"].contains("thinned"));
  EXPECT_EQ(value["data"]["corners"]["photo"].size(), 59'994u);
}

TEST(ThinTables, CornersOfTwoThousandPhotosKeepExtremesAndFlaggedRows) {
  ResultDocument document;
  document.data.push_back(corners_of(2000, 54'321));
  std::size_t size = 0;
  const auto [value, files] = written(document, &size);
  const json& corners = value["data"]["corners"];
  const std::size_t kept = corners["photo"].size();
  EXPECT_LE(kept, max_corner_rows);
  EXPECT_GT(kept, max_corner_rows / 2);
  EXPECT_EQ(corners["thinned"]["from"], 108'000);
  EXPECT_EQ(corners["thinned"]["to"], kept);
  EXPECT_NE(corners["thinned"]["how"].get<std::string>().find("corners_all.csv"), std::string::npos);
  EXPECT_LE(size, max_result_bytes);
  std::size_t num_left_out = 0, num_extreme = 0;
  std::set<int> photos;
  for (std::size_t i = 0; i < kept; ++i) {
    num_left_out += corners["weight"][i] == 0.0 ? 1 : 0;
    num_extreme += corners["residual_u_px"][i] == 77.0 ? 1 : 0;
    photos.insert(corners["photo"][i].get<int>());
  }
  EXPECT_EQ(num_left_out, 108u);
  EXPECT_EQ(num_extreme, 1u);
  EXPECT_EQ(photos.size(), 2000u) << "every photo has some";
}

TEST(ThinTables, EveryRowIsInTheFileBeside) {
  ResultDocument document;
  document.data.push_back(corners_of(2000, 5));
  const auto [value, files] = written(document);
  std::istringstream lines(files.at("corners_all.csv"));
  std::string line;
  std::getline(lines, line);
  EXPECT_EQ(line, "photo,col,u_px,residual_u_px,residual_v_px,weight");
  for (int i = 0; i < 6; ++i) std::getline(lines, line);
  EXPECT_EQ(line.substr(0, 4), "0,5,");
  EXPECT_NE(line.find(",77,"), std::string::npos);
  std::size_t count = 6;
  while (std::getline(lines, line)) ++count;
  EXPECT_EQ(count, 108'000u);
}

TEST(ThinTables, WhereMostRowsAreFlaggedTheTableIsThinnedAllTheSame) {
  constexpr std::size_t num = 100'000;
  std::vector<double> t;
  std::vector<bool> accepted;
  std::vector<std::string> events;
  for (std::size_t i = 0; i < num; ++i) {
    t.push_back(static_cast<double>(i));
    accepted.push_back(i % 3 == 0);
    events.emplace_back(i == 70'001 ? "a \"quoted\", word" : "");
  }
  ResultDocument document;
  document.data.push_back({"steps", {{"t_s", t}, {"accepted", accepted}, {"event", events}}});
  const auto [value, files] = written(document);
  EXPECT_LE(value["data"]["steps"]["t_s"].size(), max_table_rows);
  EXPECT_GT(value["data"]["steps"]["t_s"].size(), max_table_rows / 2);
  EXPECT_NE(files.at("steps_all.csv").find("70001,false,\"a \"\"quoted\"\", word\"\n"), std::string::npos);
}

TEST(ThinTables, ManyLongTablesTogetherKeepToTheSizeOfADocument) {
  ResultDocument document;
  std::vector<double> numbers;
  for (int i = 0; i < 30'000; ++i) numbers.push_back(std::sin(i));
  for (int k = 0; k < 60; ++k) document.data.push_back({"table_" + std::to_string(k), {{"residual_px", numbers}}});
  std::size_t size = 0;
  const auto [value, files] = written(document, &size);
  EXPECT_LE(size, max_result_bytes);
  EXPECT_EQ(files.size(), 60u);
  EXPECT_EQ(value["data"]["table_7"]["thinned"]["from"], 30'000);
  EXPECT_EQ(value["data"]["table_7"]["thinned"]["to"], value["data"]["table_7"]["residual_px"].size());
}

TEST(ThinTables, ColumnsOfUnequalLengthAreAFaultOfTheProgramAsEver) {
  ResultDocument document;
  document.data.push_back({"t", {{"a", std::vector<double>(30'000)}, {"b", std::vector<double>(2)}}});
  EXPECT_THROW((void)written(document), std::logic_error);
}

}  // namespace
}  // namespace alidade
