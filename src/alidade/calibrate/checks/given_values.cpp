#include <algorithm>
#include <array>
#include <cmath>
#include <functional>
#include <limits>
#include <string_view>

#include "alidade/calibrate/checks/assumed.h"
#include "alidade/calibrate/checks/view_scores.h"
#include "alidade/calibrate/study.h"

namespace alidade {
namespace {

using Eigen::Index;

bool is_held(const CalibrateConfig& config, const std::string& name) {
  return std::ranges::find(config.fixed, name) != config.fixed.end();
}

/// The σ of a value that was given: 0 where it is held. Terms that a model does without are no values, but other
/// models, which held-out photos compare.
std::optional<double> given_sigma(const CalibrateConfig& config, const std::string& name) {
  constexpr std::array<std::string_view, 4> central{"fx", "fy", "cx", "cy"};
  const auto prior = std::ranges::find(config.priors, name, &Prior::name);
  const bool has_prior = prior != config.priors.end() && std::isfinite(prior->sigma);
  if (is_held(config, name))
    return has_prior || std::ranges::find(central, name) != central.end() ? std::optional(0.0) : std::nullopt;
  return has_prior ? std::optional(prior->sigma) : std::nullopt;
}

/// Without what is given, from which the search still begins.
CalibrateConfig without(std::span<const GivenValue> given, CalibrateConfig config) {
  for (const GivenValue& value : given) {
    std::erase(config.fixed, value.name);
    std::erase_if(config.priors, [&](const Prior& prior) { return prior.name == value.name; });
    config.priors.push_back({value.name, value.value, std::numeric_limits<double>::infinity()});
  }
  return config;
}

double value_of_prior(const CalibrateConfig& config, const std::string& name, double otherwise) {
  const auto prior = std::ranges::find(config.priors, name, &Prior::name);
  return prior != config.priors.end() ? prior->value : otherwise;
}

/// "fx is given as 1004 ± 0.9", "cx is held at 639.5".
std::string text_of_given(const GivenValue& given) {
  constexpr int digits = 5;
  return given.sigma > 0.0
             ? given.name + " is given as " + text_of(given.value, digits) + " ± " + text_of(3.0 * given.sigma, 2)
             : given.name + " is held at " + text_of(given.value, digits);
}

}  // namespace

double GivenValue::apart() const { return std::abs(by_photos - value) / std::hypot(sigma, sigma_by_photos); }

std::optional<GivenValues> test_given_values(const Board& board, std::span<const BoardView> views,
                                             const CalibrateConfig& config, const CalibrateReport& report) {
  if (!is_central(report.camera.lens)) return std::nullopt;
  GivenValues given;
  const auto names = param_names(report.camera.lens);
  const Eigen::VectorXd stated = params(report.camera.lens);
  for (std::size_t i = 0; i < names.size(); ++i) {
    const auto sigma = given_sigma(config, names[i]);
    const double value = value_of_prior(config, names[i], stated[static_cast<Index>(i)]);
    if (sigma) given.values.push_back({names[i], value, *sigma});
  }
  if (given.values.empty()) return std::nullopt;
  const ImageSize size{report.camera.width_px, report.camera.height_px};
  const CalibrateReport alone = calibrate(board, used_views(views, report, views.size()), size,
                                          without(given.values, config), report.board_points);
  if (alone.status != CalibrateReport::Status::converged) return std::nullopt;
  const Eigen::VectorXd by_photos = params(alone.camera.lens);
  for (GivenValue& value : given.values) {
    const auto at = static_cast<Index>(std::ranges::find(names, value.name) - names.begin());
    value.by_photos = by_photos[at];
    value.sigma_by_photos = std::sqrt(alone.camera.cov(at, at));
  }
  std::ranges::sort(given.values, std::greater{}, &GivenValue::apart);
  constexpr double proved = 4.0, chance = 2.5;  // of the farthest of a few
  constexpr double disagree = 1.7;              // clean photos have 0.7 to 1.3, those of an autofocus from 1.9 on
  given.photos_agree = alone.clusters.design_effect < disagree;
  const double apart = given.values.front().apart();
  given.contradict = apart > proved;
  const double counted = given.contradict ? 1.0 : std::max(0.0, 1.0 - chance * chance / (apart * apart));
  const Eigen::VectorXd away = by_photos - stated;
  given.cov = counted * away * away.transpose();
  const std::vector<Index> held = split_of(report).fixed;  // of which nothing was stated
  given.cov(held, held) += counted * alone.camera.cov(held, held);
  return given;
}

void heed_given_values(const GivenValues& given, Verdict& verdict) {
  if (!given.contradict) return;
  const GivenValue& worst = given.values.front();
  Check check{.name = "given values", .state = State::care, .value = worst.apart(), .limit = 4.0, .unit = "σ"};
  check.figure = "estimate";
  check.text = text_of_given(worst) + ", and by the photos alone it is " + text_of(worst.by_photos, 5) + " ± " +
               text_of(3.0 * worst.sigma_by_photos, 2) + " (" + text_of(worst.apart(), 2) +
               "σ apart): σ includes the difference";
  std::string remedy = worst.sigma > 0.0 ? "correct the --prior of " + worst.name + ", or omit it"
                                         : "do not hold " + worst.name + ": omit it from --fix";
  if (worst.name.starts_with('f')) remedy += "; or was an autofocus left on?";  // a little of it looks the same
  const bool was_good = verdict.state == State::good;
  heed(check, remedy, verdict);
  if (!was_good) verdict.sentence += "; " + check.text;
  if (given.photos_agree) verdict.to_add = remedy;  // what it explains goes with it
}

}  // namespace alidade
