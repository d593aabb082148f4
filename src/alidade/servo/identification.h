#pragma once

#include <Eigen/Core>
#include <array>
#include <cmath>
#include <limits>
#include <optional>
#include <string>
#include <vector>

#include "alidade/description/field.h"
#include "alidade/estimation/cluster_covariance.h"
#include "alidade/estimation/counts.h"
#include "alidade/estimation/verdict.h"
#include "alidade/public.h"

namespace alidade {
ALIDADE_PUBLIC_BEGIN

/// One row of a servo's log: a command that is valid until the next row's, and the angle read at that time.
struct ServoSample {
  double t_s = 0.0, command = 0.0, angle_rad = 0.0;
  /// When the command was given, if earlier than the angle was read, not before the row before it; NaN: at t_s.
  double command_t_s = std::numeric_limits<double>::quiet_NaN();
  /// Of an encoder that holds its angle for several rows, estimated by identify(): half a period after the sample was
  /// taken that the angle repeats. The first row of a sample counts. NaN: at t_s.
  double sampled_t_s = std::numeric_limits<double>::quiet_NaN();

  [[nodiscard]] double read_s() const { return std::isfinite(sampled_t_s) ? sampled_t_s : t_s; }
  [[nodiscard]] double given_s() const { return command_t_s <= t_s ? command_t_s : t_s; }
};

/// Parameters of a servo in their order: gain [rad per unit, or rad/s per unit], time constant [s], latency [s], what
/// the encoder reads at angle zero [rad], start [rad, or rad/s: the angle of an angle plant, the rate of a rate plant,
/// at the first row].
inline constexpr int num_servo_params = 5;
using ServoParams = Eigen::Vector<double, num_servo_params>;
inline constexpr std::array<const char*, num_servo_params> servo_param_names{"gain", "tau_s", "latency_s", "zero",
                                                                             "start"};

/// How the angle answers: with a first-order lag itself (angle plant), or in its rate (rate plant). With a limit of its
/// acceleration an angle plant is the axis of a head that takes position commands: docs/maths/servo.md.
enum class ServoKind { angle, rate };

/// Nonlinearities of a servo beside its first-order lag; 0: absent.
struct ServoFlaws {
  double max_rate_rad_s = 0.0, max_acceleration_rad_s2 = 0.0;
  double dead_band = 0.0;     ///< Commands smaller than it do nothing, larger ones count from it.
  double backlash_rad = 0.0;  ///< Play between what drives the axis and the angle that is read.
  double second_tau_s = 0.0;  ///< A first-order lag of the command, before the plant.
  double clock_rate = 0.0;    ///< Angles are read by a clock of which a second is 1 + it of the commands'.
  /// What the axis followed until the first row's command took effect, less that command: of the log, not of the axis.
  double earlier_command = 0.0;
  double gain_difference = 0.0;  ///< The gain is 1 + it times the stated for commands above zero, 1 − it below.
  double gain_drift = 0.0;       ///< By so much of it the gain grows over the log; the stated one is its middle's.
  /// By so much of it the gain grows from no command to the largest; the stated one is that of half of the largest.
  double gain_by_size = 0.0;
  double max_command = 0.0;        ///< Of an angle plant: larger commands act as it (a driver's limit, stops).
  double rate_offset_rad_s = 0.0;  ///< Of a rate plant: it turns by so much beside what it is commanded.
  /// Where its lag alone would turn it at a rate r, or the command of a rate plant, it turns at r / (1 + |r| / this).
  double soft_max_rate_rad_s = 0.0;
  /// What swings behind the drive: y = (1 − share) x + share q with q'' = ω² (x − q) − 2ζω q', ω / 2π its natural
  /// frequency, ζ its damping ratio. A share of one: all that is read hangs on a spring.
  double resonance_hz = 0.0, resonance_damping = 0.0, resonance_share = 0.0;
};
inline constexpr std::size_t num_servo_flaws = 16;
inline constexpr std::array<double ServoFlaws::*, num_servo_flaws> servo_flaws{
    &ServoFlaws::max_rate_rad_s,      &ServoFlaws::max_acceleration_rad_s2,
    &ServoFlaws::dead_band,           &ServoFlaws::backlash_rad,
    &ServoFlaws::second_tau_s,        &ServoFlaws::clock_rate,
    &ServoFlaws::earlier_command,     &ServoFlaws::gain_difference,
    &ServoFlaws::gain_drift,          &ServoFlaws::gain_by_size,
    &ServoFlaws::max_command,         &ServoFlaws::rate_offset_rad_s,
    &ServoFlaws::soft_max_rate_rad_s, &ServoFlaws::resonance_hz,
    &ServoFlaws::resonance_damping,   &ServoFlaws::resonance_share};
inline constexpr std::array<const char*, num_servo_flaws> servo_flaw_names{
    "max_rate_rad_s", "max_acceleration_rad_s2", "dead_band",           "backlash_rad", "second_tau_s",
    "clock_rate",     "earlier_command",         "gain_difference",     "gain_drift",   "gain_by_size",
    "max_command",    "rate_offset_rad_s",       "soft_max_rate_rad_s", "resonance_hz", "resonance_damping",
    "resonance_share"};
inline constexpr std::array<const char*, num_servo_flaws> servo_flaw_words{
    "a limit of its rate",
    "a limit of its acceleration",
    "a dead band",
    "backlash",
    "a second lag",
    "a drift between the clocks of commands and angles",
    "another command before the first row's",
    "a gain that differs by the command's sign",
    "a gain that drifts",
    "a gain that changes with the command's size",
    "a limit of the command",
    "a rate beside the command's",
    "a rate that falls behind as it grows",
    "a resonance",
    "the resonance's damping ratio",
    "the resonance's share of the motion"};
inline constexpr std::array<const char*, num_servo_flaws> servo_flaw_units{"rad/s",
                                                                           "rad/s^2",
                                                                           "units of command",
                                                                           "rad",
                                                                           "s",
                                                                           "s/s",
                                                                           "units of command",
                                                                           "of the gain",
                                                                           "of the gain over the log",
                                                                           "of the gain up to the largest command",
                                                                           "units of command",
                                                                           "rad/s",
                                                                           "rad/s",
                                                                           "Hz",
                                                                           "of the critical",
                                                                           "of all"};

struct ServoFit {
  ServoKind kind = ServoKind::angle;
  ServoParams params = ServoParams::Zero();
  ServoFlaws flaws;                                     ///< Those indicated by the log, as estimated.
  std::vector<std::size_t> freed;                       ///< Which: indices in servo_flaws, in order of selection.
  std::array<double, num_servo_flaws> flaw_sigma = {};  ///< Of those.
  /// Of those: 2 ln of the likelihood ratio with which each was freed (together, where two were).
  std::array<double, num_servo_flaws> flaw_evidence = {};
  /// Of the selected model: blocks of rows are clusters; of the other as `cov_model`.
  Eigen::Matrix<double, num_servo_params, num_servo_params> cov = decltype(cov)::Zero();
  Eigen::Matrix<double, num_servo_params, num_servo_params> cov_model = decltype(cov)::Zero();  ///< Of white noise.
  double rms_rad = 0.0;  ///< Of the residuals, over the degrees of freedom.
  bool has_converged = false;
  bool is_observable = false;  ///< The normal equations can be solved.
};

/// A flaw that cannot be distinguished from another one of the model.
struct ServoRival {
  std::size_t flaw = 0, other = 0;
  double evidence = 0.0;  ///< 2 ln of the likelihood ratio, for `flaw`.
};

/// A nonlinearity of a typical size that this log does not show: the gain with it, over the stated one.
struct HiddenFlaw {
  std::size_t flaw = 0;
  double size = 0.0, gain_factor = 1.0;
};

/// From a row on the encoder reads by so much more: a coupling that slipped, a counter that lost or gained pulses.
struct ZeroSlip {
  std::size_t row = 0;
  double t_s = 0.0, size_rad = 0.0, sigma_rad = 0.0;
};

/// From a time on the axis is another: a load, a motor that warms up, a network.
struct ServoChange {
  double t_s = 0.0;
  ServoFit whole;          ///< As one, without flaws.
  ServoFit before, after;  ///< Of the log until then, and from then on.
};

/// What is assumed absent, its typical size, and its effect on the parameters beside the log's information.
struct CountedFlaw {
  std::string name;  ///< As in servo_flaw_names, or "encoder_eccentricity_rad".
  double sigma = 0.0;
  ServoParams moves = ServoParams::Zero();  ///< [σ of it]
  std::string remedy;
};

struct ServoIdentification {
  enum class Status { converged, not_converged, degenerate };
  Status status = Status::degenerate;
  ServoFit fit;                      ///< The selected model.
  ServoFit other;                    ///< The one that is not.
  std::vector<double> residual_rad;  ///< Response − reading.
  ClusterCovariance clusters;        ///< Blocks of rows; of the fit's parameters, whose covariance it is.
  std::size_t correlated_rows = 1;   ///< How many rows in a row share an error.
  std::vector<ServoRival> rivals;    ///< Of the flaws that were freed.
  std::vector<HiddenFlaw> hidden;
  std::vector<CountedFlaw> counted;  ///< In the fit's covariance.
  double sigma_time_s = 0.0;         ///< By which the rows' times err, where the residuals show it; in the covariance.
  double sigma_time_score = 0.0;     ///< Of it, in σ.
  double encoder_hz = 0.0;           ///< It is sampled so often and held between: half a period is in the latency.
  std::vector<double> sampled_t_s;   ///< Of each row, then.
  std::vector<double> command_t_s;   ///< Where commands were given before their rows: each row's, as estimated.
  std::size_t num_command_times = 0;
  double sigma_command_s = 0.0;  ///< Of what all of them may have been given earlier, as far as it is open; in the σ.
  bool has_frequent_commands = false;  ///< They change from row to row, and the log has no times of theirs.
  /// Of such: so many are given in the usual time between two rows, 1000: all the time; 0: each at its row.
  std::size_t commands_per_row = 0;
  std::vector<std::size_t> lost_commands;  ///< Rows whose command the axis did not follow; the one before held on.
  std::vector<ZeroSlip> slips;             ///< Of the encoder's zero, estimated with the fit.
  std::optional<ServoChange> change;       ///< Where the axis does not stay what it is; `fit` is then the whole's.
  double lag_one_correlation = 0.0;        ///< Of the residuals, one row to the next: near 0 where the model is enough.
  double command_range = 0.0, angle_range_rad = 0.0, duration_s = 0.0;
};

/// Which kind of plant is selected: the one whose residuals are clearly smaller, or the given one.
enum class ServoKindRule { automatic, angle, rate };

/// Options of identify().
struct IdentifyConfig {
  ServoKindRule kind = ServoKindRule::automatic;
  double sigma_clock = 0.001;  ///< Of the rate of the log's clock, counted in σ.
};

/// The fields of `config` that a user sets.
[[nodiscard]] FieldList fields_of(IdentifyConfig& config);

/// The result of identify(): the plant of one axis with its covariance (`fit`), and its verdict.
struct Identification : ServoIdentification {
  std::vector<ServoSample> log;
  IdentifyConfig config;
  double encoder_step_rad = 0.0;  ///< Where the angles are its whole multiples; 0: not seen.
  std::size_t encoder_wraps = 0;  ///< Where the encoder begins again after a turn: `log` has them unwrapped.
  std::vector<Assumption> assumed;
  Counts counts;  ///< Of rows.
  Verdict verdict;
};

ALIDADE_PUBLIC_END
}  // namespace alidade
