#include "alidade/results/study_outcome.h"

#include <fmt/format.h>

#include <algorithm>
#include <charconv>
#include <cmath>

namespace alidade {
namespace {

constexpr double largest_ratio = 1.10;  // RMS over the bound
constexpr std::array<double, 3> normal{0.6827, 0.9545, 0.9973};
constexpr std::array<double, 3> allowance{0.04, 0.02, 0.01};  // of the coverage

/// A setting as JSON has it: a number, true, false, or a text.
JsonValue typed(const std::string& text) {
  if (text == "true" || text == "false") return text == "true";
  double number = 0.0;
  const auto [end, error] = std::from_chars(text.data(), text.data() + text.size(), number);
  if (text.empty() || error != std::errc{} || end != text.data() + text.size()) return text;
  if (number == std::floor(number) && std::abs(number) < 1e15) return static_cast<std::int64_t>(number);
  return number;
}

JsonValue quantities_value(const StudyHeader& header, const StudyTally& tally) {
  JsonValue value = JsonValue::object();
  for (std::size_t i = 0; i < header.quantities.size(); ++i) {
    const QuantityFigures figures = figures_of(tally, i, header.has_bound);
    JsonValue& own = value[header.quantities[i].name];
    own["bias"] = figures.bias;
    own["rms"] = figures.rms;
    own["rms_over_bound"] = figures.rms_over_bound;
    own["rms_sigma"] = figures.rms_sigma;
    own["median"] = figures.median;
    own["p90"] = figures.p90;
    own["values"] = tally.quantities[i].values;
    for (std::size_t k = 0; k < 3; ++k) own["coverage"][std::to_string(k + 1)] = figures.coverage[k];
  }
  return value;
}

void fill_point(const StudyHeader& header, const StudyTally& tally, JsonValue& value) {
  value["trials"] = tally.trials;
  value["estimates"] = tally.estimates;
  value["beyond"] = tally.beyond;
  value["good_beyond_5_sigma"] = tally.good_beyond_5_sigma;
  for (std::size_t i = 0; i < tally.states.size(); ++i)
    value["verdicts"][state_name(static_cast<State>(i))] = tally.states[i];
  value["quantities"] = quantities_value(header, tally);
  value["worst"] = JsonValue::list();
  for (const WorstTrial& worst : tally.worst) {
    JsonValue one = JsonValue::object();
    one["trial"] = worst.trial;
    one["quantity"] = header.quantities[static_cast<std::size_t>(worst.quantity)].name;
    one["error"] = worst.error;
    one["sigma"] = worst.sigma;
    value["worst"].push_back(std::move(one));
  }
}

JsonValue estimate_value(const StudyHeader& header, std::span<const StudyTally> points) {
  JsonValue value = JsonValue::object();
  value["bound"] = header.has_bound ? "Cramér–Rao" : "the RMS of the stated σ";
  if (!header.variation) {
    fill_point(header, points.front(), value);
    return value;
  }
  std::uint64_t trials = 0;
  for (const StudyTally& tally : points) trials += tally.trials;
  value["trials"] = trials;
  value["varied"] = header.variation->name;
  value["curve"] = JsonValue::list();
  for (std::size_t i = 0; i < points.size(); ++i) {
    JsonValue point = JsonValue::object();
    point["value"] = header.variation->values[i];
    fill_point(header, points[i], point);
    value["curve"].push_back(std::move(point));
  }
  return value;
}

DataTable quantities_table(const StudyHeader& header, std::span<const StudyTally> points) {
  std::vector<double> varied, bias, rms, sigma, ratio, median, p90;
  std::array<std::vector<double>, 3> inside;
  std::vector<std::string> names, units;
  for (std::size_t p = 0; p < points.size(); ++p) {
    for (std::size_t i = 0; i < header.quantities.size(); ++i) {
      const QuantityFigures figures = figures_of(points[p], i, header.has_bound);
      varied.push_back(header.variation ? header.variation->values[p] : missing_value);
      names.push_back(header.quantities[i].name);
      units.push_back(header.quantities[i].unit);
      bias.push_back(figures.bias);
      rms.push_back(figures.rms);
      sigma.push_back(figures.rms_sigma);
      ratio.push_back(figures.rms_over_bound);
      median.push_back(figures.median);
      p90.push_back(figures.p90);
      for (std::size_t k = 0; k < 3; ++k) inside[k].push_back(figures.coverage[k]);
    }
  }
  return {"quantities",
          {{"varied", varied},
           {"quantity", names},
           {"unit", units},
           {"bias", bias},
           {"rms", rms},
           {"rms_sigma", sigma},
           {"rms_over_bound", ratio},
           {"median", median},
           {"p90", p90},
           {"inside_1_sigma", inside[0]},
           {"inside_2_sigma", inside[1]},
           {"inside_3_sigma", inside[2]}}};
}

DataTable worst_table(const StudyHeader& header, std::span<const StudyTally> points) {
  std::vector<double> varied, error, sigma;
  std::vector<std::int64_t> trials;
  std::vector<std::string> names;
  for (std::size_t p = 0; p < points.size(); ++p) {
    for (const WorstTrial& worst : points[p].worst) {
      varied.push_back(header.variation ? header.variation->values[p] : missing_value);
      trials.push_back(static_cast<std::int64_t>(worst.trial));
      names.push_back(header.quantities[static_cast<std::size_t>(worst.quantity)].name);
      error.push_back(worst.error);
      sigma.push_back(worst.sigma);
    }
  }
  return {"worst", {{"varied", varied}, {"trial", trials}, {"quantity", names}, {"error", error}, {"sigma", sigma}}};
}

/// Of a quantity: is its RMS at the bound, and does its σ cover it? Three standard errors more where trials are few.
std::string fault_of(const StudyHeader& header, const StudyTally& tally, std::size_t i) {
  const QuantityFigures figures = figures_of(tally, i, header.has_bound);
  const auto n = static_cast<double>(tally.quantities[i].values);
  if (n < 1.0) return "";
  if (!(figures.rms_over_bound <= largest_ratio + 3.0 * largest_ratio / std::sqrt(2.0 * n)))
    return fmt::format("{}: RMS error {:.3f} of the bound", header.quantities[i].name, figures.rms_over_bound);
  for (std::size_t k = 0; k < 3; ++k) {
    const double chance = 3.0 * std::sqrt(normal[k] * (1.0 - normal[k]) / n);
    if (!(std::abs(figures.coverage[k] - normal[k]) <= std::max(allowance[k], chance)))
      return fmt::format("{}: {:.1f} % inside {}σ, {:.1f} % expected", header.quantities[i].name,
                         100.0 * figures.coverage[k], k + 1, 100.0 * normal[k]);
  }
  return "";
}

/// Values of a quantity with which three standard errors are within the tolerances: fewer do not show that it is at the
/// bound and covered.
double values_needed() {
  double most = 0.5 * std::pow(3.0 * largest_ratio / (largest_ratio - 1.0), 2);
  for (std::size_t k = 0; k < 3; ++k)
    most = std::max(most, 9.0 * normal[k] * (1.0 - normal[k]) / (allowance[k] * allowance[k]));
  return std::ceil(most);
}

/// Trials that give each quantity so many values; 0 where these do.
std::uint64_t trials_needed(std::span<const StudyTally> points) {
  const double values = values_needed();
  double most = 0.0;
  for (const StudyTally& tally : points) {
    for (const QuantityTally& quantity : tally.quantities) {
      const auto n = static_cast<double>(quantity.values);
      if (n > 0.0 && n < values) most = std::max(most, std::ceil(static_cast<double>(tally.trials) * values / n));
    }
  }
  return static_cast<std::uint64_t>(most);
}

Verdict verdict_of(const StudyHeader& header, std::span<const StudyTally> points, const Shard& shard) {
  Verdict verdict;
  std::uint64_t trials = 0, estimates = 0;
  std::string fault;
  for (const StudyTally& tally : points) {
    trials += tally.trials;
    estimates += tally.estimates;
    for (std::size_t i = 0; i < header.quantities.size() && fault.empty() && tally.estimates > 0; ++i)
      fault = fault_of(header, tally, i);
  }
  if (shard.count > 1) {
    verdict.sentence =
        fmt::format("Shard {}/{} of a study of {}: {} trials", shard.index, shard.count, header.study, trials);
    verdict.to_add = "put the shards together: alidade study merge DIR... --out DIR";
  } else if (estimates == 0) {
    verdict.state = State::refused;
    verdict.exit_code = ExitCode::undetermined;
    verdict.sentence = fmt::format("None of {} trials gave an estimate", trials);
    verdict.to_add = "look at one: --trial 0";
  } else if (!fault.empty()) {
    verdict.state = State::care;
    verdict.sentence = fmt::format("{} trials of {}; not as it should be: {}", trials, header.study, fault);
    verdict.to_add = "look at the worst: --trial N";
  } else if (const std::uint64_t needed = trials_needed(points); needed > 0) {
    verdict.state = State::care;
    verdict.sentence =
        fmt::format("{} trials of {}: too few to tell whether {}; no departure is seen", trials, header.study,
                    header.has_bound ? "errors are at the bound and σ covers them" : "σ covers the errors");
    verdict.to_add = fmt::format("--trials {}: three standard errors are then within the tolerance, {:g} % inside 1σ",
                                 needed, 100.0 * allowance[0]);
  } else {
    verdict.sentence = fmt::format("{} trials of {}: errors are at the bound, and σ covers them", trials, header.study);
    if (!header.has_bound) verdict.sentence = fmt::format("{} trials of {}: σ covers the errors", trials, header.study);
  }
  return verdict;
}

void add_lines(const StudyHeader& header, std::span<const StudyTally> points, JobOutcome& outcome) {
  constexpr std::size_t max_lines = 40;
  for (std::size_t p = 0; p < points.size(); ++p) {
    for (std::size_t i = 0; i < header.quantities.size(); ++i) {
      if (outcome.lines.size() == max_lines) {
        outcome.lines.emplace_back("… and more in study.json");
        return;
      }
      const QuantityFigures figures = figures_of(points[p], i, header.has_bound);
      const std::string at =
          header.variation ? fmt::format("{} {:g}  ", header.variation->name, header.variation->values[p]) : "";
      outcome.lines.push_back(fmt::format(
          "{}{:<8} bias {:>9.3g}  RMS {:>9.3g} {}  over the bound {:.3f}  inside 1, 2, 3σ {:.1f} {:.1f} {:.2f} %", at,
          header.quantities[i].name, figures.bias, figures.rms,
          header.quantities[i].unit == "1" ? "" : header.quantities[i].unit, figures.rms_over_bound,
          100.0 * figures.coverage[0], 100.0 * figures.coverage[1], 100.0 * figures.coverage[2]));
    }
  }
}

}  // namespace

std::string study_text(const StudyHeader& header, std::span<const StudyTally> points) {
  JsonValue value = JsonValue::object();
  value["schema"] = "alidade-study/1";
  value["study"] = header.study;
  value["seed"] = header.seed;
  value["settings"] = JsonValue::object();
  for (const auto& [name, text] : header.settings) value["settings"][name] = typed(text);
  if (header.variation) value["settings"][header.variation->name] = JsonValue(header.variation->values);
  value["estimate"] = estimate_value(header, points);
  return value.text(2) + "\n";
}

JobOutcome outcome_of(const StudyHeader& header, std::span<const StudyTally> points, const Shard& shard) {
  JobOutcome outcome;
  outcome.document.estimate = estimate_value(header, points);
  outcome.document.verdict = verdict_of(header, points, shard);
  for (const StudyTally& tally : points) {
    outcome.document.counts.given += tally.trials;
    outcome.document.counts.used += tally.estimates;
    outcome.document.counts.dropped += tally.beyond;
  }
  outcome.document.data = {quantities_table(header, points), worst_table(header, points)};
  add_lines(header, points, outcome);
  if (shard.count == 1) outcome.files.push_back({"study.json", study_text(header, points)});
  return outcome;
}

}  // namespace alidade
