#include "alidade/reference/name_tables.h"

namespace alidade {

const NameTables& observe_names() {
  static const NameTables names{{"observe", R"(estimate:
@lens camera.
bound.*       1  Cramér–Rao bound (σ) of this log, by name
error.*       1  with truth columns: estimate − truth, by name
mount_x_rad   rad  rotation of the camera against the head
mount_y_rad   rad  rotation of the camera against the head
mount_z_rad   rad  rotation of the camera against the head
delay_s       s    of the image's time against the rotation's
lever_x_m     m    camera centre from the centre of rotation
lever_y_m     m    camera centre from the centre of rotation
lever_z_m     m    camera centre from the centre of rotation
shutter_s     s    from the first row to the last
focal_drift_x_px_s  px/s  of fx
focal_drift_y_px_s  px/s  of fy
sigma_px      px   of a coordinate
sigma_px_from text residuals, or given
matches.
  given               count  between the photos
  agree_within_pairs  count  with one rotation of their pair
  kept                count  in the solution
parallax.
  z                  1   size of what rotation alone does not explain, in its σ
  rms_px             px  of it
  share_of_distance  1   how far the camera's centre moved, over the distance of the points
photos[].
  file        text   photo
  used        flag   in the solution
  reason      text   why not
  points      count  of it that are used
  rms_px      px     of a residual
  turn_rad    rad    rotation from the first photo
  zoom        1      focal length over that of the first
  sigma_zoom  1      σ
rotation.
  source                text   how it was measured: rate, head, attitude or none
  sigma_angle_rad       rad    σ of measured angles as taken; 0: exact, null: not measured
  sigma_rate_rad_per_s  rad/s  σ of measured rates as taken
shared_errors.
  design_effect  1  how much less the rows determine than if each erred by itself
  correlation_s  s  how long errors last
  block_s        s  length of the blocks that err by themselves
  track_effect   1  the same for the tracks of points
causes[].
  name   text  error of rotation or lens that was looked for
  z      1     its size in its σ
  members[].name   text  part of it
  members[].value  1     its size
  members[].sigma  1     σ
  members[].unit   text  of both
events[].
  t_s   s     when
  kind  text  what
  point count which point
data:
steps.
  t_s  s  time
  @intrinsics -
  @intrinsics sigma_
  @intrinsics truth_
  nis              1      normalised innovation squared
  nis_dof          count  its degrees of freedom
  event            text   what happened
  event_point      count  to which point
  weak_eigenvalue  1      smallest of the information matrix
  omega_x_rad_per_s  rad/s  rate in the camera frame
  omega_y_rad_per_s  rad/s  rate in the camera frame
  omega_z_rad_per_s  rad/s  rate in the camera frame
  start_from_cam_qw  1  rotation since the first row
  start_from_cam_qx  1  rotation since the first row
  start_from_cam_qy  1  rotation since the first row
  start_from_cam_qz  1  rotation since the first row
photos.
  name        text   photo
  used        flag   in the solution
  reason      text   why not
  points      count  of it that are used
  rms_px      px     of a residual
  cluster_z2  1      squared error that the photo's matches share, in its σ
points.
  step           count  row of `steps`
  point          count  number
  u_px           px     position
  v_px           px     position
  residual_u_px  px     prediction − observation
  residual_v_px  px     prediction − observation
files:
camera.yaml  text  the camera at the end, with its covariance
intrinsics.csv.
  t_s       s     time
  fx        px    empty until there is an estimate
  fy        px    empty until there is an estimate
  cx        px    empty until there is an estimate
  cy        px    empty until there is an estimate
  sigma_fx  px    σ
  sigma_fy  px    σ
  sigma_cx  px    σ
  sigma_cy  px    σ
  nis       1     normalised innovation squared
  event     text  what happened
points.csv   text  the rotation log of points followed in a video
)"},
                                {"plan observe", R"(estimate:
camera.
  width   count  pixels of a row
  height  count  rows
  fx      px     now
  fy      px     now
  cx      px     now
  cy      px     now
sigma_now_px.*      px  by name
sigma_planned_px.*  px  after the planned moves
data:
next.
  pan_rad      rad  to the left
  tilt_rad     rad  up
  roll_rad     rad  about the view
  duration_s   s    of the move
  sigma_fx_px  px   after it
  sigma_fy_px  px   after it
  sigma_cx_px  px   after it
  sigma_cy_px  px   after it
)"},
                                {"simulate rotation", R"(estimate:
pairs          any  how many
wrong          any  which points or matches are wrong
moving         any  which points move
files:
log.csv            text  rotation log: t, the rotation, points, and the truth fx,fy,cx,cy
pairs.csv          text  matches between photos
truth_camera.yaml  text  the true camera
)"}};
  return names;
}

}  // namespace alidade
