#pragma once

#include <Eigen/Core>

#include "alidade/localize/localization.h"

namespace alidade {

/// Derivative of a position, at that offset from the centre, with respect to a similarity of the world: translation
/// [m], rotation [rad], relative scale.
[[nodiscard]] Eigen::Matrix<double, 3, 7> similarity_moves(const Eigen::Vector3d& away);

/// The same error, expressed about another centre.
[[nodiscard]] SavedFrame about_centre(const SavedFrame& frame, const Eigen::Vector3d& centre);

/// The frame of a map whose unit is multiplied by `scale`, with relative σ `sigma_rel`, about the origin.
[[nodiscard]] SavedFrame scaled_frame(SavedFrame frame, double scale, double sigma_rel);

/// For a path and map in the frame of an earlier map: adds the error of that frame, common to all.
void widen_by_frame(const SavedFrame& frame, Localization& result);

}  // namespace alidade
