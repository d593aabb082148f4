#include "alidade/report/page.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <chrono>
#include <cmath>
#include <nlohmann/json.hpp>
#include <set>

#include "alidade/report/markup.h"
#include "alidade/report/plain_page.h"
#include "alidade/report/thin.h"

// What the page draws is tested in a browser: web/test. Here: that document and images arrive in it unharmed.
namespace alidade {
namespace {

using ::testing::HasSubstr;
using ::testing::Not;
using Json = nlohmann::json;

Json sample() {
  return {{"schema", "alidade-result/1"},
          {"command", "calibrate"},
          {"verdict", {{"state", "care"}, {"sentence", "The sentence."}, {"to_add", "Add a photo."}, {"checks", {}}}},
          {"estimate", {{"camera", {{"fx", 532.81}, {"model", "brown"}}}, {"origin_m", {0.1, 0.2, 0.3}}}},
          {"stddev", {{"camera", {{"fx", 0.43}}}, {"origin_m", {0.001, 0.001, 0.001}}}},
          {"data", {{"photos", {{"name", {"a.jpg", "b.jpg"}}, {"rms_px", {0.1, nullptr}}}}}}};
}

std::size_t occurrences(const std::string& text, const std::string& part) {
  std::size_t count = 0;
  for (std::size_t at = text.find(part); at != std::string::npos; at = text.find(part, at + part.size())) ++count;
  return count;
}

const std::string evil = "<img src=x onerror=alert(1)>\"'</script><script>alert(2)</script>";

TEST(ReportPage, EmbedsTheDocumentUnchanged) {
  Json document = sample();
  document["verdict"]["sentence"] = "a < b </script> ü @PICTURES@ @RESULT@";
  const std::string page = report_page(document.dump(), {});
  const std::string opening = "<script type=\"application/json\" id=\"result\">";
  const std::size_t begin = page.find(opening);
  if (begin == std::string::npos) GTEST_SKIP() << "built without the page of web/";
  const std::size_t from = begin + opening.size();
  const std::string embedded = page.substr(from, page.find("</script>", from) - from);
  EXPECT_THAT(embedded, Not(HasSubstr("<")));
  EXPECT_EQ(Json::parse(embedded), document);
  EXPECT_THAT(page, HasSubstr("<title>alidade calibrate</title>"));
  EXPECT_THAT(page, HasSubstr("three"));  // the licence notices
}

TEST(ReportPage, ImagesAreInertBlocks) {
  const std::string page = report_page(sample().dump(), {{"a.jpg", "jpeg"}, {evil, "other"}});
  if (page.find("id=\"result\"") == std::string::npos) GTEST_SKIP() << "built without the page of web/";
  EXPECT_EQ(occurrences(page, "<script type=\"text/plain\" id=\"image-"), 2u);
  EXPECT_THAT(page, HasSubstr(">anBlZw==</script>"));
  EXPECT_THAT(page, Not(HasSubstr("<img src=x")));
}

TEST(Speed, APageOfThirteenPhotosTakesNoTime) {
  std::map<std::string, std::string> images;
  for (int i = 0; i < 13; ++i) images[std::to_string(i)] = std::string(40'000, 'x');
  const std::string document = sample().dump() + std::string(200'000, ' ');
  double best_s = 1.0;
  for (int i = 0; i < 5; ++i) {
    const auto start = std::chrono::steady_clock::now();
    EXPECT_GT(report_page(document, images).size(), 1000u);
    best_s = std::min(best_s, std::chrono::duration<double>(std::chrono::steady_clock::now() - start).count());
  }
  EXPECT_LT(best_s, 0.060);  // of the half second from photos to report
}

TEST(PlainPage, SaysSentenceEstimateAndData) {
  const std::string page = report::plain_page(sample().dump());
  for (const char* part :
       {"care: The sentence.", "Add a photo.", "camera.fx", "532.8", "± 1.3", "origin_m[2]", "b.jpg"})
    EXPECT_THAT(page, HasSubstr(part));
}

TEST(PlainPage, SaysWhatWasTakenAsGivenAndTheIdealSigma) {
  Json document = sample();
  document["stddev_model"] = {{"camera", {{"fx", 0.21}}}, {"origin_m", {0.0004, 0.0005, 0.0006}}};
  document["assumed"] = {{{"name", "square_m"},
                          {"value", 0.025},
                          {"sigma", nullptr},
                          {"ordinary", 5e-5},
                          {"moves", 12.5},
                          {"moved", "origin_m z"},
                          {"moved_by", 0.0125}},
                         {{"name", "camera.fx"},
                          {"value", 800},
                          {"sigma", 0.7},
                          {"ordinary", nullptr},
                          {"moves", 0.25},
                          {"moved", "theta_x_rad"},
                          {"moved_by", 1e-4}},
                         {{"name", "rig.not_tested"},
                          {"value", nullptr},
                          {"sigma", 0},
                          {"moves", nullptr},
                          {"moved", "2 px of head1.camera.cx moves the target by 4.2 % of its range"}},
                         {{"name", evil}, {"value", nullptr}, {"sigma", 0}, {"moves", 0}, {"moved", nullptr}}};
  const std::string page = report::plain_page(document.dump());
  for (const char* part : {"± 1.3", "± 0.63", "± 0.0012", "± 0.0018", "Taken as given", "square_m", "not given",
                           "0.00005 more or less moves origin_m z by 12.5 of its σ", "camera.fx", "0.7",
                           "its σ moves theta_x_rad by 0.25 of its σ", "exact",
                           "<td>2 px of head1.camera.cx moves the target by 4.2 % of its range</td>"})
    EXPECT_THAT(page, HasSubstr(part));
  EXPECT_THAT(page, Not(HasSubstr("<img src=x")));
  EXPECT_THAT(report::plain_page(sample().dump()), Not(HasSubstr("Taken as given")));
}

TEST(PlainPage, HostileTextsStayTexts) {
  Json document = sample();
  document["verdict"]["sentence"] = evil;
  document["estimate"][evil] = evil;
  document["data"][evil] = {{evil, {evil, 1, nullptr}}};
  const std::string page = report::plain_page(document.dump());
  EXPECT_THAT(page, Not(HasSubstr("<img src=x")));
  EXPECT_EQ(occurrences(page, "<script"), 0u);
}

TEST(PlainPage, SurvivesEveryPartMissing) {
  for (const char* part : {"verdict", "estimate", "stddev", "stddev_model", "assumed", "data", "command"}) {
    for (const Json& instead : {Json(), Json(3), Json::array({1, nullptr}), Json("text")}) {
      Json document = sample();
      document[part] = instead;
      EXPECT_THAT(report::plain_page(document.dump()), HasSubstr("</html>")) << part;
    }
  }
  EXPECT_THAT(report::plain_page("{broken"), HasSubstr("cannot be read"));
}

TEST(ValueText, HasTwoDigitsOfThreeSigma) {
  EXPECT_EQ(report::value_text(532.81, 0.43).value, "532.8");
  EXPECT_EQ(report::value_text(532.81, 0.43).plus_minus, "1.3");
  EXPECT_EQ(report::value_text(1.0, 0.0332).plus_minus, "0.10");  // 0.0996
  EXPECT_EQ(report::value_text(1.0, 0.0).plus_minus, "");
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

}  // namespace
}  // namespace alidade
