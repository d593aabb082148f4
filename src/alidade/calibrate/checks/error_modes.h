#pragma once

#include <Eigen/Geometry>
#include <span>
#include <string>
#include <vector>

#include "alidade/camera/camera.h"

namespace alidade {

/// A departure from the grid, displacements of all points, from the lens model, those of all image points, or of rays
/// that do not meet in one point, displacements of what they show. Sizes: lengths a share, angle in rad, spacing [1/m],
/// of the lens without unit (at unit focal length), of rays and motions [m].
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
    motion_z
  };
  Kind kind = Kind::spacing;
  Eigen::MatrixXd displacement = {};  ///< Of the print: 2 × points [m], of size 1.
  double largest_m = 0.0;             ///< Displacement of a point by size 1.

  [[nodiscard]] bool is_of_lens() const { return kind >= Kind::radial; }
  [[nodiscard]] bool is_of_rays() const { return kind >= Kind::pupil; }
  [[nodiscard]] bool is_of_motion() const { return kind >= Kind::motion_x; }
};

/// Displacement in the image plane at unit focal length of what is seen at `point_in_cam`, by size 1: the radial term
/// that follows those of the model (pinhole k1, brown r⁹, kannala_brandt θ¹¹), or a thin prism, r².
[[nodiscard]] Eigen::Vector2d displacement_of(ErrorMode::Kind kind, const Lens& lens,
                                              const Eigen::Vector3d& point_in_cam);

/// Displacement [m, camera frame] of what is seen at `point_in_cam` against its ray, by size 1 m; `row`: where it is
/// read, over the image's height, from the middle. A plate of thickness t, refractive index n and tilt α moves points
/// towards itself by t (1 − tan θ' / tan θ), of which what no pose does is t (1 − 1/n²) / 2n · (θ² − 2 α θ_x) along the
/// axis.
[[nodiscard]] Eigen::Vector3d displacement_in_cam(ErrorMode::Kind kind, const Eigen::Vector3d& point_in_cam,
                                                  double row);

/// Of a print with these points; all are of size 1.
[[nodiscard]] std::vector<ErrorMode> error_modes(std::span<const Eigen::Vector3d> board_points);

/// What it ordinarily is, as a size: of a print, a lens (2 px at the image's corner), its rays and a hand.
[[nodiscard]] double ordinary_size(const ErrorMode& mode, const Camera& camera);

/// "the print is 0.12 ± 0.04 % too long …"; what to do about it, where it is none of the print.
[[nodiscard]] std::string sentence_of(const ErrorMode& mode, double size, double sigma);
[[nodiscard]] std::string remedy_of(const ErrorMode& mode);

}  // namespace alidade
