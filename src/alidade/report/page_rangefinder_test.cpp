#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <chrono>
#include <nlohmann/json.hpp>

#include "alidade/report/page.h"
#include "alidade/testing/page_markup.h"
#include "alidade/testing/rangefinder_document_sample.h"

namespace alidade {
namespace {

using ::testing::HasSubstr;
using ::testing::Not;
using Json = nlohmann::ordered_json;
using testing::card_of;
using testing::expect_balanced;
using testing::marks_of;
using testing::occurrences;

constexpr const char* all_figures[] = {"estimate",  "beam",   "residuals", "photo",
                                       "precision", "counts", "next",      "all-photos"};

const Json& whole_document() {
  static const Json document = testing::sample_rangefinder_document("reference", RangefinderMethod::joint);
  return document;
}

/// Boards that are all parallel, and no spots: refused.
const Json& refused_document() {
  static const Json document = testing::sample_rangefinder_document("parallel", RangefinderMethod::plane);
  return document;
}

std::string page_of(const Json& document, const std::map<std::string, std::string>& pictures = {}) {
  return report_page(document.dump(), pictures);
}

/// The page without where it comes from and the document that it carries.
std::string markup_of(const std::string& page) { return page.substr(0, page.find("<footer")); }

int rows_of(const Json& document, const char* table) {
  return static_cast<int>(document["data"][table].begin().value().size());
}

TEST(RangefinderPage, HasEveryFigure) {
  const std::string page = page_of(whole_document());
  for (const char* id : all_figures) {
    EXPECT_NE(card_of(page, id), "") << id;
    EXPECT_EQ(occurrences(card_of(page, id), "nan"), 0u) << id;
  }
  EXPECT_EQ(occurrences(page, "Left out"), 0u);
  expect_balanced(page);
}

TEST(RangefinderPage, DrawsWhatTheTablesHold) {
  const Json& document = whole_document();
  const std::string page = page_of(document);
  const int shots = rows_of(document, "shots");
  ASSERT_EQ(shots, 18);
  EXPECT_EQ(marks_of(page, "beam"), shots);
  EXPECT_EQ(marks_of(page, "residuals"), shots);
  EXPECT_EQ(marks_of(page, "photo"), shots);
  EXPECT_EQ(marks_of(page, "counts"), rows_of(document, "by_count"));
  EXPECT_EQ(marks_of(page, "precision"), 3 + 4);
  EXPECT_EQ(marks_of(page, "next"), static_cast<int>(document["grids"]["next_shot"]["sigma_point_m"].size()));
  const std::string residuals = card_of(page, "residuals");
  EXPECT_EQ(occurrences(residuals, "<g class=\"pick"), 18u);
  EXPECT_THAT(residuals, HasSubstr("<summary>2 shots not used</summary>"));
  EXPECT_THAT(residuals, HasSubstr("outlier: its range is"));
  const std::string beam = card_of(page, "beam");
  EXPECT_EQ(occurrences(beam, "<g class=\"board pick"), 2u * 3 * 18) << "in three views, for wide and for narrow pages";
  EXPECT_EQ(occurrences(beam, "class=\"origin-ellipsoid\""), 2u * 4) << "and once from near";
  EXPECT_EQ(occurrences(beam, "class=\"hit-unused\""), 2u * 3 * 2);
}

TEST(RangefinderPage, EstimatesAreThoseOfTheDocument) {
  Json document = whole_document();
  document["estimate"]["origin_m"] = {0.0801, -0.0402, 0.0103};
  document["stddev"]["origin_m"] = {0.0002, 0.0003, 0.0011};
  document["estimate"]["theta_x_rad"] = 1.5;
  document["stddev"]["theta_x_rad"] = 0.001;
  const std::string estimate = card_of(page_of(document), "estimate");
  EXPECT_THAT(estimate, HasSubstr("<th>origin x</th><td class=\"value\">80.10</td><td>± 0.60</td>"));
  EXPECT_THAT(estimate, HasSubstr("<th>origin z</th><td class=\"value\">10.3</td><td>± 3.3</td>"));
  EXPECT_THAT(estimate, HasSubstr("<th>angle to the x axis</th><td class=\"value\">85.94</td><td>± 0.17</td>"));
  EXPECT_THAT(estimate, HasSubstr("<th>scale of the readings</th><td class=\"value\">1</td><td>held</td>"));
}

TEST(RangefinderPage, SharesAreThoseOfTheTable) {
  Json document = whole_document();
  Json& shots = document["data"]["shots"];
  for (std::size_t i = 0; i < 18; ++i) {
    shots["used"][i] = true;
    shots["residual_u_px"][i] = shots["residual_v_px"][i] = nullptr;
    shots["residual_range_m"][i] = i < 4 ? Json(i == 0 ? 0.0031 : 0.0029) : Json();
    shots["sigma_residual_range_m"][i] = 0.001;
  }
  EXPECT_THAT(card_of(page_of(document), "residuals"), HasSubstr("75.0 % are inside"));
  EXPECT_EQ(marks_of(page_of(document), "residuals"), 4);
}

TEST(RangefinderPage, NamesTheBestNextShot) {
  Json document = whole_document();
  Json& grid = document["grids"]["next_shot"];
  for (Json& value : grid["sigma_point_m"]) value = 0.002;
  grid["sigma_point_m"][5] = 0.001;
  grid["distance_m"][5] = 1.25;
  grid["tilt_rad"][5] = 0.5236;
  EXPECT_THAT(
      card_of(page_of(document), "next"),
      HasSubstr("Best, framed: board 1.2 m away along the beam, tilted 30°. A point along the beam then has σ 1 "
                "mm; after the worst choice 2 mm."));
}

TEST(RangefinderPage, ShowsThePhotosThatItIsGiven) {
  const Json& document = whole_document();
  const std::string name = document["data"]["shots"]["name"][3];
  const std::string page = page_of(document, {{name, "\xff\xd8 a jpeg"}});
  EXPECT_EQ(occurrences(page, "data:image/jpeg"), 1u);
  EXPECT_THAT(card_of(page, "photo"), Not(HasSubstr("Without photos")));
  EXPECT_THAT(card_of(page, "photo"), HasSubstr("href=\"#picture-3\"")) << "a shot with a photo is shown first";
  EXPECT_THAT(card_of(page_of(document), "photo"), HasSubstr("Without photos"));
  EXPECT_THAT(card_of(page, "all-photos"), HasSubstr("class=\"thumbs\""));
  expect_balanced(page);
}

TEST(RangefinderPage, WithoutACameraThePhotoIsLeftOut) {
  Json document = whole_document();
  document["estimate"].erase("camera");
  const std::string page = page_of(document);
  EXPECT_EQ(card_of(page, "photo"), "");
  EXPECT_EQ(occurrences(page, "href=\"#picture-"), 0u);
  EXPECT_THAT(page, HasSubstr("Left out, as this run has no data for them: Is the spot where the beam puts it?"));
  EXPECT_NE(card_of(page, "beam"), "");
  expect_balanced(page);
}

TEST(RangefinderPage, WithoutABoardPlanesAreStillDrawn) {
  Json document = whole_document();
  document["estimate"].erase("board");
  EXPECT_EQ(occurrences(card_of(page_of(document), "beam"), "class=\"plane\""), 2u * 3 * 16 + 1) << "and the legend's";
}

TEST(RangefinderPage, ARefusalSaysWhatCannotBeTold) {
  const Json& document = refused_document();
  ASSERT_EQ(document["verdict"]["state"], "refused");
  const std::string page = page_of(document);
  const std::string refusal = card_of(page, "refusal");
  EXPECT_THAT(refusal, HasSubstr(document["verdict"]["sentence"].get<std::string>()));
  EXPECT_THAT(refusal, HasSubstr("What to add: "));
  EXPECT_EQ(marks_of(page, "refusal"), static_cast<int>(document["verdict"]["checks"].size()));
  EXPECT_THAT(card_of(page, "estimate"), Not(HasSubstr("The origin is where a reading would be zero")));
  EXPECT_NE(card_of(page, "beam"), "") << "the boards at least";
  EXPECT_EQ(card_of(page_of(whole_document()), "refusal"), "");
  expect_balanced(page);
}

TEST(RangefinderPage, SurvivesEveryPartMissing) {
  for (const Json* whole : {&whole_document(), &refused_document()})
    for (const auto& [table, columns] : (*whole)["data"].items()) {
      Json document = *whole;
      document["data"].erase(table);
      expect_balanced(page_of(document));
      for (const auto& [column, values] : columns.items())
        for (const Json& value : {Json(), Json(0), Json(-1e300), Json("<b>")}) {
          document = *whole;
          for (Json& each : document["data"][table][column]) each = value;
          expect_balanced(page_of(document));
        }
      document["data"][table] = Json::object();
      expect_balanced(page_of(document));
    }
}

void fill_with(Json& json, const Json& value) {
  if (json.is_structured())
    for (Json& child : json) fill_with(child, value);
  else
    json = value;
}

TEST(RangefinderPage, SurvivesNullsZerosAndHugeNumbersEverywhere) {
  for (const Json& value : {Json(), Json(0), Json(-1), Json(1e300), Json(-1e300), Json("word")})
    for (const char* part : {"estimate", "stddev", "covariance", "data", "grids"}) {
      Json document = whole_document();
      fill_with(document[part], value);
      expect_balanced(page_of(document));
      for (const char* other : {"estimate", "stddev", "covariance", "data", "grids"}) fill_with(document[other], value);
      const std::string page = page_of(document);
      expect_balanced(page);
      EXPECT_EQ(occurrences(markup_of(page).substr(page.find("<main")), "nan"), 0u) << part << " " << value;
    }
}

TEST(RangefinderPage, HostileNamesAreShownAsText) {
  const std::string evil = "<&\"</script><b>'";
  Json document = whole_document();
  for (Json& name : document["data"]["shots"]["name"]) name = evil;
  for (Json& name : document["data"]["planes"]["name"]) name = evil;
  for (Json& reason : document["data"]["shots"]["reason"]) reason = evil;
  document["verdict"]["state"] = "refused";
  document["verdict"]["sentence"] = document["verdict"]["to_add"] = evil;
  for (Json& check : document["verdict"]["checks"]) check["text"] = check["unit"] = evil;
  const std::string page = page_of(document, {{evil, "jpeg"}});
  EXPECT_EQ(occurrences(markup_of(page), "<b>'"), 0u);
  EXPECT_THAT(markup_of(page), HasSubstr("&lt;&amp;&quot;&lt;/script"));
  expect_balanced(page);
}

TEST(RangefinderPage, ManyShotsStayReadable) {
  Json document = whole_document();
  for (const char* table : {"shots", "planes"})
    for (auto& [column, values] : document["data"][table].items()) {
      const Json few = values;
      for (int copy = 1; copy < 100; ++copy)
        for (const Json& value : few)
          values.push_back(column == "name" ? Json(value.get<std::string>() + "." + std::to_string(copy)) : value);
    }
  const auto begin = std::chrono::steady_clock::now();
  const std::string page = page_of(document);
  const std::chrono::duration<double> seconds = std::chrono::steady_clock::now() - begin;
  EXPECT_LT(seconds.count(), 2.0);
  EXPECT_LT(page.size(), 4'000'000u);
  EXPECT_GT(marks_of(page, "residuals"), 300) << "with all that were not used";
  expect_balanced(page);
}

}  // namespace
}  // namespace alidade
