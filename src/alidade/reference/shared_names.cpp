#include "alidade/reference/name_tables.h"

namespace alidade {

const NameTables& shared_names() {
  static const NameTables names{{"@lens", R"(
model  text  pinhole, brown, kannala_brandt or flat_port
width  count  pixels of a row
height count  rows
fx     px     focal length along u
fy     px     focal length along v
cx     px     principal point, u
cy     px     principal point, v
skew   px     of the axes of the image
k1     1      radial distortion
k2     1      radial distortion
p1     1      tangential distortion
p2     1      tangential distortion
k3     1      radial distortion
k4     1      radial distortion (kannala_brandt)
gap_m    m    from the camera to the glass
glass_m  m    thickness of the glass
n_glass  1    its refractive index
n_water  1    refractive index of the water
normal[3] 1   of the glass, in the camera
normal_x  1   of it, as estimated
normal_y  1   of it, as estimated
)"},
                                {"@pose", R"(
x_m  m  position
y_m  m  position
z_m  m  position
qw   1  rotation
qx   1  rotation
qy   1  rotation
qz   1  rotation
)"},
                                {"@xyz", R"(
x_m  m  position
y_m  m  position
z_m  m  position
)"},
                                {"@direction", R"(
direction_x  1  unit vector
direction_y  1  unit vector
direction_z  1  unit vector
)"},
                                {"@cov", R"(
xx_m2  m²  covariance
xy_m2  m²  covariance
xz_m2  m²  covariance
yy_m2  m²  covariance
yz_m2  m²  covariance
zz_m2  m²  covariance
)"},
                                {"@sigma", R"(
design_effect         1  how much less the corners determine than if each erred by itself
shrinkage             1  share of the model's σ in the estimated one
inflation.*           1  σ over the model's, by parameter
degrees_of_freedom.*  1  of σ, by parameter
)"},
                                {"@board", R"(
kind        text   what is printed on it
cols        count  points of a row (markers: squares)
rows        count  rows
square_m    m      side of a square, or spacing
marker_m    m      side of a marker, or diameter
dictionary  text   of the markers
)"},
                                {"@intrinsics", R"(
fx_px  px  focal length along u
fy_px  px  focal length along v
cx_px  px  principal point, u
cy_px  px  principal point, v
)"},
                                {"@reading", R"(
range_m     m    read
u_px        px   its image
v_px        px   its image
cov_uu_px2  px²  covariance
cov_uv_px2  px²  covariance
cov_vv_px2  px²  covariance
@xyz point_in_cam_
@cov cov_
)"},
                                {"@corner-file", R"(
photo       text   whose
corner      count  number on the board, row by row
u_px        px     position
v_px        px     position
sigma_u_px  px     σ of u
sigma_v_px  px     σ of v
corr_uv     1      correlation of both
)"}};
  return names;
}

}  // namespace alidade
