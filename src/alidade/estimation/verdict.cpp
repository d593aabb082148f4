#include "alidade/estimation/verdict.h"

#include <cmath>
#include <cstdio>
#include <string_view>

namespace alidade {
namespace {

/// Of those without a σ, the one that could move the answer most.
const Assumption* gravest(const std::vector<Assumption>& assumed) {
  const Assumption* worst = nullptr;
  for (const Assumption& each : assumed) {
    if (!each.sigma && (worst == nullptr || each.moves > worst->moves)) worst = &each;
  }
  return worst;
}

}  // namespace

Check assumed_check(const std::vector<Assumption>& assumed) {
  Check check{.name = "assumed", .limit = 1.0, .unit = "σ", .figure = "assumed"};
  const Assumption* worst = gravest(assumed);
  if (worst == nullptr) {
    check.text = assumed.empty() ? "nothing is taken as given" : "all that is taken as given has its σ";
    return check;
  }
  check.value = worst->moves;
  check.state = worst->moves <= check.limit ? State::good : State::care;
  const std::string has_none = worst->name + " is given without σ";
  if (!(worst->moves > 0.0)) {
    check.text = has_none + ", but moves nothing of the answer";
    return check;
  }
  const std::string effect = "an error of " + text_of(worst->ordinary, 2) + " would move " + worst->moved + " by " +
                             text_of(worst->moves, 2) + "σ";
  check.text = has_none + ": " + effect;
  return check;
}

void heed(const Check& check, const std::string& remedy, Verdict& verdict) {
  verdict.checks.push_back(check);
  if (check.state != State::care || verdict.state > State::care) return;
  if (verdict.state == State::good) {
    verdict.state = State::care;
    constexpr std::string_view good = "Good: ";
    if (verdict.sentence.starts_with(good))
      verdict.sentence = "Usable with care: " + verdict.sentence.substr(good.size());
    verdict.sentence += "; " + check.text;
  }
  if (verdict.to_add.empty()) verdict.to_add = remedy;
}

void heed_assumptions(const std::vector<Assumption>& assumed, Verdict& verdict) {
  const Assumption* worst = gravest(assumed);
  heed(assumed_check(assumed), worst != nullptr ? worst->remedy : "", verdict);
}

void heed_gain(double ratio, const std::string& remedy, Verdict& verdict) {
  constexpr double hundredth_less = 0.99;
  Check check{.name = "gain", .value = ratio, .limit = hundredth_less, .unit = "1"};
  const bool gains = ratio <= hundredth_less;
  check.state = gains ? State::good : State::care;
  check.text = gains ? "what is known becomes better by " + text_of(100.0 * (1.0 - ratio), 2) + " %"
                     : "what is known becomes better by less than 1 %";
  heed(check, remedy, verdict);
}

std::string text_of(double value, int digits) {
  char text[32];
  std::snprintf(text, sizeof text, "%.*g", digits, value);
  return text;
}

}  // namespace alidade
