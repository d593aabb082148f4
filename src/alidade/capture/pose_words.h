#pragma once

#include <optional>
#include <string>

#include "alidade/board/board_view.h"
#include "alidade/camera/camera.h"
#include "alidade/geometry/rigid3.h"

namespace alidade {

/// How a board is held, as a person sees it in the image.
struct BoardInImage {
  Eigen::Vector2d centre;  ///< Over the image's size: (0, 0) top left, (1, 1) bottom right.
  double size = 0.0;       ///< Of the board over the image.
  double top_away = 0.0;   ///< Tilt of its upper side away from the camera [rad].
  double left_away = 0.0;  ///< Of its left side.
};
[[nodiscard]] BoardInImage board_in_image(const Camera& camera, const std::vector<Eigen::Vector3d>& board_points,
                                          const Rigid3& cam_from_board);

/// "in the upper left corner": a position in the image, over its size.
[[nodiscard]] std::string position_words(const Eigen::Vector2d& centre);
/// "near, in the upper left corner, the top tilted away".
[[nodiscard]] std::string words_of(const BoardInImage& wanted, bool is_mirrored);
/// How to come from one to the other: "nearer; to the left; tilt the top away". "as outlined" where they are alike.
[[nodiscard]] std::string words_to(const BoardInImage& wanted, const BoardInImage& now, bool is_mirrored);

}  // namespace alidade
