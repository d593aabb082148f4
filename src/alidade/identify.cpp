#include "alidade/identify.h"

#include <algorithm>
#include <cmath>
#include <limits>
#include <numbers>
#include <optional>
#include <string>
#include <utility>

#include "alidade/servo/identify/identify.h"
#include "alidade/servo/identify/identify_causes.h"
#include "alidade/servo/identify/log_times.h"
#include "alidade/servo/identify/sampled_log.h"

namespace alidade {
namespace {

void require_sense(const std::vector<ServoSample>& log) {
  constexpr double max_angle_rad = 1e4, max_number = 1e12;
  for (std::size_t i = 0; i < log.size(); ++i) {
    const ServoSample& row = log[i];
    const std::string where = "row " + std::to_string(i) + ": ";
    if (!(std::abs(row.t_s) <= max_number && std::abs(row.command) <= max_number))
      throw ConfigError(where + "its time and command must be finite, and no larger than 1e12");
    if (!(std::abs(row.angle_rad) <= max_angle_rad)) throw ConfigError(where + "is no angle of a servo");
    if (i > 0 && !(row.t_s > log[i - 1].t_s)) throw ConfigError(where + "its time is not after the row before it");
    if (row.command_t_s > row.t_s || (i > 0 && row.command_t_s < log[i - 1].t_s) || std::isinf(row.command_t_s))
      throw ConfigError(where + "its command was not given between the row before it and its own time");
  }
}

/// The log of an encoder that wraps around, unwrapped at each step longer than half a
/// turn; `wraps`: how many such steps. Empty if the angles cover more than a turn [rad].
std::vector<ServoSample> unwrapped(const std::vector<ServoSample>& log, std::size_t& wraps) {
  constexpr double turn_rad = 2.0 * std::numbers::pi;
  const auto [low, high] = std::ranges::minmax_element(log, {}, &ServoSample::angle_rad);
  wraps = 0;
  if (high->angle_rad - low->angle_rad > 1.001 * turn_rad) return {};
  std::vector<ServoSample> rows = log;
  double turns = 0.0;
  for (std::size_t i = 1; i < rows.size(); ++i) {
    const double wrapped = std::round((log[i].angle_rad - log[i - 1].angle_rad) / turn_rad);
    wraps += wrapped != 0.0 ? 1 : 0;
    turns -= wrapped;
    rows[i].angle_rad += turns * turn_rad;
  }
  return rows;
}

/// Identifies the log as read or, if that leaves clearly smaller residuals, unwrapped.
void identify_turns(Identification& result) {
  constexpr double clearly = 0.5;
  static_cast<ServoIdentification&>(result) = identify_servo(result.log, result.config.kind);
  std::size_t wraps = 0;
  const std::vector<ServoSample> rows = unwrapped(result.log, wraps);
  if (wraps == 0) return;
  const ServoIdentification turned = identify_servo(rows, result.config.kind);
  if (!turned.fit.is_observable || (result.fit.is_observable && turned.fit.rms_rad > clearly * result.fit.rms_rad))
    return;
  static_cast<ServoIdentification&>(result) = turned;
  result.log = rows;
  result.encoder_wraps = wraps;
}

/// Adds the rejected rows as a check; a few do no harm.
void add_spikes(const std::vector<ServoSample>& log, const std::vector<std::size_t>& rows, Identification& result) {
  constexpr double few = 0.02;
  if (rows.empty()) return;
  const auto num = static_cast<double>(rows.size()), most = few * static_cast<double>(log.size());
  const ServoSample& first = log[rows.front()];
  result.verdict.checks.push_back({"outliers", num > most ? State::care : State::good,
                                   std::to_string(rows.size()) + " of " + std::to_string(log.size()) +
                                       " angles are far from those before and after them (first at t = " +
                                       text_of(first.t_s, 4) + " s), where no axis is: rejected",
                                   num, most, "rows", ""});
  if (num <= most || result.verdict.state != State::good) return;
  result.verdict.state = State::care;
  result.verdict.sentence += "; " + result.verdict.checks.back().text;
}

/// The assumption on the rate of the log's clock, with the plant parameter that it affects most.
Assumption assumed_clock(const ServoFit& fit, double sigma_clock) {
  Assumption clock{.name = "clock_rate", .value = 1.0, .sigma = sigma_clock, .moved = "tau_s"};
  const ServoParams moved = sigma_clock * by_clock_rate(fit);
  for (const int param : {ServoParam::tau, ServoParam::latency, ServoParam::gain}) {
    const double by = std::abs(moved[param]) / std::sqrt(fit.cov(param, param));
    if (!(by > clock.moves)) continue;
    clock.moves = by;
    clock.moved = param == ServoParam::gain ? "gain_rad" : servo_param_names[static_cast<std::size_t>(param)];
    clock.moved_by = std::abs(moved[param]);
  }
  return clock;
}

/// Merges flaws that are counted in several parts, such as the sine and cosine of a wave.
std::vector<CountedFlaw> by_name(const std::vector<CountedFlaw>& counted) {
  std::vector<CountedFlaw> flaws;
  for (const CountedFlaw& each : counted) {
    if (flaws.empty() || flaws.back().name != each.name)
      flaws.push_back(each);
    else
      flaws.back().moves = (flaws.back().moves.cwiseAbs2() + each.moves.cwiseAbs2()).cwiseSqrt();
  }
  return flaws;
}

/// The assumption on a counted flaw, with the plant parameter that it affects most.
Assumption assumed_flaw(const ServoFit& fit, const CountedFlaw& counted) {
  Assumption flaw{.name = counted.name, .value = 0.0, .sigma = counted.sigma, .moved = "gain_rad"};
  flaw.remedy = counted.remedy;
  for (const int param : {ServoParam::gain, ServoParam::tau, ServoParam::latency}) {
    const double by = std::abs(counted.moves[param]) / std::sqrt(fit.cov(param, param));
    if (!(by > flaw.moves)) continue;
    flaw.moves = by;
    flaw.moved = param == ServoParam::gain ? "gain_rad" : servo_param_names[static_cast<std::size_t>(param)];
    flaw.moved_by = counted.moves[param];
  }
  return flaw;
}

/// A command takes effect at its own time: by definition or, for commands between rows, within a row.
Assumption assumed_offset(const ServoIdentification& identified) {
  const double sigma_s = identified.sigma_command_s;
  Assumption offset{.name = "command_offset_s", .value = 0.0, .sigma = sigma_s, .moved = "latency_s"};
  if (sigma_s == 0.0) return offset;
  offset.moved_by = sigma_s;
  offset.moves = sigma_s / std::sqrt(identified.fit.cov(ServoParam::latency, ServoParam::latency));
  return offset;
}

/// All assumptions. By definition, angles are in the encoder's own radians.
std::vector<Assumption> assumed_of(const Identification& identified, double sigma_clock) {
  const double gain = identified.fit.params[ServoParam::gain], sigma = std::sqrt(identified.fit.cov(0, 0));
  std::vector<Assumption> assumed = {{.name = "encoder_scale", .value = 1.0, .sigma = 0.0, .moved = "gain_rad"},
                                     assumed_clock(identified.fit, sigma_clock),
                                     assumed_offset(identified)};
  if (identified.encoder_wraps > 0)
    assumed.push_back({.name = "encoder_turn_rad", .value = 2.0 * std::numbers::pi, .sigma = 0.0, .moved = "gain_rad"});
  for (const CountedFlaw& counted : by_name(identified.counted)) {
    const bool is_listed = std::ranges::any_of(
        identified.hidden, [&](const HiddenFlaw& hidden) { return servo_flaw_names[hidden.flaw] == counted.name; });
    if (!is_listed) assumed.push_back(assumed_flaw(identified.fit, counted));
  }
  for (const HiddenFlaw& hidden : identified.hidden)
    assumed.push_back({.name = servo_flaw_names[hidden.flaw],
                       .value = servo_flaws[hidden.flaw] == &ServoFlaws::max_rate_rad_s
                                    ? std::numeric_limits<double>::quiet_NaN()
                                    : 0.0,
                       .ordinary = hidden.size,
                       .moves = std::abs(hidden.gain_factor - 1.0) * std::abs(gain) / sigma,
                       .moved = "gain_rad",
                       .moved_by = (hidden.gain_factor - 1.0) * gain,
                       .remedy = "log steps of several sizes to both sides, or a chirp"});
  return assumed;
}

const WordList<ServoKindRule>& servo_kind_words() {
  static const WordList<ServoKindRule> words = {
      {ServoKindRule::automatic, "auto"}, {ServoKindRule::angle, "angle"}, {ServoKindRule::rate, "rate"}};
  return words;
}

}  // namespace

FieldList fields_of(IdentifyConfig& config) {
  return {{.name = "kind",
           .value = words_code(config.kind, servo_kind_words()),
           .help = "Quantity that follows the command with a lag: the angle or its rate; auto: whichever gives clearly "
                   "smaller residuals"},
          {.name = "sigma_clock",
           .value = &config.sigma_clock,
           .help = "Relative σ of the rate of the log's clock (0.001: 0.1 %), included in every σ; 0: exact",
           .limits = {.min = 0.0, .max = 0.1}}};
}

Identification identify(std::vector<ServoSample> log, const IdentifyConfig& config) {
  if (config.kind < ServoKindRule::automatic || config.kind > ServoKindRule::rate)
    throw ConfigError("kind is none of auto, angle, rate");
  IdentifyConfig checked = config;
  if (const std::vector<std::string> found = faults_of(fields_of(checked)); !found.empty())
    throw ConfigError(found.front());
  require_sense(log);
  constexpr std::size_t min_rows = 20;
  Identification result;
  const std::optional<RegularTimes> rounded = regular_times(log);
  for (std::size_t i = 0; rounded && i < log.size(); ++i) log[i].t_s = rounded->t_s[i];
  const std::vector<std::size_t> left_out = spikes(log);
  result.log = without_rows(log, left_out);
  result.config = config;
  if (result.log.size() >= min_rows) identify_turns(result);
  if (result.fit.is_observable) count_clock_rate(config.sigma_clock, result.fit);
  result.verdict = identify_verdict(result.log, result);
  if (result.encoder_wraps > 0)
    result.verdict.checks.push_back(
        {"wraps", State::good,
         "the encoder begins again after a turn, " + std::to_string(result.encoder_wraps) + " times: unwrapped",
         static_cast<double>(result.encoder_wraps), 0.0, "wraps", ""});
  add_spikes(log, left_out, result);
  if (rounded)
    result.verdict.checks.push_back({"times", State::good,
                                     "times are rounded to " + text_of(1e3 * rounded->step_s) +
                                         " ms: rows are taken as regular, " + text_of(1e3 * rounded->spacing_s) +
                                         " ms apart",
                                     rounded->step_s, 0.0, "s", ""});
  result.counts.given = log.size();
  result.counts.used = result.log.size();
  if (result.residual_rad.empty()) return result;
  result.encoder_step_rad = encoder_step_rad(result.log);
  result.assumed = assumed_of(result, config.sigma_clock);
  return result;
}

}  // namespace alidade
