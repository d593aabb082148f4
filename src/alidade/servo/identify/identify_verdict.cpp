#include <algorithm>
#include <cmath>
#include <string>

#include "alidade/estimation/median.h"
#include "alidade/geometry/degree.h"
#include "alidade/geometry/time_unit.h"
#include "alidade/servo/identify/frequent_commands.h"
#include "alidade/servo/identify/identify.h"
#include "alidade/servo/identify/identify_causes.h"
#include "alidade/servo/identify/identify_flaws.h"
#include "alidade/servo/identify/log_times.h"
#include "alidade/servo/identify/sampled_log.h"

namespace alidade {
namespace {

Verdict refused(std::string what, std::string add) {
  Verdict verdict;
  verdict.state = State::refused;
  verdict.exit_code = ExitCode::undetermined;
  verdict.sentence = std::move(what);
  verdict.to_add = std::move(add);
  return verdict;
}

std::string command_times_text(const ServoIdentification& identified) {
  const std::string text = text_of(static_cast<double>(identified.num_command_times), 3);
  if (!(identified.sigma_command_s > 0.0))
    return text + " commands were given at rows that are lost: when is estimated, and counted in σ";
  return text +
         " commands were given before their rows, between two or where rows are lost: when is estimated, but for " +
         text_of(1e3 * identified.sigma_command_s, 2) + " ms (σ) of the latency";
}

/// Check of commands that change from row to row: how many there are per row, and the resulting uncertainty of latency.
void add_frequent_commands(const ServoIdentification& identified, Verdict& verdict) {
  const std::size_t num = identified.commands_per_row;
  const double sigma_s = identified.sigma_command_s, most_s = max_sigma_command_s(identified.fit);
  const bool is_small = sigma_s <= most_s;
  std::string text = num == 0 ? std::string("commands change from row to row: taken as given at rows")
                     : num == continuous_commands
                         ? std::string("the response is that of commands which change between rows all the time")
                         : "the response is that of " + std::to_string(num) + " commands from row to row";
  if (num > 0) text += ": those between are interpolated";
  text += ", which leaves " + text_of(1e3 * sigma_s, 2) + " ms (σ) of the latency open, counted in σ";
  if (!is_small) text += ": a controller that gives more commands than rows are logged has a longer latency";
  verdict.checks.push_back({"command times", is_small ? State::good : State::care, text, sigma_s, most_s, "s", ""});
}

/// Whether blocks of rows agree on the servo. Values from before the log affect only its first rows: a single
/// block, whose own scatter says nothing about others.
Check blocks_agree(const ServoIdentification& identified) {
  const ServoFit& fit = identified.fit;
  ClusterCovariance clusters = identified.clusters;
  std::vector<Eigen::Index> before{ServoParam::start};
  if (fit.kind == ServoKind::rate) before.push_back(ServoParam::zero);  // includes motion due to the initial rate
  for (std::size_t i = 0; i < fit.freed.size(); ++i)
    if (fit.freed[i] == ServoFlaw::earlier_command) before.push_back(num_servo_params + static_cast<Eigen::Index>(i));
  for (const Eigen::Index place : before)
    if (clusters.inflation.size() > place) clusters.inflation[place] = 1.0;
  const std::string shared = identified.correlated_rows > 1
                                 ? std::to_string(identified.correlated_rows) + " rows in a row share an error"
                                 : "not from row to row: a few places of the log are off by more than noise";
  return clusters_agree(clusters, "block", shared, "response");
}

/// Checks of faults of the log that are not due to the axis; the answer is corrected for them.
void add_faults(std::span<const ServoSample> log, const ServoIdentification& identified, Verdict& verdict) {
  constexpr std::size_t listed = 5;
  if (const std::vector<std::size_t>& lost = identified.lost_commands; !lost.empty()) {
    std::size_t given = 0;
    for (std::size_t i = 1; i < log.size(); ++i) given += log[i].command != log[i - 1].command ? 1 : 0;
    std::string text =
        std::to_string(lost.size()) + " of " + std::to_string(given) + " commands were not followed (at t = ";
    for (std::size_t i = 0; i < std::min(listed, lost.size()); ++i)
      text += (i > 0 ? ", " : "") + text_of(log[lost[i]].given_s(), 4);
    text += std::string(lost.size() > listed ? " s and on" : " s") +
            "): they are taken as lost, the commands before them as still valid; see that commands arrive";
    verdict.checks.push_back(
        {"lost commands", State::care, text, static_cast<double>(lost.size()), 0.0, "commands", ""});
  }
  for (const ZeroSlip& slip : identified.slips)
    verdict.checks.push_back(
        {"encoder zero", State::care,
         "the angle read slips by " + text_of(slip.size_rad / degree, 3) + " ± " +
             text_of(3.0 * slip.sigma_rad / degree, 2) + "° at t = " + text_of(slip.t_s, 4) +
             " s, which no command explains: estimated; see the encoder's coupling and counting, or part the log there",
         slip.size_rad, 3.0 * slip.sigma_rad, "rad", ""});
}

/// To be added before checks of effects that it may be mistaken for.
void add_change(const ServoIdentification& identified, Verdict& verdict) {
  if (!identified.change) return;
  verdict.checks.push_back({"constancy", State::care,
                            "at about t = " + text_of(identified.change->t_s) + " s the axis becomes another: " +
                                change_text(*identified.change) + "; the answer is of both as one: part the log there",
                            identified.change->t_s, 0.0, "s", ""});
}

void add_checks(std::span<const ServoSample> log, const ServoIdentification& identified, Verdict& verdict) {
  const ServoFit& fit = identified.fit;
  const double correlation = identified.lag_one_correlation, rows = static_cast<double>(reading_times(log).size());
  // For white residuals the correlation has σ = 1/√n; at 0.3, structure costs more than noise.
  const double limit = std::max(0.3, 4.0 / std::sqrt(rows));
  const bool is_white = std::abs(correlation) < limit;
  verdict.checks.push_back(
      {"residuals", is_white ? State::good : State::care,
       is_white ? "residuals are white: the model is enough"
                : "residuals have structure (correlation " + text_of(correlation) +
                      " from row to row): the servo does more than the model; σ counts that rows share errors",
       correlation, limit, "1", ""});
  verdict.checks.push_back(blocks_agree(identified));
  const double step_s = identified.duration_s / (rows - 1.0);
  const bool is_long = fit.params[1] > 0.5 * step_s, is_resolved = is_long || is_lagged_otherwise(fit);
  verdict.checks.push_back({"sampling", is_resolved ? State::good : State::care,
                            is_long       ? "rows are close enough for the time constant"
                            : is_resolved ? "the axis has no time constant beside its acceleration or what swings"
                                          : "rows are further apart than twice the time constant: log faster",
                            fit.params[1] / step_s, 0.5, "rows", ""});
  if (identified.encoder_hz > 0.0)
    verdict.checks.push_back({"encoder", State::good,
                              "the encoder is sampled " + text_of(identified.encoder_hz, 3) +
                                  " times a second: each sample counts once, and the latency includes half of the time "
                                  "between two",
                              identified.encoder_hz, 0.0, "Hz", ""});
  if (identified.num_command_times > 0)
    verdict.checks.push_back({"command times", State::good, command_times_text(identified),
                              static_cast<double>(identified.num_command_times), 0.0, "commands", ""});
  if (identified.has_frequent_commands)
    add_frequent_commands(identified, verdict);
  else if (identified.num_command_times == 0 && identified.sigma_command_s > 0.0)
    verdict.checks.push_back(
        {"command times", State::care,
         "the clocks' drift is within a row by the end of the log, as of commands at a regular spacing that are given "
         "between rows: then the latency is up to a row longer; log when commands are given (command_t_s)",
         identified.duration_s * std::abs(fit.flaws.clock_rate), identified.sigma_command_s, "s", ""});
  if (is_hardly_excited(fit))
    verdict.checks.push_back({"resonance", State::care,
                              "commands hardly excite the resonance: how much of the latency is its delay is open, and "
                              "counted in σ; log steps, or a chirp up to " +
                                  text_of(fit.flaws.resonance_hz, 2) + " Hz",
                              std::abs(fit.flaws.resonance_share), 3.0 * fit.flaw_sigma[ServoFlaw::resonance_share],
                              "1", ""});
  if (!fit.has_converged)
    verdict.checks.push_back({"convergence", State::care, "the fit was still moving", 0.0, 0.0, "1", ""});
}

std::string flaw_text(const ServoFit& fit, std::size_t flaw) {
  return std::string(servo_flaw_words[flaw]) + " (" + text_of(fit.flaws.*servo_flaws[flaw]) + " ± " +
         text_of(3.0 * fit.flaw_sigma[flaw], 2) + " " + servo_flaw_units[flaw] + ")";
}

/// Effects beyond a lag: those that were estimated, and those that the residuals still indicate.
void add_causes(std::span<const ServoSample> log, const ServoIdentification& identified, Verdict& verdict) {
  const ServoFit& fit = identified.fit;
  const std::vector<ServoCause> causes = identified.change ? std::vector<ServoCause>() : servo_causes(log, identified);
  Check check{
      .name = "causes",
      .text = "neither limits, dead band, backlash, a second lag, a resonance, a drift of clocks nor another gain show",
      .unit = "σ"};
  check.limit = 4.0;
  if (!fit.freed.empty()) {
    check.text = "estimated as well: ";
    for (std::size_t i = 0; i < fit.freed.size(); ++i) check.text += (i > 0 ? ", " : "") + flaw_text(fit, fit.freed[i]);
  }
  if (!identified.rivals.empty()) {
    const ServoRival& rival = identified.rivals.front();
    check.state = State::care;
    check.text += "; " + std::string(servo_flaw_words[rival.other]) + " would explain it nearly as well as " +
                  servo_flaw_words[rival.flaw] + " (2 ln of their ratio " + text_of(rival.evidence, 2) +
                  "): this log does not separate them";
  }
  if (!causes.empty()) {
    const ServoCause& first = causes.front();
    check.state = State::care;
    check.value = first.sigmas;
    check.text = (fit.freed.empty() ? std::string() : check.text + "; ") + "the residuals indicate " + first.name +
                 ", about " + text_of(first.size, 2) + " " + first.unit + " (" + text_of(first.sigmas, 2) +
                 "σ): gain, time constant and latency absorb part of it";
  }
  verdict.checks.push_back(check);
}

/// Names and effects of flaws that a log with a single command size cannot show.
std::string hidden_text(const std::vector<HiddenFlaw>& hidden) {
  std::string text = "steps of one size: they do not separate another gain from ";
  for (std::size_t i = 0; i < hidden.size(); ++i) {
    const HiddenFlaw& flaw = hidden[i];
    text += (i == 0 ? "" : i + 1 == hidden.size() ? " or " : ", ") + std::string(servo_flaw_words[flaw.flaw]);
    const std::string size = text_of(flaw.size, 2) + " " + servo_flaw_units[flaw.flaw];
    const bool is_limit = servo_flaws[flaw.flaw] == &ServoFlaws::max_rate_rad_s;
    text += is_limit
                ? " (at " + size + ": then the gain is any larger one)"
                : " (of " + size + ": then the gain is " + text_of(100.0 * (flaw.gain_factor - 1.0), 2) + " % larger)";
  }
  return text;
}

void add_excitation(std::span<const ServoSample> log, const ServoIdentification& identified, Verdict& verdict) {
  constexpr std::size_t least = 2;
  const std::size_t sizes = num_sizes(log, least);
  const bool is_one = sizes < least;
  const std::string text = !is_one ? "commands of several sizes: what is not proportional would show"
                           : identified.hidden.empty()
                               ? "steps of one size: a dead band, backlash or a limit would pass for another gain"
                               : hidden_text(identified.hidden);
  verdict.checks.push_back({"excitation", is_one ? State::care : State::good, text, static_cast<double>(sizes),
                            static_cast<double>(least), "sizes", ""});
}

/// Checks for degrees read as radians, milliseconds as seconds, and an encoder coarser than its noise.
void add_readings(std::span<const ServoSample> log, const ServoIdentification& identified, Verdict& verdict) {
  constexpr double max_turn_rad = 6.2831853071795865;
  constexpr double max_rate_rad_s = 20.0;  // more than a thousand degrees per second: no head rotates so fast
  const double range = identified.angle_range_rad;
  if (range > max_turn_rad && identified.fit.kind == ServoKind::angle)
    verdict.checks.push_back(
        {"units", State::care,
         "the angle covers " + text_of(range) + " rad, more than a turn: are these degrees? name the column angle_deg",
         range, max_turn_rad, "rad", ""});
  double fastest_rad_s = 0.0;
  if (identified.fit.kind == ServoKind::rate)
    for (const ServoSample& row : log)
      fastest_rad_s = std::max(fastest_rad_s, std::abs(identified.fit.params[ServoParam::gain] * row.command));
  if (fastest_rad_s > max_rate_rad_s)
    verdict.checks.push_back(
        {"units", State::care,
         "the axis turns by " + text_of(fastest_rad_s, 2) + " rad/s: are these degrees? name the column angle_deg",
         fastest_rad_s, max_rate_rad_s, "rad/s", ""});
  if (identified.sigma_time_s > 0.0)
    verdict.checks.push_back({"time stamps", State::good,
                              "errors grow with the rate, as of times that err by " +
                                  text_of(1e3 * identified.sigma_time_s, 2) + " ms (σ): counted in σ",
                              identified.sigma_time_score, sigmas_of_time_stamps, "σ", ""});
  const double spacing_s = identified.duration_s / (static_cast<double>(log.size()) - 1.0);
  if (const auto unit = time_unit_by_spacing(spacing_s))
    verdict.checks.push_back(
        {"times", State::care,
         "rows are " + text_of(spacing_s) + " s apart: are these " + unit->name + "? t_s is in seconds", spacing_s, 1.0,
         "s", ""});
  const double step_rad = encoder_step_rad(log);
  // Rounding has σ = step/√12; a step above two σ of the noise is not dithered by it.
  if (step_rad > 2.0 * identified.fit.rms_rad)
    verdict.checks.push_back({"rounding", State::care,
                              "the encoder reads in steps of " + text_of(step_rad / degree, 2) +
                                  "°, coarser than its noise: errors of neighbouring rows are one error",
                              step_rad, 2.0 * identified.fit.rms_rad, "rad", ""});
}

/// Times that are partly in another unit: intervals hundreds of times larger at one end of the log than at the other.
std::optional<Verdict> mixed_units(std::span<const ServoSample> log) {
  constexpr double least_ratio = 200.0;
  const std::size_t some = log.size() / 8;
  if (some < 2) return std::nullopt;
  const auto spacing_s = [&](std::size_t first) {  // median: a pause does not change it
    std::vector<double> apart_s;
    for (std::size_t i = first; i < first + some; ++i) apart_s.push_back(log[i + 1].t_s - log[i].t_s);
    return median_of(apart_s);
  };
  const double first_s = spacing_s(0), last_s = spacing_s(log.size() - 1 - some);
  if (!(std::max(first_s, last_s) > least_ratio * std::min(first_s, last_s))) return std::nullopt;
  return refused("rows are " + text_of(first_s, 2) + " s apart in the beginning, " + text_of(last_s, 2) +
                     " s in the end: a part of the times is in another unit",
                 "write all of t_s in seconds");
}

/// What the log does not determine; none if it determines gain, time constant and latency.
std::optional<Verdict> refusal(std::span<const ServoSample> log, const ServoIdentification& identified) {
  const std::string excite = "log a step or a chirp of the command that moves the axis by degrees";
  if (log.size() < 20)
    return refused("too few rows for five parameters: " + std::to_string(log.size()), "log at least 20 rows");
  if (auto mixed = mixed_units(log)) return mixed;
  if (!(identified.command_range > 0.0))
    return refused("no excitation: the command is " + text_of(log.front().command) + " throughout", excite);
  const ServoFit& fit = identified.fit;
  if (!(identified.angle_range_rad > 0.0)) return refused("no answer: the angle never changes", excite);
  if (!fit.is_observable)
    return refused("the log cannot separate gain, time constant and latency",
                   "log until the axis has come to rest, "
                   "and more than one change of command");
  const ServoParams sigma = fit.cov.diagonal().cwiseSqrt();
  if (!(std::abs(fit.params[0]) > 5.0 * sigma[0]))
    return refused("no answer: the gain " + text_of(fit.params[0]) + " is not distinguishable from zero (σ " +
                       text_of(sigma[0]) + ")",
                   excite);
  // Of two lags only the sum may be determined, not its split; an axis with another lag may have no time constant.
  const bool is_split = std::ranges::count(fit.freed, std::size_t{ServoFlaw::second_lag}) > 0;
  const double open = is_split ? 2.0 : 0.5, of_log = is_lagged_otherwise(fit) ? 0.1 : 0.02;
  if (!(sigma[1] < open * fit.params[1]) && !(fit.params[1] + 2.0 * sigma[1] < of_log * identified.duration_s))
    return refused("too short or too coarse: the time constant is " + text_of(fit.params[1]) + " s with σ " +
                       text_of(sigma[1]) + " s",
                   "log for several time constants after a change of command, and faster");
  if (fit.kind == ServoKind::angle && fit.params[1] > identified.duration_s)
    return refused("too short: the time constant " + text_of(fit.params[1]) + " s is longer than the log",
                   "log for several time constants after a change of command");
  return std::nullopt;
}

Verdict verdict_of(std::span<const ServoSample> log, const ServoIdentification& identified) {
  if (auto refused = refusal(log, identified)) return *std::move(refused);
  const ServoFit& fit = identified.fit;
  const bool is_angle = fit.kind == ServoKind::angle;
  Verdict verdict;
  add_readings(log, identified, verdict);
  add_faults(log, identified, verdict);
  add_change(identified, verdict);
  add_checks(log, identified, verdict);
  add_causes(without_faults(with_commands_between(log, identified.commands_per_row), identified.lost_commands,
                            identified.slips),
             identified, verdict);
  add_excitation(log, identified, verdict);
  verdict.sentence = std::string(is_angle ? "the angle" : "the rate") + " follows the command by " +
                     text_of(fit.params[0]) + " rad" + (is_angle ? "" : "/s") + " per unit with a time constant of " +
                     text_of(1e3 * fit.params[1]) + " ms, " + text_of(1e3 * fit.params[2]) + " ms late";
  for (std::size_t i = 0; i < fit.freed.size(); ++i) verdict.sentence += ", with " + flaw_text(fit, fit.freed[i]);
  for (const Check& check : verdict.checks) {
    if (check.state == State::good) continue;
    if (verdict.state == State::good) verdict.sentence += "; " + check.text;
    if (verdict.to_add.empty() && check.name == "excitation")
      verdict.to_add = "log steps of several sizes to both sides, or a chirp";
    if (verdict.to_add.empty() && check.name == "command times")
      verdict.to_add = "log a row for each command, or when it was given (command_t_s)";
    verdict.state = State::care;
  }
  return verdict;
}

}  // namespace

Verdict identify_verdict(std::span<const ServoSample> log, const ServoIdentification& identified) {
  return verdict_of(sampled_log(log, identified.sampled_t_s, identified.command_t_s), identified);
}

}  // namespace alidade
