#include "alidade/reproduce/paper_report.h"

#include <gtest/gtest.h>

#include <cmath>
#include <set>

#include "alidade/reproduce/papers.h"

namespace alidade::reproduce {
namespace {

TEST(AtMost, NeedsNineInTenForAsPrintedAndHalfForTheShape) {
  const std::vector<double> good{1, 1, 1, 1, 1, 1, 1, 1, 1, 1, 9}, half{1, 1, 1, 1, 1, 1, 9, 9, 9, 9, 9},
      bad{1, 1, 9, 9, 9, 9, 9, 9, 9, 9, 9};
  EXPECT_TRUE(at_most(good, 1.0) == Holds::reproduced);
  EXPECT_TRUE(at_most(half, 1.0) == Holds::in_shape);
  EXPECT_TRUE(at_most(bad, 1.0) == Holds::not_reproducible);
  EXPECT_TRUE(at_most({1.4, 1.4, 1.4}, 1.0) == Holds::in_shape);
  EXPECT_TRUE(at_most({1.6, 1.6, 1.6}, 1.0) == Holds::not_reproducible);
}

TEST(AtMost, CountsAMissingValueAsTheWorst) {
  const double inf = std::numeric_limits<double>::infinity();
  EXPECT_TRUE(at_most({0.0, not_a_number, inf}, 1.0) == Holds::not_reproducible);
  EXPECT_EQ(quantile_of({not_a_number, 1.0, 2.0}, 1.0), inf);
  EXPECT_TRUE(std::isnan(quantile_of({}, 0.5)));
}

TEST(NearTo, IsAShareOfThePrinted) {
  EXPECT_TRUE(near_to(3.13, 3.15, 0.05) == Holds::reproduced);
  EXPECT_TRUE(near_to(3.5, 3.15, 0.05) == Holds::in_shape);
  EXPECT_TRUE(near_to(-17.4, 17.3, 0.02) == Holds::not_reproducible);
  EXPECT_TRUE(near_to(not_a_number, 17.3, 0.02) == Holds::not_reproducible);
}

PaperReport report_of(const std::vector<Holds>& outcomes) {
  PaperReport report{"paper", "A. Author", {{"exp1", "One", "", "", {}, {}}}};
  for (const Holds holds : outcomes) {
    Claim claim{"claim", "a quantity"};
    claim.holds = holds;
    claim.words = "why";
    report.experiments[0].claims.push_back(claim);
  }
  return report;
}

TEST(ReproduceVerdict, CountsClaimsAndIsAnAnswerEvenWhereNoneHolds) {
  const Verdict mixed = reproduce_verdict(report_of({Holds::reproduced, Holds::in_shape, Holds::not_reproducible}));
  EXPECT_EQ(mixed.sentence, "paper: 1 of 3 claims come out as printed, 1 in shape, 1 not");
  EXPECT_TRUE(mixed.state == State::care);
  ASSERT_EQ(mixed.checks.size(), 3u);
  EXPECT_TRUE(mixed.checks[0].state == State::good);
  EXPECT_TRUE(mixed.checks[1].state == State::care);
  EXPECT_TRUE(mixed.checks[2].state == State::bad);
  EXPECT_EQ(mixed.checks[2].text, "a quantity: not reproducible; why");
  EXPECT_TRUE(reproduce_verdict(report_of({Holds::reproduced})).state == State::good);
  EXPECT_TRUE(reproduce_verdict(report_of({Holds::not_reproducible})).exit_code == ExitCode::ok);
}

TEST(Papers, HaveClaimsWithNamesOfTheirOwnAndStopWhenAsked) {
  ReproduceConfig config;
  config.quick = true;
  const PaperReport report = reproduce_xiahou2015(config);  // the quickest
  std::set<std::string> ids, figures;
  for (const Experiment& experiment : report.experiments) {
    EXPECT_FALSE(experiment.method.empty());
    for (const FigureTable& figure : experiment.figures) {
      EXPECT_TRUE(figures.insert(figure.id).second) << figure.id;
      EXPECT_FALSE(figure.title.empty()) << figure.id;
      EXPECT_FALSE(figure.caption.empty()) << figure.id;
      if (!figure.labels.empty()) {
        EXPECT_EQ(figure.labels.size(), figure.columns.front().second.size()) << figure.id;
      }
      for (const auto& [name, values] : figure.columns)
        EXPECT_EQ(values.size(), figure.columns.front().second.size()) << name;
    }
    for (const Claim& claim : experiment.claims) EXPECT_TRUE(ids.insert(claim.id).second) << claim.id;
  }
  for (const Experiment& experiment : report.experiments)
    for (const Claim& claim : experiment.claims)
      EXPECT_TRUE(claim.figure.empty() || figures.contains(claim.figure)) << claim.id;
  EXPECT_EQ(ids.size(), report.num_claims());
  config.progress = [](std::string_view, std::size_t, std::size_t) { return false; };
  for (const Paper& paper : papers()) EXPECT_THROW((void)paper.run(config), Interrupted) << paper.name;
}

}  // namespace
}  // namespace alidade::reproduce
