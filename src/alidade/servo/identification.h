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

/// One row of a servo's log: a command that is valid until that of the next row, and the angle read at that time.
struct ServoSample {
  double t_s = 0.0, command = 0.0, angle_rad = 0.0;
  /// When the command was given, if before the angle was read but not before the previous row; NaN: at t_s.
  double command_t_s = std::numeric_limits<double>::quiet_NaN();
  /// For an encoder that holds its angle for several rows, estimated by identify(): half a sampling period after the
  /// sample that the angle repeats was taken. Only the first row of each sample is used. NaN: at t_s.
  double sampled_t_s = std::numeric_limits<double>::quiet_NaN();

  [[nodiscard]] double read_s() const { return std::isfinite(sampled_t_s) ? sampled_t_s : t_s; }
  [[nodiscard]] double given_s() const { return command_t_s <= t_s ? command_t_s : t_s; }
};

/// Parameters of a servo in order: gain [rad per unit, or rad/s per unit], time constant [s], latency [s], encoder
/// reading at angle zero [rad], start [rad, or rad/s: the initial angle of an angle plant, the initial rate of a rate
/// plant, at the first row].
inline constexpr int num_servo_params = 5;
using ServoParams = Eigen::Vector<double, num_servo_params>;
inline constexpr std::array<const char*, num_servo_params> servo_param_names{"gain", "tau_s", "latency_s", "zero",
                                                                             "start"};

/// Response of the angle: its value (angle plant) or its rate (rate plant) follows with a first-order lag. With an
/// acceleration limit, an angle plant is the axis of a head with position commands: docs/maths/servo.md.
enum class ServoKind { angle, rate };

/// Nonlinearities of a servo besides its first-order lag; 0: absent.
struct ServoFlaws {
  double max_rate_rad_s = 0.0, max_acceleration_rad_s2 = 0.0;
  double dead_band = 0.0;     ///< Smaller commands do nothing; larger ones are reduced by it.
  double backlash_rad = 0.0;  ///< Play between the drive and the angle that is read.
  double second_tau_s = 0.0;  ///< First-order lag of the command, before the plant.
  double clock_rate = 0.0;    ///< One second of the angles' clock lasts 1 + this of the commands' clock.
  /// Command in effect before the first row's, minus the first row's: a property of the log, not of the axis.
  double earlier_command = 0.0;
  double gain_difference = 0.0;  ///< Relative: gain × (1 + this) for commands above zero, × (1 − this) below.
  double gain_drift = 0.0;       ///< Relative growth of the gain over the log; the stated one is that at its centre.
  /// Relative growth of the gain from zero to the largest command; the stated gain is that at half the largest.
  double gain_by_size = 0.0;
  double max_command = 0.0;        ///< For an angle plant: larger commands act like this one (a driver's limit, stops).
  double rate_offset_rad_s = 0.0;  ///< For a rate plant: rate in addition to the commanded rate.
  /// Soft limit: where the lag alone (rate plant: the command) would give a rate r, the rate is r / (1 + |r| / this).
  double soft_max_rate_rad_s = 0.0;
  /// Resonance after the drive: y = (1 − share) x + share q with q'' = ω² (x − q) − 2ζω q', ω / 2π its natural
  /// frequency, ζ its damping ratio. A share of one: everything that is read is mounted on a spring.
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
  std::vector<std::size_t> freed;                       ///< Their indices in servo_flaws, in order of selection.
  std::array<double, num_servo_flaws> flaw_sigma = {};  ///< σ of each of these.
  /// For each of these: 2 ln of the likelihood ratio with which it was freed (jointly, if two were freed together).
  std::array<double, num_servo_flaws> flaw_evidence = {};
  /// Clusters are blocks of rows for the selected kind of plant; for the other kind, equal to `cov_model`.
  Eigen::Matrix<double, num_servo_params, num_servo_params> cov = decltype(cov)::Zero();
  Eigen::Matrix<double, num_servo_params, num_servo_params> cov_model = decltype(cov)::Zero();  ///< For white noise.
  double rms_rad = 0.0;  ///< RMS of the residuals, over the degrees of freedom.
  bool has_converged = false;
  bool is_observable = false;  ///< The normal equations are regular.
};

/// A nonlinearity that cannot be distinguished from another one in the model.
struct ServoRival {
  std::size_t flaw = 0, other = 0;
  double evidence = 0.0;  ///< 2 ln of the likelihood ratio of `flaw`.
};

/// A nonlinearity of typical size that this log cannot show: the gain if it is present, over the stated gain.
struct HiddenFlaw {
  std::size_t flaw = 0;
  double size = 0.0, gain_factor = 1.0;
};

/// A step of the encoder's zero from one row on: a coupling that slipped, a counter that lost or gained pulses.
struct ZeroSlip {
  std::size_t row = 0;
  double t_s = 0.0, size_rad = 0.0, sigma_rad = 0.0;
};

/// A change of the axis at one time: a different load, a motor that warms up, a network.
struct ServoChange {
  double t_s = 0.0;
  ServoFit whole;          ///< One fit to the whole log, without nonlinearities.
  ServoFit before, after;  ///< Fits to the log up to that time, and from then on.
};

/// An effect that is assumed absent, its typical size, and its effect on the parameters given the log's information.
struct CountedFlaw {
  std::string name;  ///< As in servo_flaw_names, or "encoder_eccentricity_rad".
  double sigma = 0.0;
  ServoParams moves = ServoParams::Zero();  ///< Change of the parameters for 1σ of it.
  std::string remedy;
};

struct ServoIdentification {
  enum class Status { converged, not_converged, degenerate };
  Status status = Status::degenerate;
  ServoFit fit;                      ///< The selected kind of plant.
  ServoFit other;                    ///< The other kind.
  std::vector<double> residual_rad;  ///< Model response − reading.
  ClusterCovariance clusters;        ///< Blocks of rows; for the fit's parameters, whose covariance comes from it.
  std::size_t correlated_rows = 1;   ///< Number of consecutive rows with correlated errors.
  std::vector<ServoRival> rivals;    ///< Of the nonlinearities that were freed.
  std::vector<HiddenFlaw> hidden;
  std::vector<CountedFlaw> counted;  ///< Included in the fit's covariance.
  double sigma_time_s = 0.0;      ///< σ of the rows' times, where the residuals show it; included in the covariance.
  double sigma_time_score = 0.0;  ///< Significance of sigma_time_s [σ].
  double encoder_hz = 0.0;  ///< Sampling rate of an encoder that holds its value; the latency includes half a period.
  std::vector<double> sampled_t_s;  ///< One per row, in that case.
  std::vector<double> command_t_s;  ///< One per row, as estimated, if commands were given before their rows.
  std::size_t num_command_times = 0;
  double sigma_command_s = 0.0;  ///< σ of the unresolved common lead of all command times; included in the covariance.
  bool has_frequent_commands = false;  ///< Commands change from row to row, and the log has no command times.
  /// For such commands: how many are given in the usual interval between rows; 1000: continuously; 0: one at each row.
  std::size_t commands_per_row = 0;
  std::vector<std::size_t> lost_commands;  ///< Rows whose command the axis did not follow; it kept to the previous one.
  std::vector<ZeroSlip> slips;             ///< Of the encoder's zero, estimated together with the fit.
  std::optional<ServoChange> change;       ///< If the axis changes during the log; `fit` is then that of the whole log.
  double lag_one_correlation = 0.0;        ///< Lag-one autocorrelation of the residuals: near 0 for an adequate model.
  double command_range = 0.0, angle_range_rad = 0.0, duration_s = 0.0;
};

/// Which kind of plant is selected: the one with clearly smaller residuals, or the given one.
enum class ServoKindRule { automatic, angle, rate };

/// Options of identify().
struct IdentifyConfig {
  ServoKindRule kind = ServoKindRule::automatic;
  double sigma_clock = 0.001;  ///< Relative σ of the rate of the log's clock; included in σ.
};

/// The fields of `config` that a user sets.
[[nodiscard]] FieldList fields_of(IdentifyConfig& config);

/// The result of identify(): the plant of one axis with its covariance (`fit`), and its verdict.
struct Identification : ServoIdentification {
  std::vector<ServoSample> log;
  IdentifyConfig config;
  double encoder_step_rad = 0.0;  ///< Resolution of the encoder, if all angles are multiples of it; 0: none found.
  std::size_t encoder_wraps = 0;  ///< Number of wrap-arounds of the encoder; `log` is unwrapped.
  std::vector<Assumption> assumed;
  Counts counts;  ///< Number of rows.
  Verdict verdict;
};

ALIDADE_PUBLIC_END
}  // namespace alidade
