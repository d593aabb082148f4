#include "alidade/calibrate/solve/columns.h"

#include <algorithm>
#include <limits>

#include "alidade/geometry/vector_clones.h"

namespace alidade {
namespace {

constexpr std::size_t lane = 4;  // doubles in one AVX register

/// The lens' inner loop input: everything a corner needs, as arrays of one length.
struct CornerArrays {
  const double *x, *y, *z;  // board point [m]
  const double *u, *v;      // seen [px]
  const double *white_a, *white_b, *white_c;
  std::size_t n = 0;
};

struct PoseNumbers {
  double r[9];  // row-major rotation
  double t[3];
};

PoseNumbers numbers(const Rigid3& cam_from_board) {
  PoseNumbers pose{};
  const Eigen::Matrix3d R = cam_from_board.rotation.toRotationMatrix();
  for (int i = 0; i < 3; ++i) {
    for (int j = 0; j < 3; ++j) pose.r[3 * i + j] = R(i, j);
    pose.t[i] = cam_from_board.translation[i];
  }
  return pose;
}

/// Brown's model over all corners of a view at once: no calls, no branches, so that it becomes vector code.
/// `J` is the first column's start, columns are `rows` apart, v rows begin at `half`. Returns the number of corners
/// with no projection.
ALIDADE_VECTOR_CLONES int brown_columns(const CornerArrays& in, const PoseNumbers& pose, const double* p,
                                        double max_radius2, double* __restrict J, std::size_t rows, std::size_t half) {
  const double fx = p[0], fy = p[1], cx = p[2], cy = p[3], skew = p[4];
  const double k1 = p[5], k2 = p[6], p1 = p[7], p2 = p[8], k3 = p[9];
  const double r00 = pose.r[0], r01 = pose.r[1], r02 = pose.r[2], r10 = pose.r[3], r11 = pose.r[4], r12 = pose.r[5],
               r20 = pose.r[6], r21 = pose.r[7], r22 = pose.r[8];
  const double tx = pose.t[0], ty = pose.t[1], tz = pose.t[2];
  double bad = 0.0;
  ALIDADE_NO_ALIASES
  for (std::size_t i = 0; i < in.n; ++i) {
    const double X = in.x[i], Y = in.y[i], Z = in.z[i];
    const double zc = r20 * X + r21 * Y + r22 * Z + tz;
    const double iz = 1.0 / zc;
    const double x = (r00 * X + r01 * Y + r02 * Z + tx) * iz;
    const double y = (r10 * X + r11 * Y + r12 * Z + ty) * iz;
    const double xx = x * x, yy = y * y, xy = x * y, r2 = xx + yy;
    const double L = 1.0 + r2 * (k1 + r2 * (k2 + r2 * k3));
    const double D = 2.0 * (k1 + r2 * (2.0 * k2 + 3.0 * k3 * r2));
    const double xd = L * x + 2.0 * p1 * xy + p2 * (r2 + 2.0 * xx);
    const double yd = L * y + p1 * (r2 + 2.0 * yy) + 2.0 * p2 * xy;
    const double j00 = L + D * xx + 2.0 * p1 * y + 6.0 * p2 * x;
    const double j01 = D * xy + 2.0 * p1 * x + 2.0 * p2 * y;
    const double j11 = L + D * yy + 6.0 * p1 * y + 2.0 * p2 * x;

    const double wa = in.white_a[i], wb = in.white_b[i], wc = in.white_c[i];
    const double outside = (zc > 0.0 ? 0.0 : 1.0) + (r2 < max_radius2 ? 0.0 : 1.0);
    bad = bad + (wc > 0.0 ? outside : 0.0);

    // Whitened rows of the affine part: u' = wa u + wb v, v' = wc v.
    const double fxa = wa * fx, fya = wc * fy, fyb = wb * fy, ska = wa * skew;
    const auto put = [&](int column, double du, double dv) {  // du, dv before A
      J[static_cast<std::size_t>(column) * rows + i] = fxa * du + (ska + fyb) * dv;
      J[static_cast<std::size_t>(column) * rows + half + i] = fya * dv;
    };
    J[i] = wa * xd;
    J[half + i] = 0.0;
    J[rows + i] = wb * yd;
    J[rows + half + i] = wc * yd;
    J[2 * rows + i] = wa;
    J[2 * rows + half + i] = 0.0;
    J[3 * rows + i] = wb;
    J[3 * rows + half + i] = wc;
    J[4 * rows + i] = wa * yd;
    J[4 * rows + half + i] = 0.0;
    put(5, x * r2, y * r2);
    put(6, x * r2 * r2, y * r2 * r2);
    put(7, 2.0 * xy, r2 + 2.0 * yy);
    put(8, r2 + 2.0 * xx, 2.0 * xy);
    put(9, x * r2 * r2 * r2, y * r2 * r2 * r2);

    const double m00 = fxa * j00 + (ska + fyb) * j01, m01 = fxa * j01 + (ska + fyb) * j11;
    const double m10 = fya * j01, m11 = fya * j11;
    const double gux = m00 * iz, guy = m01 * iz, guz = -(m00 * x + m01 * y) * iz;
    const double gvx = m10 * iz, gvy = m11 * iz, gvz = -(m10 * x + m11 * y) * iz;
    const double au0 = gux * r00 + guy * r10 + guz * r20, au1 = gux * r01 + guy * r11 + guz * r21,
                 au2 = gux * r02 + guy * r12 + guz * r22;
    const double av0 = gvx * r00 + gvy * r10 + gvz * r20, av1 = gvx * r01 + gvy * r11 + gvz * r21,
                 av2 = gvx * r02 + gvy * r12 + gvz * r22;
    double* __restrict pose_u = J + Columns::pose * rows + i;
    double* __restrict pose_v = pose_u + half;
    pose_u[0] = au0;
    pose_v[0] = av0;
    pose_u[rows] = au1;
    pose_v[rows] = av1;
    pose_u[2 * rows] = au2;
    pose_v[2 * rows] = av2;
    pose_u[3 * rows] = Y * au2 - Z * au1;  // X × a
    pose_v[3 * rows] = Y * av2 - Z * av1;
    pose_u[4 * rows] = Z * au0 - X * au2;
    pose_v[4 * rows] = Z * av0 - X * av2;
    pose_u[5 * rows] = X * au1 - Y * au0;
    pose_v[5 * rows] = X * av1 - Y * av0;

    const double ru = fx * xd + skew * yd + cx - in.u[i], rv = fy * yd + cy - in.v[i];
    J[Columns::residual * rows + i] = wa * ru + wb * rv;
    J[Columns::residual * rows + half + i] = wc * rv;
  }
  return bad > 0.0 ? 1 : 0;
}

/// Brown's residuals alone, u and v alternating; NaN where Brown::project has no answer.
ALIDADE_VECTOR_CLONES void brown_residuals(const CornerArrays& in, const PoseNumbers& pose, const double* p,
                                           double max_radius2, double* __restrict residuals) {
  const double fx = p[0], fy = p[1], cx = p[2], cy = p[3], skew = p[4];
  const double k1 = p[5], k2 = p[6], p1 = p[7], p2 = p[8], k3 = p[9];
  const PoseNumbers at = pose;
  const double nan = std::numeric_limits<double>::quiet_NaN();
  ALIDADE_NO_ALIASES
  for (std::size_t i = 0; i < in.n; ++i) {
    const double X = in.x[i], Y = in.y[i], Z = in.z[i];
    const double zc = at.r[6] * X + at.r[7] * Y + at.r[8] * Z + at.t[2];
    const double iz = 1.0 / zc;
    const double x = (at.r[0] * X + at.r[1] * Y + at.r[2] * Z + at.t[0]) * iz;
    const double y = (at.r[3] * X + at.r[4] * Y + at.r[5] * Z + at.t[1]) * iz;
    const double xx = x * x, yy = y * y, xy = x * y, r2 = xx + yy;
    const double L = 1.0 + r2 * (k1 + r2 * (k2 + r2 * k3));
    const double D = 2.0 * (k1 + r2 * (2.0 * k2 + 3.0 * k3 * r2));
    const double xd = L * x + 2.0 * p1 * xy + p2 * (r2 + 2.0 * xx);
    const double yd = L * y + p1 * (r2 + 2.0 * yy) + 2.0 * p2 * xy;
    const double j00 = L + D * xx + 2.0 * p1 * y + 6.0 * p2 * x;
    const double j01 = D * xy + 2.0 * p1 * x + 2.0 * p2 * y;
    const double j11 = L + D * yy + 6.0 * p1 * y + 2.0 * p2 * x;
    const double bad = (zc > 0.0 ? 0.0 : 1.0) + (r2 < max_radius2 ? 0.0 : 1.0) + (j00 * j11 > j01 * j01 ? 0.0 : 1.0);
    const double off = bad > 0.0 ? nan : 0.0;
    residuals[2 * i] = fx * xd + skew * yd + cx - in.u[i] + off;
    residuals[2 * i + 1] = fy * yd + cy - in.v[i] + off;
  }
}

/// Any other model, corner by corner.
template <class Model>
int model_columns(const Params<Model>& params, const CornerArrays& in, const Rigid3& cam_from_board, Columns& J) {
  const Eigen::Matrix3d R = cam_from_board.rotation.toRotationMatrix();
  const std::size_t half = J.stride();
  for (std::size_t i = 0; i < in.n; ++i) {
    Eigen::Matrix2d white;
    white << in.white_a[i], in.white_b[i], 0.0, in.white_c[i];
    const Eigen::Vector3d point_in_board(in.x[i], in.y[i], in.z[i]);
    const auto seen = Model::project_with_jacobians(params, R * point_in_board + cam_from_board.translation);
    if (!seen && in.white_c[i] > 0.0) return 1;
    const auto put = [&](int column, const Eigen::Vector2d& value) {
      J[column][i] = value.x();
      J[column][half + i] = value.y();
    };
    if (!seen) {
      for (int k = 0; k <= Columns::residual; ++k) put(k, Eigen::Vector2d::Zero());
      continue;
    }
    for (int k = 0; k < Model::num_params; ++k) put(k, white * seen->J_px_params.col(k));
    const Eigen::Matrix<double, 2, 3> by_point = white * seen->J_px_point * R;
    const Eigen::Matrix<double, 2, 3> by_rotation = -by_point * cross_matrix(point_in_board);
    for (int k = 0; k < 3; ++k) {
      put(Columns::pose + k, by_point.col(k));
      put(Columns::pose + 3 + k, by_rotation.col(k));
    }
    put(Columns::residual, white * (seen->px - Eigen::Vector2d(in.u[i], in.v[i])));
  }
  return 0;
}

ALIDADE_VECTOR_CLONES void loop_gram(const double* const* column, int m, std::size_t rows, double* product) {
  typedef double Lane __attribute__((vector_size(32), aligned(8)));
  for (int i = 0; i < m; i += 4) {
    for (int j = i; j < m; j += 2) {
      Lane s[8] = {};
      const double *a0 = column[i], *a1 = column[i + 1], *a2 = column[i + 2], *a3 = column[i + 3];
      const double *b0 = column[j], *b1 = column[j + 1];
      for (std::size_t r = 0; r < rows; r += lane) {
        const Lane x = *reinterpret_cast<const Lane*>(b0 + r), y = *reinterpret_cast<const Lane*>(b1 + r);
        const Lane c0 = *reinterpret_cast<const Lane*>(a0 + r), c1 = *reinterpret_cast<const Lane*>(a1 + r);
        const Lane c2 = *reinterpret_cast<const Lane*>(a2 + r), c3 = *reinterpret_cast<const Lane*>(a3 + r);
        s[0] += c0 * x;
        s[1] += c1 * x;
        s[2] += c2 * x;
        s[3] += c3 * x;
        s[4] += c0 * y;
        s[5] += c1 * y;
        s[6] += c2 * y;
        s[7] += c3 * y;
      }
      for (int k = 0; k < 8; ++k) {
        product[(i + k % 4) * m + j + k / 4] = (s[k][0] + s[k][1]) + (s[k][2] + s[k][3]);
      }
    }
  }
}

struct Gathered {
  std::vector<double> x, y, z;
};

/// The view's board points in the view's order.
const Gathered& gather(const PointArrays& points, const ViewArrays& view) {
  thread_local Gathered out;
  const std::size_t n = view.size();
  out.x.resize(n);
  out.y.resize(n);
  out.z.resize(n);
  for (std::size_t i = 0; i < n; ++i) {
    const auto k = static_cast<std::size_t>(view.index[i]);
    out.x[i] = points.x[k];
    out.y[i] = points.y[k];
    out.z[i] = points.z[k];
  }
  return out;
}

}  // namespace

PointArrays make_arrays(const std::vector<Eigen::Vector3d>& points) {
  PointArrays arrays;
  for (const Eigen::Vector3d& point : points) {
    arrays.x.push_back(point.x());
    arrays.y.push_back(point.y());
    arrays.z.push_back(point.z());
  }
  return arrays;
}

void Columns::resize(std::size_t num_corners) {
  const std::size_t stride = (num_corners + lane - 1) / lane * lane;
  if (num_corners == num_corners_ && stride == stride_) return;  // the padding is zero already
  num_corners_ = num_corners;
  stride_ = stride;
  data_.assign(static_cast<std::size_t>(count) * num_rows(), 0.0);
}

PreparedLens prepare(const Lens& lens) {
  PreparedLens prepared{lens, 0.0};
  if (const auto* brown = std::get_if<Calibrated<Brown>>(&lens)) {
    const double radius = Brown::max_radius(brown->params);
    prepared.max_radius2 = radius * radius;
  }
  return prepared;
}

std::vector<Eigen::Vector2d> residuals_px(const PreparedLens& lens, const Rigid3& cam_from_board,
                                          const PointArrays& points, const ViewArrays& view) {
  std::vector<Eigen::Vector2d> residuals(view.size());
  if (residuals.empty()) return residuals;
  const Gathered& at = gather(points, view);
  if (const auto* brown = std::get_if<Calibrated<Brown>>(&lens.lens)) {
    const CornerArrays in{at.x.data(), at.y.data(), at.z.data(), view.u_px.data(), view.v_px.data(),
                          nullptr,     nullptr,     nullptr,     view.size()};
    brown_residuals(in, numbers(cam_from_board), brown->params.data(), lens.max_radius2, residuals.front().data());
    return residuals;
  }
  Camera camera;
  camera.lens = lens.lens;
  std::vector<Eigen::Vector3d> points_in_cam;
  for (std::size_t i = 0; i < view.size(); ++i) {
    points_in_cam.push_back(cam_from_board * Eigen::Vector3d(at.x[i], at.y[i], at.z[i]));
  }
  const auto pixels = project(camera, points_in_cam);
  for (std::size_t i = 0; i < view.size(); ++i) {
    const Eigen::Vector2d nowhere = Eigen::Vector2d::Constant(std::numeric_limits<double>::quiet_NaN());
    residuals[i] = pixels[i] ? Eigen::Vector2d(*pixels[i] - Eigen::Vector2d(view.u_px[i], view.v_px[i])) : nowhere;
  }
  return residuals;
}

bool fill_columns(const PreparedLens& lens, const Rigid3& cam_from_board, const PointArrays& points,
                  const ViewArrays& view, Columns& columns) {
  columns.resize(view.size());
  const Gathered& at = gather(points, view);
  const CornerArrays in{at.x.data(),         at.y.data(),         at.z.data(),
                        view.u_px.data(),    view.v_px.data(),    view.white_a.data(),
                        view.white_b.data(), view.white_c.data(), view.size()};
  return std::visit(
      [&]<class Model>(const Calibrated<Model>& model) {
        if constexpr (std::is_same_v<Model, Brown>) {
          return brown_columns(in, numbers(cam_from_board), model.params.data(), lens.max_radius2, columns[0],
                               columns.num_rows(), columns.stride()) == 0;
        } else {
          return model_columns<Model>(model.params, in, cam_from_board, columns) == 0;
        }
      },
      lens.lens);
}

void fill_bow_columns(const ViewArrays& view, const std::vector<double>& along_x, const std::vector<double>& along_y,
                      Columns& columns) {
  const double* by_z = columns[Columns::pose + 2];  // derivative by the point's z in the board
  const std::size_t half = columns.stride();
  for (std::size_t i = 0; i < view.size(); ++i) {
    const auto k = static_cast<std::size_t>(view.index[i]);
    for (const std::size_t row : {i, half + i}) {
      columns[Columns::bow][row] = by_z[row] * along_x[k];
      columns[Columns::bow + 1][row] = by_z[row] * along_y[k];
    }
  }
}

void gram(const double* const* column, int m, std::size_t rows, double* product) {
  loop_gram(column, m, rows, product);
}

}  // namespace alidade
