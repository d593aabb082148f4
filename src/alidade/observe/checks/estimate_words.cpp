#include <algorithm>
#include <array>
#include <cmath>
#include <utility>

#include "alidade/observe/setup.h"

// The words of the option `estimate` and the causes of residuals they stand for, in one place.

namespace alidade {
namespace {

constexpr std::array<std::pair<const char*, bool ObserveNuisances::*>, 10> nuisance_words{
    {{"k1", &ObserveNuisances::k1},
     {"k2", &ObserveNuisances::k2},
     {"k3", &ObserveNuisances::k3},
     {"p1", &ObserveNuisances::tangential},
     {"p2", &ObserveNuisances::tangential},
     {"mount", &ObserveNuisances::mount},
     {"delay", &ObserveNuisances::delay},
     {"lever", &ObserveNuisances::lever},
     {"shutter", &ObserveNuisances::shutter},
     {"focal-drift", &ObserveNuisances::drift}}};

/// Causes whose word differs from the name of the cause.
constexpr std::pair<const char*, const char*> cause_words[] = {{"scale", "encoder scale"},
                                                               {"scale", "scale of the rates"},
                                                               {"backlash", "backlash"},
                                                               {"curve", "error of the angles within a turn"},
                                                               {"axes", "axes that are not perpendicular"},
                                                               {"drift", "zero that drifts"},
                                                               {"drift", "attitude that drifts"},
                                                               {"bias", "bias of the rates"},
                                                               {"clock", "clock rate"},
                                                               {"lever", "lever across the view"},
                                                               {"shutter", "rolling shutter"},
                                                               {"focal-drift", "focal length that drifts"}};

}  // namespace

std::string row_time_text(double t_s) {
  const double digits = std::floor(std::log10(std::max(std::abs(t_s), 1.0))) + 3.0;
  return text_of(t_s, static_cast<int>(digits)) + " s";
}

bool ObserveNuisances::*nuisance_of(const std::string& word) {
  for (const auto& [each, member] : nuisance_words) {
    if (word == each) return member;
  }
  return nullptr;
}

std::string estimate_word_of(const std::string& cause) {
  for (const auto& [word, of] : cause_words) {
    if (cause == of) return word;
  }
  return cause;
}

std::vector<std::string> rotation_causes_of(const std::string& word) {
  std::vector<std::string> causes;
  for (const auto& [each, cause] : cause_words) {
    if (word == each && nuisance_of(word) == nullptr) causes.emplace_back(cause);
  }
  return causes;
}

}  // namespace alidade
