#pragma once

#include <optional>
#include <string>

#include "alidade/board/board_view.h"
#include "alidade/camera/camera.h"
#include "alidade/geometry/rigid3.h"

namespace alidade {

/// How a board is held, as a person sees it in the picture.
struct HeldBoard {
  Eigen::Vector2d middle;  ///< Over the image's size: (0, 0) top left, (1, 1) bottom right.
  double size = 0.0;       ///< Of the board over the image.
  double top_away = 0.0;   ///< Tilt of its upper side away from the camera [rad].
  double left_away = 0.0;  ///< Of its left side.
};
[[nodiscard]] HeldBoard held_board(const Camera& camera, const std::vector<Eigen::Vector3d>& board_points,
                                   const Rigid3& cam_from_board);

/// "in the upper left corner": a place in the image, over its size.
[[nodiscard]] std::string place_of(const Eigen::Vector2d& middle);
/// "near, in the upper left corner, the top tilted away".
[[nodiscard]] std::string words_of(const HeldBoard& wanted, bool is_mirrored);
/// How to come from one to the other: "nearer; to the left; tilt the top away". "as outlined" where they are alike.
[[nodiscard]] std::string words_to(const HeldBoard& wanted, const HeldBoard& now, bool is_mirrored);

}  // namespace alidade
