#pragma once

#include <vector>

#include "alidade/simulate/boards/board_photos.h"
#include "alidade/simulate/draws.h"

namespace alidade {

/// True points of a board that is bowed and scattered as the config says [m].
[[nodiscard]] std::vector<Eigen::Vector3d> draw_bent_points(const Board& board, const BoardSceneConfig& config,
                                                            Draws& draws);

/// Points [m] whose visibility makes the board visible: the outline of what is printed, and the points.
[[nodiscard]] std::vector<Eigen::Vector3d> visible_outline(const BoardScene& scene);

/// Whether all points lie in the image, with room for the fit's pixels and the blur.
[[nodiscard]] bool sees_all(const Camera& camera, const Rigid3& cam_from_board,
                            const std::vector<Eigen::Vector3d>& points_in_board);

}  // namespace alidade
