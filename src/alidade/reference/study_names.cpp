#include "alidade/reference/name_tables.h"

namespace alidade {
namespace {

const std::string paper_names = R"(estimate:
paper              text   fang2011, wang2020, xiahou2015 or xu-underwater
reference          text   where it was published
reproduced         count  claims that come out
in_shape           count  claims that come out in shape
not_reproducible   count  claims for which the paper does not say enough
quick              flag   fewer runs
claims[].
  id          text  claim
  experiment  text  of which experiment
  quantity    text  what was measured
  unit        text  of the figures
  paper       1     as printed
  ours        1     the paper's method, run again
  best        1     this library's method
  bound       1     Cramér–Rao bound
  holds       text  yes, in shape, no, or not reproducible
  words       text  what was run, and how it differs
data:
*.*  any  figures and tables of the paper
files:
claims.csv.
  experiment  text  of which experiment
  id          text  claim
  quantity    text  what was measured
  unit        text  of the figures
  printed     1     in the paper
  ours        1     the paper's method, run again
  best        1     this library's method
  bound       1     Cramér–Rao bound
  holds       text  yes, in shape, no, or not reproducible
  words       text  what was run, and how it differs
fig_*.csv  text  data of the figures
)";

}  // namespace

const NameTables& study_names() {
  static const NameTables names{{"identify", R"(estimate:
kind                    text   what follows the command with a lag: angle or rate
gain_rad                rad    for each unit of command (rate: rad/s)
gain_deg                deg    the same
tau_s                   s      time constant
latency_s               s      from the command to its first effect
zero_rad                rad    reading at command zero
start_rad               rad    angle at the first row
max_rate_rad_s          rad/s  limit of the rate
max_acceleration_rad_s2 rad/s² limit of the acceleration
dead_band               1      commands no larger do nothing
backlash_rad            rad    between drive and encoder
second_tau_s            s      second lag, of the command
clock_rate              1      by which a second of the angles' clock is longer than one of the commands'
earlier_command         -      what the axis followed until the first row's command took effect, less that command
gain_difference         1      the gain is 1 + it times the stated for commands above zero, 1 − it below
gain_drift              1      by so much of it the gain grows over the log; the stated one is its middle's
gain_by_size            1      by so much of it the gain grows from no command to the largest; the stated one is that of half of the largest
soft_max_rate_rad_s     rad/s  where its lag alone, or the command of a rate, would turn it at r, it turns at r / (1 + |r| / this)
resonance_hz            Hz     natural frequency of what swings behind the drive
resonance_damping       1      its damping ratio
resonance_share         1      of the motion, what goes through it; the rest is rigid
evidence.*              1      of each of these: 2 ln of the likelihood ratio for it
encoder_step_rad        rad    one count
encoder_hz              Hz     how often it is sampled, where its angle is held for several rows; 0: not seen
sigma_time_s            s      by which the rows' times err, where the residuals show it; else 0
design_effect           1      how much less the rows determine than if each erred by itself
correlated_rows         count  how long errors last
rms_rad                 rad    of a residual
rms_of_other_kind_rad   rad    of a residual, had the other kind been taken
lag_one_correlation     1      of one residual with the next
data:
response.
  t_s           s    time
  command       1    given
  measured_rad  rad  encoder
  model_rad     rad  plant
  residual_rad  rad  model − measured
files:
servo.yaml  text  the plant, as a scenario of `alidade servo` takes it
)"},
                                {"servo", R"(estimate:
controllers.*.
  rms_px         px     of the target from the image's centre
  between_px     px     the same at thirds of the periods, between two images
  p95_px         px     95 % are nearer, of all trials' periods
  max_px         px     the farthest of all trials, between two images too
  central_third  1      share of the time in the central third
  in_picture     1      share of the time in the image
  lost           count  trials that lost the target
  found          count  trials that found it again
  search_s       s      time of search
  unseen         1      share of the time in which a head has not seen the target yet
loops.*.
  sampled_radius    1      largest eigenvalue of the sampled loop; below 1: stable
  bandwidth_rad_s   rad/s  of the sampled loop with its delays; null: the controller was tried
  phase_margin_deg  deg    of the sampled loop with its delays; below 0: unstable
  loop_gain         1      of the loop
  swing_px          px     that limits of rate and acceleration, or backlash, keep it swinging by for good after a jump, about its mean; 0: it rests
  radius_within_3_sigma  1  the largest of sampled_radius where gain, time constant and delay of the plant are off by 3 of their sigma, each either way; null: none is given
best              text  controller
specification_px  px    asked for
*                 any   of a part that was asked for
data:)" + target_table_names() +
                                              R"(loops.
  controller        text   name
  loop_gain         1      of the loop
  bandwidth_rad_s   rad/s  of the sampled loop with its delays; null: the controller was tried
  phase_margin_deg  deg    of the sampled loop with its delays; below 0: unstable
  delay_samples     count  of the loop
  sampled_radius    1      largest eigenvalue
lenses.
  intrinsics   text   given, observed or true
  seed         count  of the trial
  rms_px       px     of the target from the image's centre
  p95_px       px     95 % are nearer
  max_px       px     the farthest
  focal_share  1      error of the focal length
  focal_z      1      the same in its σ
trials.
  controller     text   name
  seed           count  of the trial
  rms_px         px     of the target from the image's centre
  p95_px         px     95 % are nearer
  max_px         px     the farthest
  central_third  1      share of the time in the central third
control.
  t_s                  s      time
  head                 count  whose
  asked_pan_rad        rad    angle that centres the target
  asked_tilt_rad       rad    angle that centres the target
  measured_pan_rad     rad    encoder
  measured_tilt_rad    rad    encoder
  predicted_pan_rad    rad    when the command acts
  predicted_tilt_rad   rad    when the command acts
  rate_pan_rad_s       rad/s  asked for
  rate_tilt_rad_s      rad/s  asked for
  command_pan          1      given
  command_tilt         1      given
  error_u_px           px     target from the centre
  error_v_px           px     target from the centre
  sigma_error_u_px     px     its σ
  sigma_error_v_px     px     its σ
  in_picture           1      1: the target is in the image
  fx_px                px     in use
  sigma_fx_px          px     its σ
  true_fx_px           px     of the simulated camera
  event                text   what happened
grids:
robustness.
  gain    1   of the plant, over that of the scenario
  tau     1   of the plant, over that of the scenario
  rms_px  px  with that plant
files:
servo.csv  text  the first trial of every controller: controller and the columns of `control`
)"},
                                {"reproduce", paper_names},
                                {"simulate servo", R"(estimate:
gain_rad   rad  for each unit of command (rate: rad/s)
tau_s      s    time constant
latency_s  s    from the command to its first effect
files:
log.csv.
  t_s        s    time
  command    1    from that time on
  angle_rad  rad  encoder
scenario.yaml  text  a scenario of `alidade servo`
)"}};
  return names;
}

}  // namespace alidade
