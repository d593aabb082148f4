#include "alidade/reference/name_tables.h"

namespace alidade {
namespace {

/// The photos of a board, in the results of calibrate and corners.
const std::string board_photo_tables = R"(
photos.
  name         text   file
  used         flag   in the solution
  reason       text   why not
  num_corners  count  found
  rms_px       px     of a corner's residual
  cluster_z2   1      squared error that the photo's corners share, in its σ
  @pose cam_from_board_
  @cov cov_middle_
corners.
  photo           count  row of `photos`
  col             count  on the board
  row             count  on the board
  u_px            px     position
  v_px            px     position
  sigma_u_px      px     σ of u
  sigma_v_px      px     σ of v
  corr_uv         1      correlation of both
  residual_u_px   px     prediction − observation
  residual_v_px   px     prediction − observation
  weight          1      0: rejected
)";

const std::string next_photo_table = R"(
next.
  @pose cam_from_board_
  worst_3sigma_px  px  at the worst pixel, with that photo
)";

}  // namespace

const NameTables& camera_names() {
  static const NameTables names{{"calibrate", R"(estimate:
@lens camera.
@sigma sigma.
rms_px                px     of a point's residual
noise_px              px     σ of a coordinate, from the residuals
excess_px             px     σ that every corner has beyond its own
board_shape           text   flat, bow, free or given
bow_m[2]              m      height of the board's centre over its edges, along both sides
transfer_rms_px       px     of unseen photos, the board's shape learned
transfer_flat_rms_px  px     of unseen photos, the board flat
working_distance_m    m      median distance of the board
worst_3sigma_px       px     at the worst pixel
port                  any    flat_port: what a lens without a port would err, by range
@board board.
corners_used          count  in the solution
corners_rejected[].photo      text   whose
corners_rejected[].file       text   whose
corners_rejected[].corner     count  number on the board
corners_rejected[].residual_px  px   length
photos[].
  file    text  photo
  used    flag  in the solution
  rms_px  px    of a corner's residual
  reason  text  why it was not used
data:)" + board_photo_tables + next_photo_table +
                                                  R"(cells.
  u_px       px     centre of the cell
  v_px       px     centre of the cell
  count      count  corners in it
  mean_u_px  px     mean residual
  mean_v_px  px     mean residual
  z          1      the mean in its σ
rings.
  radius_px           px  from the principal point
  mean_radial_px      px  mean residual outwards
  mean_tangential_px  px  mean residual across
  sigma_px            px  σ of both
models.
  name             text  lens model
  heldout_rms_px   px    of photos that were not in the solution
  sigma_px         px    σ of the difference to the model in use
board_points.
  col         count  on the board
  row         count  on the board
  dx_m        m      from where a flat board has it
  dy_m        m      from where a flat board has it
  dz_m        m      from where a flat board has it
  sigma_dz_m  m      σ of dz
grids:
sigma_infinity.sigma_px  px  σ of a pixel that a far point projects to
sigma_working.sigma_px   px  the same at the working distance
halves.
  delta_u_px          px  between calibrations of both halves of the photos
  delta_v_px          px  between calibrations of both halves of the photos
  predicted_sigma_px  px  σ of that difference
files:
camera.yaml  text  the camera with its covariance
@corner-file corners.csv.
poses.csv.
  photo  text  whose
  @pose cam_from_board_
board_points.csv.
  corner  count  number on the board
  @xyz -
)"},
                                {"corners", R"(estimate:
corners           count  found
corners_left_out  count  rejected
sigma_px          px     median σ of a coordinate
excess_px         px     σ that every corner has beyond its own
covariance        text   where the corners' covariance is from
model             text   lens model that identified outliers
photos[].
  file     text   photo
  corners  count  found
  reason   text   why there are none
data:)" + board_photo_tables +
                                                R"(files:
@corner-file corners.csv.
)"},
                                {"camera show", R"(estimate:
@lens camera.
rms_px               px    of the calibration
source               text  where the camera is from
horizontal_view_deg  deg   angle of view
vertical_view_deg    deg   angle of view
diagonal_view_deg    deg   angle of view
valid_off_axis_deg   deg   up to which the lens model holds
seeing_share         1     of the image that sees
median_3sigma_px     px    of a pixel
worst_3sigma_px      px    of a pixel
)"},
                                {"camera convert", R"(estimate:
@lens camera.
format      text  written
left_out[]  text  what the format does not carry
)"},
                                {"camera diff", R"(estimate:
rms_px           px   difference of pixels
max_px           px   the largest
central_rms_px   px   in the central third
rms_in_sigmas    1    of the difference over its σ
max_in_sigmas    1    the largest
compared_share   1    of the image that both cameras see
b_from_a.translation_m[3]    m  between the cameras' frames
b_from_a.quaternion_wxyz[4]  1  between the cameras' frames
data:
parameters.
  name     text  of the lens
  a        1     value in the first camera
  b        1     value in the second
  sigma_a  1     σ in the first
  sigma_b  1     σ in the second
grids:
diff.
  delta_u_px  px  second minus first
  delta_v_px  px  second minus first
  sigma_a_px  px  σ of the first
  sigma_b_px  px  σ of the second
  in_sigmas   1   the difference over the σ of both
)"},
                                {"camera undistort", R"(estimate:
@lens camera.
black_share  1  of a straight image's pixels, those that the photo does not show
photos[].
  file     text  photo
  written  text  its straight image
files:
camera.yaml  text  the pinhole of the straight images
)"},
                                {"plan calibrate", R"(estimate:
@lens camera.
worst_3sigma_px          px  at the worst pixel, now
planned_worst_3sigma_px  px  the same with the planned photos
data:)" + next_photo_table + R"(points_in_board.
  @xyz -
)"},
                                {"simulate board", R"(estimate:
@lens camera.
outliers[]  any  corners that were moved
files:
*.png              text  photos
@corner-file corners.csv.
truth_corners.csv.
  photo   text   whose
  corner  count  number on the board
  u_px    px     true position
  v_px    px     true position
truth_camera.yaml  text  the true camera
truth_poses.csv.
  photo  text  whose
  @pose -
truth_board.csv.
  corner  count  number on the board
  @xyz -
)"}};
  return names;
}

}  // namespace alidade
