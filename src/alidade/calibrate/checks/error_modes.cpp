#include "alidade/calibrate/checks/error_modes.h"

#include <algorithm>
#include <cmath>

#include "alidade/estimation/verdict.h"

namespace alidade {
namespace {

using Eigen::Index;
using Eigen::MatrixXd;

/// In coordinates about the board's centre, 1 at the ends of its longer side.
std::vector<ErrorMode> print_modes(std::span<const Eigen::Vector3d> points) {
  const auto num = static_cast<Index>(points.size());
  MatrixXd q(2, num);
  for (Index i = 0; i < num; ++i) q.col(i) = points[static_cast<std::size_t>(i)].head<2>();
  const Eigen::Vector2d low = q.rowwise().minCoeff(), high = q.rowwise().maxCoeff();
  const double half = 0.5 * (high - low).maxCoeff();
  q = (q.colwise() - 0.5 * (low + high)) / half;
  const auto x = q.row(0).array(), y = q.row(1).array();
  std::vector<ErrorMode> modes(8);
  for (ErrorMode& mode : modes) mode.displacement = MatrixXd::Zero(2, num);
  modes[0].kind = ErrorMode::Kind::lengths;
  modes[0].displacement << 0.5 * x.matrix(), -0.5 * y.matrix();
  modes[1].kind = ErrorMode::Kind::angle;
  modes[1].displacement << 0.5 * y.matrix(), 0.5 * x.matrix();
  for (Index row = 0; row < 2; ++row) {
    modes[static_cast<std::size_t>(2 + row)].displacement.row(row) = x.square();
    modes[static_cast<std::size_t>(4 + row)].displacement.row(row) = x * y;
    modes[static_cast<std::size_t>(6 + row)].displacement.row(row) = y.square();
  }
  for (ErrorMode& mode : modes) {
    mode.displacement *= half;
    mode.largest_m = mode.displacement.colwise().norm().maxCoeff();
  }
  return modes;
}

}  // namespace

Eigen::Vector2d displacement_of(ErrorMode::Kind kind, const Lens& lens, const Eigen::Vector3d& point_in_cam) {
  Eigen::Vector2d at = point_in_cam.head<2>() / point_in_cam.z();
  double power = std::holds_alternative<Calibrated<Pinhole>>(lens) ? 2.0 : 8.0;
  if (std::holds_alternative<Calibrated<KannalaBrandt>>(lens)) {
    const double radius = point_in_cam.head<2>().norm();
    at = point_in_cam.head<2>() / std::max(radius, 1e-12) * std::atan2(radius, point_in_cam.z());
    power = 10.0;
  }
  if (kind == ErrorMode::Kind::prism_x) return {at.squaredNorm(), 0.0};
  if (kind == ErrorMode::Kind::prism_y) return {0.0, at.squaredNorm()};
  return at * std::pow(at.norm(), power);
}

Eigen::Vector3d displacement_in_cam(ErrorMode::Kind kind, const SeenPoint& point) {
  const Eigen::Vector3d axis = Eigen::Vector3d::UnitZ();
  const double z = point.in_cam.z(), angle = std::atan2(point.in_cam.head<2>().norm(), z);
  switch (kind) {
    case ErrorMode::Kind::focus:
      return Eigen::Vector3d(point.in_cam.x(), point.in_cam.y(), 0.0) / point.middle_m;
    case ErrorMode::Kind::tilt:
      return (point.middle_m - z) * Eigen::Vector3d(point.normal.x(), point.normal.y(), 0.0);
    case ErrorMode::Kind::pupil:
      return -angle * angle * axis;
    case ErrorMode::Kind::plate_x:
    case ErrorMode::Kind::plate_y:
      return point.in_cam.normalized()[kind == ErrorMode::Kind::plate_x ? 0 : 1] * axis;
    default:
      return point.row *
             Eigen::Vector3d::Unit(static_cast<Index>(kind) - static_cast<Index>(ErrorMode::Kind::motion_x));
  }
}

std::vector<ErrorMode> error_modes(std::span<const Eigen::Vector3d> board_points) {
  std::vector<ErrorMode> modes = print_modes(board_points);
  for (auto kind = static_cast<Index>(ErrorMode::Kind::radial); kind <= static_cast<Index>(ErrorMode::Kind::focus);
       ++kind)
    modes.push_back({.kind = static_cast<ErrorMode::Kind>(kind)});
  return modes;
}

double ordinary_size(const ErrorMode& mode, const Camera& camera) {
  constexpr double lengths = 2e-3, spacing_m = 1e-4, corner_share = 1.6e-3, pupil_m = 2e-3, plate_m = 5e-4,
                   motion_m = 5e-4, tilt_px = 0.1, focus_m = 4e-3;
  if (!mode.is_of_lens()) return mode.kind == ErrorMode::Kind::spacing ? spacing_m / mode.largest_m : lengths;
  if (mode.is_of_motion()) return motion_m;
  if (mode.kind == ErrorMode::Kind::focus) return focus_m;
  const Eigen::VectorXd of_lens = params(camera.lens);
  const double focal_px = std::sqrt(of_lens[0] * of_lens[1]);
  if (mode.kind == ErrorMode::Kind::tilt) return tilt_px / (0.1 * std::sqrt(0.5) * focal_px);  // 45°, 10 % nearer
  if (mode.is_of_rays()) return mode.kind == ErrorMode::Kind::pupil ? pupil_m : plate_m;
  const Eigen::Vector2d corner_px(0.5 * camera.width_px, 0.5 * camera.height_px);
  const Eigen::Vector3d corner = (corner_px / focal_px).homogeneous();
  // Of the image's diagonal: 2 px of 1000x750.
  return corner_share * 2.0 * corner_px.norm() / (focal_px * displacement_of(mode.kind, camera.lens, corner).norm());
}

std::string sentence_of(const ErrorMode& mode, double size, double sigma) {
  const auto sized = [](double unit, double value) { return text_of(unit * std::abs(value), 2); };
  const double error = 3.0 * sigma;
  const std::string sigmas = " (" + text_of(std::abs(size) / sigma, 2) + "σ)";
  switch (mode.kind) {
    case ErrorMode::Kind::lengths:
      return std::string("the print is ") + sized(100.0, size) + " ± " + sized(100.0, error) + " % too long " +
             (size > 0.0 ? "along its rows" : "along its columns") + ", against its other side";
    case ErrorMode::Kind::angle:
      return "the print's rows and columns are " + sized(1e3, size) + " ± " + sized(1e3, error) +
             " mrad off a right angle";
    case ErrorMode::Kind::spacing:
      return "the print's spacing is uneven, by up to " + sized(1e3 * mode.largest_m, size) + " ± " +
             sized(1e3 * mode.largest_m, error) + " mm";
    case ErrorMode::Kind::radial:
      return "the lens has radial distortion of a higher order than its model" + sigmas;
    case ErrorMode::Kind::prism_x:
    case ErrorMode::Kind::prism_y:
      return "the lens has thin-prism distortion, which its model has not" + sigmas;
    case ErrorMode::Kind::pupil:
      return "rays do not meet in one point: the entrance pupil moves along the axis by " + sized(1e3, size) + " ± " +
             sized(1e3, error) + " mm · θ², as of a wide lens near the board, a dome or a plate";
    case ErrorMode::Kind::plate_x:
    case ErrorMode::Kind::plate_y:
      // Rows are read along y: what a plate tilted about x does to near boards is nearly what that motion does.
      return std::string("rays do not meet in one point, as behind a tilted plate or window") +
             (mode.kind == ErrorMode::Kind::plate_y ? ", or with a rolling shutter and boards that approach" : "") +
             sigmas;
    case ErrorMode::Kind::motion_x:
    case ErrorMode::Kind::motion_y:
    case ErrorMode::Kind::motion_z:
      return "in all photos the board moves by " + sized(1e3, size) + " ± " + sized(1e3, error) + " mm " +
             (mode.kind == ErrorMode::Kind::motion_z   ? "along the axis"
              : mode.kind == ErrorMode::Kind::motion_x ? "along the rows"
                                                       : "along the columns") +
             " while its rows are read (rolling shutter)";
    case ErrorMode::Kind::tilt:
    case ErrorMode::Kind::focus:
      break;
  }
  return "";
}

std::string remedy_of(const ErrorMode& mode) {
  if (mode.is_of_motion()) return "hold board and camera still for each photo, or move them in all directions alike";
  if (mode.is_of_rays())
    return "take photos from the distances at which the camera is used: there the rays are as these photos have them";
  if (mode.is_of_lens())
    return "no lens model here has this term: cover with boards all of the image that is used, and use no more of it";
  return "";
}

}  // namespace alidade
