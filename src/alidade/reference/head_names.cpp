#include "alidade/reference/name_tables.h"

namespace alidade {

const NameTables& head_names() {
  static const NameTables names{{"head", R"(estimate:
url              text  the head
info             text  what it calls itself
position_rad[2]  rad   pan and tilt, as it read them last
low_rad[2]       rad   smallest pan and tilt
high_rad[2]      rad   largest pan and tilt
latency_s        s     from a question to its answer: the median of 100
latency_p99_s    s     of 100, the second longest
jitter_s         s     its scatter
rate_rad_s[2]    rad/s of pan and tilt, in a small move
resolution_rad[2] rad  smallest change that was read
head_time_s      s     for which the head was in use
axes.*.
  rate_rad_s           rad/s   largest
  acceleration_rad_s2  rad/s²  of starting and braking; null: more than can be seen
  time_constant_s      s       with which it comes to rest
  latency_s            s       from the command's sending to the first motion that can be read
  backlash_rad         rad     between drive and encoder
  dead_band_rad        rad     steps that are no larger do nothing
  resolution_rad       rad     of the readings
  repeatability_rad    rad     σ of where the same command from the same side ends
  offset_rad           rad     reading at rest less command
  gain                 1       radians read for a radian commanded
  encoder_hz           Hz      how often it is sampled; 0: whenever it is asked
  rms_rad              rad     of a residual
  noise                1       the same, over what resolution and clocks explain
  evidence.*           1       2 ln of the likelihood ratio for it
stream           text   of the camera
frame_times      text   stamped by who took them, or of their arrival
frames           count  that came
frames_skipped   count  not looked at: newer ones had come
moves            count  of the head
offline[]        text   words behind `alidade` that give the same numbers, where log.csv is
mount_x_rad      rad    rotation vector of cam_from_tilt
mount_y_rad      rad    rotation vector of cam_from_tilt
mount_z_rad      rad    rotation vector of cam_from_tilt
delay_s          s      a frame shows the angles of so much later than its time; below zero: earlier
commands         count  that were sent to follow the target
rms_px           px     of the target from the principal point, from a third of the time on
max_px           px     the farthest
central_third    1      share of the frames with the target in the central third
period_s         s      from one command to the next
image_age_s      s      of the newest image when a command is sent, on average
forecast.rms_px           px    what servo predicts for this head, these delays and this target
forecast.controller       text  of servo, the best one
forecast.period_s         s     of its commands
forecast.image_age_s      s     of its images
forecast.command_delay_s  s     from a command to its first effect
*                any    of --calibrate: as `observe` says it
data:
*.*  any  of --calibrate: as `observe` says it
follow.
  t_s                s    of the frame
  error_u_px         px   of the target from the principal point
  error_v_px         px   of the target from the principal point
  asked_pan_rad      rad  where the head was asked to point then
  asked_tilt_rad     rad  where the head was asked to point then
  measured_pan_rad   rad  of the head, when it was taken
  measured_tilt_rad  rad  of the head, when it was taken
  target_pan_rad     rad  that would look at it
  target_tilt_rad    rad  that would look at it
readings.
  t_s       s    midpoint of question and answer
  wait_s    s    for the answer
  pan_rad   rad  read
  tilt_rad  rad  read
pan.
  t_s           s    time
  measured_rad  rad  encoder
  model_rad     rad  of the estimate
  residual_rad  rad  model − measured
tilt.
  t_s           s    time
  measured_rad  rad  encoder
  model_rad     rad  of the estimate
  residual_rad  rad  model − measured
grids:
*.*  any  of --calibrate
files:
camera.yaml  text  the lens with its covariance
rig.yaml     text  the head with its mounting
log.csv      text  rotation log, as `observe` reads it
follow.csv.
  t_s              s    of the frame
  pan_rad          rad  of the head, when it was taken
  tilt_rad         rad  of the head, when it was taken
  u_px             px   target; empty: not found
  v_px             px   target; empty: not found
  target_pan_rad   rad  that would look at it
  target_tilt_rad  rad  that would look at it
  error_px         px   of the target from the principal point
  asked_pan_rad    rad  where the head was asked to point then; empty: nowhere
  asked_tilt_rad   rad  where the head was asked to point then; empty: nowhere
pan.csv.
  t_s        s    time
  command    rad  given last
  angle_rad  rad  read
tilt.csv.
  t_s        s    time
  command    rad  given last
  angle_rad  rad  read
)"}};
  return names;
}

}  // namespace alidade
