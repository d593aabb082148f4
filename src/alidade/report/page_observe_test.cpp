#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <chrono>
#include <fstream>
#include <nlohmann/json.hpp>
#include <set>

#include "alidade/report/page.h"
#include "alidade/report/thin.h"
#include "alidade/testing/observe_sample.h"
#include "alidade/testing/page_markup.h"

namespace alidade {
namespace {

using ::testing::HasSubstr;
using ::testing::Not;
using Json = nlohmann::ordered_json;
using testing::card_of;
using testing::expect_balanced;
using testing::marks_of;
using testing::occurrences;
using testing::sample_observe_document;

constexpr const char* all_figures[] = {"estimate", "intrinsics", "motion", "directions", "nis", "points", "tracks"};

/// The page without the document that it carries.
std::string markup_of(const std::string& page) { return page.substr(0, page.find("<script")); }

std::size_t rows_of(const Json& document, const char* table) { return document["data"][table].begin().value().size(); }

TEST(ObservePage, HasEveryFigure) {
  const Json document = sample_observe_document(601, 3000);
  const std::string page = report_page(document.dump(), {});
  for (const char* id : all_figures) EXPECT_NE(card_of(page, id), "") << id;
  EXPECT_EQ(occurrences(page, "Left out"), 0u);
  for (const char* id : all_figures) EXPECT_EQ(occurrences(card_of(page, id), "nan"), 0u) << id;
  expect_balanced(page);
}

TEST(ObservePage, DrawsWhatTheTablesHold) {
  const Json document = sample_observe_document(601, 3000);
  const std::string page = report_page(document.dump(), {});
  const int with_estimate = static_cast<int>(
      std::ranges::count_if(document["data"]["steps"]["fx_px"], [](const Json& value) { return value.is_number(); }));
  EXPECT_EQ(marks_of(page, "intrinsics"), with_estimate);
  EXPECT_EQ(marks_of(page, "nis"), with_estimate - 6) << "without those of the events";
  EXPECT_EQ(marks_of(page, "motion"), 601);
  EXPECT_EQ(marks_of(page, "directions"), 601);
  EXPECT_EQ(marks_of(page, "points"), static_cast<int>(rows_of(document, "points")));
  EXPECT_EQ(marks_of(page, "tracks"), static_cast<int>(rows_of(document, "points")));
  const std::string intrinsics = card_of(page, "intrinsics");
  EXPECT_EQ(occurrences(intrinsics, "class=\"truth\""), 4u + 1);  // and the legend's
  EXPECT_EQ(occurrences(intrinsics, "class=\"bound\""), 4u + 1);
  EXPECT_EQ(occurrences(intrinsics, "class=\"zoom-span\""), 8u);  // in both parts of four panels
  EXPECT_THAT(intrinsics, HasSubstr("a point left out: slipped (p3)"));
  EXPECT_THAT(intrinsics, HasSubstr("<summary>6 events</summary>"));
  EXPECT_THAT(card_of(page, "motion"), HasSubstr("fx − cx"));
  EXPECT_EQ(occurrences(card_of(page, "points"), "class=\"bar-fill\""), 6u);
}

TEST(ObservePage, SharesAreThoseOfTheTable) {
  Json document = sample_observe_document(601, 600);
  Json& steps = document["data"]["steps"];
  // 8 degrees of freedom, χ²: 95 % lie in 2.18…17.5. Three of four are inside.
  for (std::size_t i = 0; i < 601; ++i) {
    steps["nis_dof"][i] = 8;
    steps["nis"][i] = i < 4 ? Json(i == 0 ? 17.7 : 17.3) : Json();
  }
  EXPECT_THAT(card_of(report_page(document.dump(), {}), "nis"), HasSubstr("75.0 % are inside"));
  steps["nis"][1] = 2.1;
  EXPECT_THAT(card_of(report_page(document.dump(), {}), "nis"), HasSubstr("50.0 % are inside"));
}

TEST(ObservePage, SurvivesEveryPartMissing) {
  const Json whole = sample_observe_document(61, 300);
  for (const auto& [table, columns] : whole["data"].items()) {
    Json document = whole;
    document["data"].erase(table);
    expect_balanced(report_page(document.dump(), {}));
    for (const auto& [column, values] : columns.items()) {
      document = whole;
      document["data"][table].erase(column);
      expect_balanced(report_page(document.dump(), {}));
      document["data"][table][column] = Json::array();
      expect_balanced(report_page(document.dump(), {}));
      for (std::size_t i = 0; i < values.size(); ++i) document["data"][table][column].push_back(nullptr);
      expect_balanced(report_page(document.dump(), {}));
      for (Json& value : document["data"][table][column]) value = 0;
      expect_balanced(report_page(document.dump(), {}));
      for (Json& value : document["data"][table][column]) value = -1e300;
      expect_balanced(report_page(document.dump(), {}));
    }
  }
}

TEST(ObservePage, SaysWhichFiguresAreLeftOut) {
  Json document = sample_observe_document(61, 300);
  document["data"] = {{"steps", {{"t_s", {0.0, 0.1}}, {"fx_px", {700.0, nullptr}}}}};
  const std::string page = report_page(document.dump(), {});
  EXPECT_NE(card_of(page, "intrinsics"), "");
  for (const char* id : {"motion", "directions", "nis", "points", "tracks"}) EXPECT_EQ(card_of(page, id), "") << id;
  EXPECT_EQ(occurrences(page, "Left out, as this run has no data for them: Did the motion tell enough? · Does each"),
            1u);
}

TEST(ObservePage, WithoutPictureSizeTruthOrBoundThereIsStillAPage) {
  Json document = sample_observe_document(301, 600);
  document["estimate"]["camera"].erase("width");
  document["estimate"].erase("sigma_px");
  Json& steps = document["data"]["steps"];
  for (const char* name : {"fx", "fy", "cx", "cy"})
    for (const char* kind : {"truth_", "bound_"}) steps.erase(std::string(kind) + name + "_px");
  for (std::size_t i = 0; i < 301; ++i) steps["t_s"][i] = 1.7e9 + 0.1 * static_cast<double>(i);
  const std::string page = report_page(document.dump(), {});
  for (const char* id : all_figures) EXPECT_NE(card_of(page, id), "") << id;
  EXPECT_THAT(card_of(page, "tracks"), HasSubstr("what the pixels take up"));
  EXPECT_THAT(card_of(page, "intrinsics"), HasSubstr("time since the first row, s"));
  EXPECT_THAT(card_of(page, "intrinsics"), Not(HasSubstr("truth")));
  expect_balanced(page);
}

TEST(ObservePage, ARefusedRunQuotesNoValue) {
  Json document = sample_observe_document(61, 60);
  EXPECT_THAT(card_of(report_page(document.dump(), {}), "intrinsics"), HasSubstr("at the end"));
  document["verdict"]["state"] = "refused";
  EXPECT_THAT(card_of(report_page(document.dump(), {}), "intrinsics"), Not(HasSubstr("at the end")));
}

TEST(ObservePage, AnUnknownEventIsShownAsText) {
  Json document = sample_observe_document(61, 60);
  document["data"]["steps"]["event"][30] = "<b>new</b>";
  const std::string page = report_page(document.dump(), {});
  EXPECT_THAT(markup_of(page), HasSubstr("&lt;b&gt;new"));
  EXPECT_THAT(markup_of(page), Not(HasSubstr("<b>new")));
}

/// The document as its writer thins it.
void thin(Json& table, std::size_t most, const std::vector<std::string>& extremes) {
  const std::size_t num_rows = table.begin().value().size();
  std::vector<std::vector<double>> columns;
  std::vector<bool> keep(num_rows, false);
  for (const std::string& name : extremes) {
    columns.emplace_back();
    for (const Json& value : table[name])
      columns.back().push_back(value.is_number() ? value.get<double>() : std::nan(""));
  }
  if (table.contains("event"))
    for (std::size_t i = 0; i < num_rows; ++i) keep[i] = table["event"][i] != "";
  const auto rows = report::thinned_rows(num_rows, columns, keep, most);
  for (Json& column : table) {
    Json kept = Json::array();
    for (const std::size_t row : rows) kept.push_back(column[row]);
    column = kept;
  }
}

TEST(ObservePage, ALongLogMakesASmallPageInNoTime) {
  Json document = sample_observe_document(10'001, 60'000);
  EXPECT_LT(markup_of(report_page(document.dump(), {})).size(), 700u * 1024) << "the figures themselves are bounded";
  thin(document["data"]["steps"], 2000, {"fx_px", "fy_px", "nis"});
  thin(document["data"]["points"], 6000, {"residual_u_px"});
  EXPECT_EQ(std::ranges::count_if(document["data"]["steps"]["event"], [](const Json& e) { return e != ""; }), 6);
  const std::string text = document.dump();
  const auto start = std::chrono::steady_clock::now();
  const std::string page = report_page(text, {});
  const double seconds = std::chrono::duration<double>(std::chrono::steady_clock::now() - start).count();
  RecordProperty("ms", std::to_string(1e3 * seconds));
  RecordProperty("kilobytes", std::to_string(page.size() / 1024));
  EXPECT_LT(page.size(), 1536u * 1024);
#ifdef NDEBUG
  EXPECT_LT(seconds, 0.3);
#endif
}

TEST(ThinnedRows, KeepExtremesFlaggedAndEnds) {
  constexpr std::size_t num_rows = 10'000;
  std::vector<double> wave(num_rows);
  for (std::size_t i = 0; i < num_rows; ++i) wave[i] = std::sin(0.001 * static_cast<double>(i));
  wave[1234] = 9.0;
  wave[1235] = std::nan("");
  wave[7777] = -9.0;
  std::vector<bool> keep(num_rows, false);
  keep[4321] = true;
  const auto rows = report::thinned_rows(num_rows, {wave}, keep, 500);
  EXPECT_LE(rows.size(), 502u);
  EXPECT_TRUE(std::ranges::is_sorted(rows));
  const std::set<std::size_t> kept(rows.begin(), rows.end());
  EXPECT_EQ(kept.size(), rows.size());
  for (const std::size_t row : {0U, 1234U, 4321U, 7777U, 9999U}) EXPECT_TRUE(kept.contains(row)) << row;
  EXPECT_EQ(report::thinned_rows(10, {wave}, {}, 500).size(), 10u);
  EXPECT_TRUE(report::thinned_rows(0, {}, {}, 500).empty());
}

TEST(ThinnedCurve, IsBoundedAndKeepsItsShape) {
  std::vector<double> x, y;
  for (int i = 0; i < 100'000; ++i) {
    x.push_back(i * 0.004);
    y.push_back(i == 50'001 ? std::nan("") : i == 70'003 ? 99.0 : i % 2);
  }
  const auto pieces = report::thinned_curve({x, y}, 1.0);
  ASSERT_EQ(pieces.size(), 2u);
  std::size_t count = 0;
  bool has_peak = false;
  for (const auto& piece : pieces) {
    EXPECT_TRUE(std::ranges::is_sorted(piece));
    count += piece.size();
    for (const std::size_t i : piece) has_peak |= i == 70'003;
  }
  EXPECT_LE(count, 4u * 402);
  EXPECT_TRUE(has_peak);
  EXPECT_EQ(pieces.back().back(), 99'999u);
}

}  // namespace
}  // namespace alidade
