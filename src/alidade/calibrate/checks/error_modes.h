#pragma once

#include <Eigen/Geometry>
#include <span>
#include <string>
#include <vector>

#include "alidade/camera/camera.h"

namespace alidade {

/// A deviation from the grid (displacements of all points), from the lens model (of all image points), or from rays
/// through one point (displacements of what they show). Sizes: lengths relative, angle in rad, spacing [1/m],
/// lens and tilt dimensionless (at unit focal length), rays, motions and focus [m].
struct ErrorMode {
  enum class Kind {
    lengths,
    angle,
    spacing,
    radial,
    prism_x,
    prism_y,
    pupil,    ///< The entrance pupil moves along the axis with the field angle, as in wide-angle lenses and domes.
    plate_x,  ///< A plate in front of the lens, tilted about y.
    plate_y,
    motion_x,  ///< The board moves equally in each photo while its rows are read.
    motion_y,
    motion_z,
    tilt,  ///< Corners are displaced along the board's tilt, the more the nearer they are than its centre.
    focus  ///< The focal length depends on the inverse distance of the board; tested by lens_change().
  };
  Kind kind = Kind::spacing;
  Eigen::MatrixXd displacement = {};  ///< Of the print: 2 × points [m], for size 1.
  double largest_m = 0.0;             ///< Largest displacement of a point for size 1.

  [[nodiscard]] bool is_of_lens() const { return kind >= Kind::radial; }
  [[nodiscard]] bool is_of_rays() const { return kind >= Kind::pupil; }
  [[nodiscard]] bool is_of_motion() const { return kind >= Kind::motion_x && kind <= Kind::motion_z; }
  /// Nearly indistinguishable from a focal length: only its effect is known, not whether it is present.
  [[nodiscard]] bool is_untested() const { return kind >= Kind::tilt; }
};

/// A mode of rays, motion, corners or focus that the photos do not reveal although it moves the lens by 5σ.
struct UnseenMode {
  ErrorMode::Kind kind = ErrorMode::Kind::pupil;
  double size = 0.0;       ///< Smallest size that moves a parameter by 5σ.
  Eigen::Index moved = 0;  ///< Index of that parameter, among all of the lens.
};

/// A board point as seen in a photo, in the camera frame.
struct SeenPoint {
  Eigen::Vector3d in_cam;
  double row = 0.0;        ///< Image row relative to the image height, from the centre.
  Eigen::Vector3d normal;  ///< Normal of the board.
  double middle_m = 0.0;   ///< Depth of the board's centre, along the optical axis.
};

/// Displacement in the image plane at unit focal length of the image of `point_in_cam`, for size 1: the next radial
/// term after those of the model (pinhole k1, brown r⁹, kannala_brandt θ¹¹), or a thin prism, r².
[[nodiscard]] Eigen::Vector2d displacement_of(ErrorMode::Kind kind, const Lens& lens,
                                              const Eigen::Vector3d& point_in_cam);

/// Displacement [m, camera frame] of the observed point relative to its ray, for size 1. A plate of thickness t,
/// refractive index n and tilt α moves points towards itself by t (1 − tan θ' / tan θ); the part of it that no pose
/// absorbs is t (1 − 1/n²) / 2n · (θ² − 2 α θ_x) along the axis.
[[nodiscard]] Eigen::Vector3d displacement_in_cam(ErrorMode::Kind kind, const SeenPoint& point);

/// The modes of a print with these points; all of size 1.
[[nodiscard]] std::vector<ErrorMode> error_modes(std::span<const Eigen::Vector3d> board_points);

/// Typical size of a mode: of prints, lenses (2 px in the image corner), rays and handheld motion.
[[nodiscard]] double ordinary_size(const ErrorMode& mode, const Camera& camera);

/// "the print is 0.12 ± 0.04 % too long …"; and what to do about it, if it is not an error of the print.
[[nodiscard]] std::string sentence_of(const ErrorMode& mode, double size, double sigma);
[[nodiscard]] std::string remedy_of(const ErrorMode& mode);

}  // namespace alidade
