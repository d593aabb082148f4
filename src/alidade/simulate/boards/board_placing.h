#pragma once

#include <vector>

#include "alidade/simulate/boards/board_photos.h"
#include "alidade/simulate/draws.h"

namespace alidade {

/// True points of a board that is bowed and scattered according to the config [m].
[[nodiscard]] std::vector<Eigen::Vector3d> draw_bent_points(const Board& board, const BoardSceneConfig& config,
                                                            Draws& draws);

/// Points [m] that must be in view for the board to be in view: the outline of the print, and the points.
[[nodiscard]] std::vector<Eigen::Vector3d> visible_outline(const BoardScene& scene);

/// Whether all points lie in the image, with a margin for the fit's pixels and the blur.
[[nodiscard]] bool sees_all(const Camera& camera, const Rigid3& cam_from_board,
                            const std::vector<Eigen::Vector3d>& points_in_board);

}  // namespace alidade
