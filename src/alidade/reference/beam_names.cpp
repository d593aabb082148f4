#include "alidade/reference/name_tables.h"

namespace alidade {

const NameTables& beam_names() {
  static const NameTables names{{"rangefinder", R"(estimate:
@lens camera.
method         text  joint, spot, plane or edges
refine         text  all or beam
origin_m[3]    m     of the beam, in the camera
direction[3]   1     of the beam, in the camera
theta_x_rad    rad   of the direction about x
theta_y_rad    rad   of the direction about y
scale          1     metres of a metre read
rms_px         px    of a spot's residual
rms_range_m    m     of a range's residual
offset_m       m     of the origin from the camera
bound.
  origin_m[3]   m  Cramér–Rao bound (σ)
  direction[3]  1  Cramér–Rao bound (σ)
  scale         1  Cramér–Rao bound (σ)
spot_sigma_px[]    px  σ of the spot's image at spot_sigma_at_m
spot_sigma_at_m[]  m   ranges
condition      1  of the equations
range_ratio    1  largest range over the smallest
normal_spread  1  how far the boards' normals spread
@sigma sigma.
noise.
  sigma_spot_px    px    of a spot's coordinate
  sigma_corner_px  px    of a corner's coordinate
  sigma_range_m    m     of a range
  spot_from        text  residuals, or given
  range_from       text  residuals, or given
sheet.
  sigma_m   m     of a sheet before the print, as given
  left_m    m     of it, with what the shots say
  moves[6]  any   of origin [m], direction [rad] and scale, by left_m
@board board.
left_out.
  rms_range_m  m   of shots predicted from the others
  rms_px       px  of shots predicted from the others
causes[]       any  errors that were looked for
gain           1    method edges: of the range over the scan
halves_differ_rad  rad  method edges: between halves of the edges
data:
shots.
  name                    text  photo, or number
  used                    flag  in the solution
  reason                  text  why not
  range_m                 m     read
  residual_range_m        m     prediction − reading
  sigma_residual_range_m  m     its σ
  u_px                    px    spot
  v_px                    px    spot
  residual_u_px           px    prediction − observation
  residual_v_px           px    prediction − observation
  sigma_residual_u_px     px    its σ
  sigma_residual_v_px     px    its σ
  cov_residual_uv_px2     px²   covariance of both
  @xyz point_in_cam_
  cluster_z2              1     squared error that the shot's measurements share, in its σ
planes.
  name  text  photo
  nx    1     normal of the board in the camera
  ny    1     normal of the board in the camera
  nz    1     normal of the board in the camera
  d_m   m     distance of the plane from the camera
  @pose cam_from_board_
by_count.
  num_shots            count  the first so many
  sigma_origin_m       m      with them
  sigma_direction_rad  rad    with them
  bound_origin_m       m      with them
  bound_direction_rad  rad    with them
left_out.
  shot              count  predicted from the others
  residual_range_m  m      prediction − reading
  residual_u_px     px     prediction − observation
  residual_v_px     px     prediction − observation
grids:
next_shot.*  any  σ with one shot more, by distance and tilt of the board
files:
rangefinder.yaml  text  the beam with its covariance
)"},
                                {"plan rangefinder", R"(estimate:
@lens camera.
origin_m[3]    m     of the beam, in the camera
direction[3]   1     of the beam, in the camera
sigma_now_origin_m           m    now
sigma_now_direction_rad      rad  now
sigma_planned_origin_m       m    with the planned shots
sigma_planned_direction_rad  rad  with the planned shots
data:
next.
  distance_m           m    of the board
  tilt_rad             rad  of the board against the view
  azimuth_rad          rad  about the view
  sigma_origin_m       m    with that shot
  sigma_direction_rad  rad  with that shot
  spot_sigma_px        px   with that shot
  @pose cam_from_board_
points_in_board.
  @xyz -
)"},
                                {"project", R"(estimate:
px[2]               px  of the point
px_cov_px2[]        any  its covariance, row by row
point_in_cam_m[3]   m   where the range ends
point_in_world_m[3] m   of a rig: the point
M1[]                any projection matrix of the first head
M2[]                any projection matrix of the second head
point_cov_m2[]      any  its covariance, row by row
heads[]             any of a rig: the point in each camera
data:
@reading points.
files:
@reading points.csv.
)"},
                                {"simulate rangefinder", R"(estimate:
outliers[]  text  shots that are wrong
files:
shots.csv.
  range_m  m     read
  u        px    spot
  v        px    spot
  nx       1     normal of the board in the camera
  ny       1     normal of the board in the camera
  nz       1     normal of the board in the camera
  d        m     distance of the plane from the camera
  photo    text  whose
@corner-file corners.csv.
camera.yaml             text  the camera
truth_rangefinder.yaml  text  the true beam
)"}};
  return names;
}

}  // namespace alidade
