#include "alidade/reference/name_tables.h"

namespace alidade {
namespace {

/// Path and observations of a target, in the results of track and servo.
const std::string target_tables = R"(
steps.
  t_s  s  time
  @xyz target_in_world_
  velocity_x_m_s  m/s  velocity
  velocity_y_m_s  m/s  velocity
  velocity_z_m_s  m/s  velocity
  @xyz sigma_target_in_world_
  sigma_velocity_x_m_s  m/s  σ
  sigma_velocity_y_m_s  m/s  σ
  sigma_velocity_z_m_s  m/s  σ
  @cov cov_
  @xyz truth_
  nees   1     normalised estimation error squared
  event  text  what happened
measurements.
  t_capture_s  s    of the image
  t_arrival_s  s    of the measurement
  head         count  whose
  pan_rad      rad  at capture
  tilt_rad     rad  at capture
  u_px         px   target
  v_px         px   target
  innovation_u_px        px  observation − prediction
  innovation_v_px        px  observation − prediction
  sigma_innovation_u_px  px  its σ
  sigma_innovation_v_px  px  its σ
  nis       1     normalised innovation squared
  accepted  flag  used
  @xyz ray_origin_in_world_
  ray_direction_x  1  in the world
  ray_direction_y  1  in the world
  ray_direction_z  1  in the world
)";

}  // namespace

const std::string& target_table_names() { return target_tables; }

const NameTables& motion_names() {
  static const NameTables names{{"rig", R"(estimate:
heads[].
  id                                 count  number
  world_from_base.translation_m[3]   m      position of the head; σ along the world's axes
  world_from_base.quaternion_wxyz[4] 1      rotation of the head
  world_from_base.rotation_rad[3]    rad    under stddev: σ of the rotation, about the head's axes
  cam_from_tilt.rotation_rad[3]      rad    under stddev: σ of the rotation
  pan_to_tilt_m[3]                   m      from the pan axis to the tilt axis
  tilt_to_cam_m[3]                   m      from the tilt axis to the camera
  cam_from_tilt.quaternion_wxyz[4]   1      rotation of the camera
  axes_skew_rad                      rad    of the axes from a right angle
  encoder.pan_zero_rad               rad    reading where pan is zero
  encoder.tilt_zero_rad              rad    reading where tilt is zero
  encoder.pan_scale                  1      radians of a radian read
  encoder.tilt_scale                 1      radians of a radian read
  encoder.pan_cos_rad                rad    eccentricity
  encoder.pan_sin_rad                rad    eccentricity
  encoder.tilt_cos_rad               rad    eccentricity
  encoder.tilt_sin_rad               rad    eccentricity
  encoder.sigma_rad                  rad    of a reading
cameras[].
  id                count  head, of a moving target
  placed            flag   located
  reason            text   why not
  sights            count  observations by it
  used              count  those solved for: at equal spacing, four or fewer per knot of the path; none beyond 5σ
  clock_offset_s    s      time of the rig − rate · its own time
  clock_rate        1      of the rig's time over its own
  sigma_clock_s     s      of its clock amid its observations
  sigma_clock_rate  1      of its rate
  sigma_px          px     of a coordinate
  rms_px            px     of an observation's residual
estimated[].
  name   text  value that was estimated beside the poses
  value  1     estimate
  sigma  1     σ
  was    1     as given
backlash_rad[]  any  pan and tilt of each head
causes[].
  name    text  error that was looked for
  size    1     of it
  sigmas  1     in its σ
@sigma sigma.
design_effect       1    how much less the corners determine than if each erred by itself
chi2_per_dof        1    of the solution
rms_px              px   of a corner's residual
sigma_relative_rad  rad  σ of one head against the other
sigma_relative_m    m    σ of one head against the other
noise.
  sigma_px           px    of a corner's coordinate
  sigma_encoder_rad  rad   of a reading
  px_from            text  residuals, or given
  encoder_from       text  residuals, or given
covers[].
  id             count  head
  views          count  of it
  boards         count  that it saw
  shared_boards  count  that another saw as well
  pan_rad[2]     rad    smallest and largest
  tilt_rad[2]    rad    smallest and largest
*  any  of a moving target: path, clocks and scale
data:
views.
  name                 text   photo, or number
  head                 count  whose
  board                count  which
  used                 flag   in the solution
  reason               text   why not
  pan_rad              rad    read
  tilt_rad             rad    read
  rms_px               px     of a corner's residual
  pan_correction_rad   rad    of the reading
  tilt_correction_rad  rad    of the reading
  cluster_z2           1      squared error that the view's corners share, in its σ
  travel_sign          count  from which side the axis came
  @pose world_from_cam_
  @pose base_from_cam_
axes.
  name  text  head and axis
  @xyz point_in_world_
  @direction -
corners.
  view           count  row of `views`
  corner         count  number on the board
  u_px           px     position
  v_px           px     position
  residual_u_px  px     prediction − observation
  residual_v_px  px     prediction − observation
*.*  any  of a moving target
files:
rig.yaml       text  the rig with its covariance
camera_*.yaml  text  its cameras
)"},
                                {"track", R"(estimate:
rms_m               m    with truth: of the position
mean_error_m        m    with truth
nees_per_dof        1    with truth: 1 where σ is right
nis_per_dof         1    1 where the innovations are as predicted
pcrlb_m             m    posterior Cramér–Rao bound
sigma_a_m_s2        m/s² of the target's acceleration
sigma_a_is_estimated flag from the innovations
sigma_px            px    of a coordinate whose row states none
sigma_px_from       text  residuals, given, rows (each states its own), or default (the innovations agree with it)
restarts            count  tracks that began again
rig_errors_counted  flag  the rig's covariance is in σ
sigma_raised_by     1     by the rig's covariance
position_m[3]       m     at the end, in the world
velocity_m_s[3]     m/s   at the end, in the world
*                   any   of a method
data:)" + target_tables +
                                              R"(frames.
  t_s       s      of the video's image
  head      count  whose
  frame     count  number
  u_px      px     target; null: not found
  v_px      px     target
  sigma_px  px     σ
  score     1      how well it looks like the target
  reason    text   why it was not found
innovations.
  head                count  whose
  num                 count  innovations
  mean_u_sigma        1      mean, in its σ
  mean_v_sigma        1      mean, in its σ
  along_motion_sigma  1      mean along the target's motion, in its σ
  slope_u_sigma       1      over time, in its σ
  slope_v_sigma       1      over time, in its σ
  colour              1      correlation of one with the next
  nis_per_dof         1      of that head
files:
track.csv.
  t_s        s     time that the row refers to
  @xyz -
  vx_m_s     m/s   velocity
  vy_m_s     m/s   velocity
  vz_m_s     m/s   velocity
  @xyz sigma_
  nis        1     normalised innovation squared
  event      text  what happened
)"},
                                {"localize", R"(estimate:
frames        count  given
lost          count  without a pose
ate_m         m      with truth: RMS of the position after alignment
rpe_m         m      with truth: from frame to frame
rpe_rad       rad    with truth: from frame to frame
unaligned_m   m      with truth: RMS without alignment
stated_m      m      RMS of the stated σ
nees_per_dof  1      with truth: normalised error squared of the poses, over 6; 1 where σ is right; null where the truth is in another frame
nees_aligned_per_dof  1      with truth: the same of the aligned positions, over 3; above 1 where σ is too small
alignment     text   with truth: none, rigid or similarity
nis_per_dof   1      1 where the innovations are as predicted
sigma_px      px     of a coordinate whose row states none; of images the least
sigma_px_from text   residuals, given, rows (each states its own), or default (the observations do not deny it)
scale_known   flag   by the target, or a sensor beside the camera
restarts      count  poses that were found again
sights        count  observations used
sights_gated  count  observations rejected
loops         count  returns to what was seen long before
loops_rejected  count  of those that contradict the other observations: places that look alike
tested[].
  name   text  error that was looked for
  asked  1     its size
  sigma  1     σ
  z      1     size over σ
imu.
  used                            flag   whether the path was solved with it
  gravity_in_world_m_s2[3]        m/s2   gravity in the path's frame
  gyro_bias_rad_s[3]              rad/s  of its rates, at the end, in its axes
  accelerometer_bias_m_s2[3]      m/s2   of its forces, at the end, in its axes
  position_in_cam_m[3]                 m      its place in the camera
  cam_from_imu_quaternion_wxyz[4]  1      its rotation
  cam_from_imu_rad[3]             rad    under stddev: σ of the rotation
  clock_s                         s      its clock less the camera's
  scale                           1      metres per unit of the path without it; with a target path over target
  gyro_noise_factor               1      σ of its rates over the given one
  accelerometer_noise_factor      1      σ of its forces over the given one
  steps                           count  from frame to frame, used
  steps_rejected                  count  rejected
  steps_missing                   count  without readings
*             any    of a part that was asked for
data:
path.
  t_s  s  time
  @pose world_from_cam_
  @xyz sigma_world_from_cam_
  sigma_world_from_cam_rx_rad  rad  σ of the rotation
  sigma_world_from_cam_ry_rad  rad  σ of the rotation
  sigma_world_from_cam_rz_rad  rad  σ of the rotation
  @pose truth_
  num_seen     count  points in view
  num_tracked  count  points used
  num_gated    count  points rejected
  nis          1      normalised innovation squared
  seconds      s      of computing
  event        text   what happened
features.
  id  count  number
  @xyz point_in_world_
  @cov cov_
  num_seen  count  frames that saw it
  known     flag   of the target
*.*  any  frames that are shown
files:
trajectory.tum  text  t x y z qx qy qz qw
map.ply         text  points for viewers
map.yaml        text  the map for another run to begin in: --map
map.csv.
  point_id  count  number
  @xyz -
  sigma_m   m      RMS of the three
  @cov cov_
  known     flag   of the target
  num_seen  count  frames that saw it
poses.csv.
  frame  count  number
  t_s    s      time
  @pose -
  cov_*  1      covariance of position [m] and rotation [rad], on the right
  num_seen     count  points in view
  num_tracked  count  points used
  num_gated    count  points rejected
  nis_per_dof  1      of the frame
  event        text   what happened
)"},
                                {"simulate rig", R"(estimate:
wrong_views[]  text  with a wrong reading
files:
views.csv.
  view      count  number
  board     count  which
  head      count  whose
  pan_rad   rad    read
  tilt_rad  rad    read
  corner    count  number on the board
  u         px     position
  v         px     position
camera_*.yaml   text  cameras
truth_rig.yaml  text  the true rig
)"},
                                {"simulate track", R"(estimate:
sigma_a_m_s2  m/s²  of the target's acceleration
duration_s    s     of the log
*             any   faults that were asked for
files:
events.csv.
  t_capture_s  s      of the image
  t_arrival_s  s      of the measurement
  head         count  whose
  pan_rad      rad    at capture
  tilt_rad     rad    at capture
  u_px         px     target
  v_px         px     target
truth.csv.
  t_s  s  time
  @xyz -
rig.yaml  text  the rig
)"},
                                {"simulate underwater", R"(estimate:
frames  count  made
*       any    what was asked for
files:
sights.csv.
  frame     count  number
  t_s       s      time
  point_id  count  which
  u_px      px     position
  v_px      px     position
target.yaml    text  known points
start.yaml     text  the first pose
camera.yaml    text  the camera
truth.tum      text  true path: t x y z qx qy qz qw
truth_map.csv  text  true points, as map.csv
)"}};
  return names;
}

}  // namespace alidade
