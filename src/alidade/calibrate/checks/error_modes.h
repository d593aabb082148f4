#pragma once

#include <Eigen/Geometry>
#include <span>
#include <string>
#include <vector>

#include "alidade/camera/camera.h"

namespace alidade {

/// A departure from the grid, displacements of all points, from the lens model, those of all image points, or of rays
/// that do not meet in one point, displacements of what they show. Sizes: lengths a share, angle in rad, spacing [1/m],
/// of the lens and of tilt without unit (at unit focal length), of rays, motions and focus [m].
struct ErrorMode {
  enum class Kind {
    lengths,
    angle,
    spacing,
    radial,
    prism_x,
    prism_y,
    pupil,    ///< The entrance pupil moves along the axis with the angle to it, as of wide lenses and domes.
    plate_x,  ///< A plate before the lens, tilted about y.
    plate_y,
    motion_x,  ///< The board moves by the same in each photo while its rows are read.
    motion_y,
    motion_z,
    tilt,  ///< Corners are found off along the board's tilt, the more the nearer they are than its middle.
    focus  ///< The focal length follows the inverse distance of the board; lens_change() tests it.
  };
  Kind kind = Kind::spacing;
  Eigen::MatrixXd displacement = {};  ///< Of the print: 2 × points [m], of size 1.
  double largest_m = 0.0;             ///< Displacement of a point by size 1.

  [[nodiscard]] bool is_of_lens() const { return kind >= Kind::radial; }
  [[nodiscard]] bool is_of_rays() const { return kind >= Kind::pupil; }
  [[nodiscard]] bool is_of_motion() const { return kind >= Kind::motion_x && kind <= Kind::motion_z; }
  /// So nearly what a focal length does that only what it would do is known.
  [[nodiscard]] bool is_untested() const { return kind >= Kind::tilt; }
};

/// One of the rays, of motion, of corners or of focus that photos do not show, though it moves the lens by 5σ.
struct UnseenMode {
  ErrorMode::Kind kind = ErrorMode::Kind::pupil;
  double size = 0.0;       ///< From which on it moves a parameter by 5σ.
  Eigen::Index moved = 0;  ///< Which, of all of the lens.
};

/// A point of a board as a photo shows it, in the camera's frame.
struct SeenPoint {
  Eigen::Vector3d in_cam;
  double row = 0.0;        ///< Where it is read, over the image's height, from the middle.
  Eigen::Vector3d normal;  ///< Of the board.
  double middle_m = 0.0;   ///< Of the board's middle, along the axis.
};

/// Displacement in the image plane at unit focal length of what is seen at `point_in_cam`, by size 1: the radial term
/// that follows those of the model (pinhole k1, brown r⁹, kannala_brandt θ¹¹), or a thin prism, r².
[[nodiscard]] Eigen::Vector2d displacement_of(ErrorMode::Kind kind, const Lens& lens,
                                              const Eigen::Vector3d& point_in_cam);

/// Displacement [m, camera frame] of what is seen of a point against its ray, by size 1. A plate of thickness t,
/// refractive index n and tilt α moves points towards itself by t (1 − tan θ' / tan θ), of which what no pose does is
/// t (1 − 1/n²) / 2n · (θ² − 2 α θ_x) along the axis.
[[nodiscard]] Eigen::Vector3d displacement_in_cam(ErrorMode::Kind kind, const SeenPoint& point);

/// Of a print with these points; all are of size 1.
[[nodiscard]] std::vector<ErrorMode> error_modes(std::span<const Eigen::Vector3d> board_points);

/// What it ordinarily is, as a size: of a print, a lens (2 px at the image's corner), its rays and a hand.
[[nodiscard]] double ordinary_size(const ErrorMode& mode, const Camera& camera);

/// "the print is 0.12 ± 0.04 % too long …"; what to do about it, where it is none of the print.
[[nodiscard]] std::string sentence_of(const ErrorMode& mode, double size, double sigma);
[[nodiscard]] std::string remedy_of(const ErrorMode& mode);

}  // namespace alidade
