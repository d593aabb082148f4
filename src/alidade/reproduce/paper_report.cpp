#include "alidade/reproduce/paper_report.h"

#include <algorithm>
#include <cmath>

namespace alidade::reproduce {
namespace {

State state_of(Holds holds) {
  switch (holds) {
    case Holds::reproduced:
      return State::good;
    case Holds::in_shape:
      return State::care;
    case Holds::not_reproducible:
      return State::bad;
  }
  return State::bad;
}

}  // namespace

std::string_view holds_name(Holds holds) {
  switch (holds) {
    case Holds::reproduced:
      return "reproduced";
    case Holds::in_shape:
      return "reproduced in shape";
    case Holds::not_reproducible:
      return "not reproducible";
  }
  return "";
}

FigureTable titled(FigureTable figure, std::string title, std::string caption, std::string up) {
  figure.title = std::move(title);
  figure.caption = std::move(caption);
  figure.up = std::move(up);
  return figure;
}

std::size_t PaperReport::count(Holds holds) const {
  std::size_t num = 0;
  for (const Experiment& experiment : experiments)
    num += static_cast<std::size_t>(
        std::ranges::count_if(experiment.claims, [&](const Claim& claim) { return claim.holds == holds; }));
  return num;
}

std::size_t PaperReport::num_claims() const {
  return count(Holds::reproduced) + count(Holds::in_shape) + count(Holds::not_reproducible);
}

double quantile_of(std::vector<double> values, double p) {
  if (values.empty()) return not_a_number;
  for (double& value : values)
    if (std::isnan(value)) value = std::numeric_limits<double>::infinity();
  std::ranges::sort(values);
  return values[static_cast<std::size_t>(p * static_cast<double>(values.size() - 1) + 0.5)];
}

double share_within(const std::vector<double>& values, double limit) {
  const auto within = std::ranges::count_if(values, [&](double value) { return value <= limit; });
  return static_cast<double>(within) / static_cast<double>(values.size());
}

Holds at_most(const std::vector<double>& values, double limit) {
  if (quantile_of(values, 0.9) <= limit) return Holds::reproduced;
  return quantile_of(values, 0.5) <= 1.5 * limit ? Holds::in_shape : Holds::not_reproducible;
}

Holds near_to(double rerun, double printed, double share) {
  const double off = std::abs(rerun - printed) / std::abs(printed);
  if (off <= share) return Holds::reproduced;
  return off <= 3.0 * share ? Holds::in_shape : Holds::not_reproducible;
}

Verdict reproduce_verdict(const PaperReport& report) {
  Verdict verdict;
  const std::size_t num = report.num_claims(), as_printed = report.count(Holds::reproduced),
                    in_shape = report.count(Holds::in_shape), not_so = report.count(Holds::not_reproducible);
  verdict.state = as_printed == num ? State::good : State::care;
  verdict.sentence = report.paper + ": " + std::to_string(as_printed) + " of " + std::to_string(num) +
                     " claims come out as printed, " + std::to_string(in_shape) + " in shape, " +
                     std::to_string(not_so) + " not";
  for (const Experiment& experiment : report.experiments) {
    for (const Claim& claim : experiment.claims)
      verdict.checks.push_back({claim.id, state_of(claim.holds),
                                claim.quantity + ": " + std::string(holds_name(claim.holds)) +
                                    (claim.words.empty() ? "" : "; " + claim.words),
                                claim.rerun, claim.printed, claim.unit,
                                claim.figure.empty() ? "experiments" : "paper-" + claim.figure});
  }
  return verdict;
}

}  // namespace alidade::reproduce
