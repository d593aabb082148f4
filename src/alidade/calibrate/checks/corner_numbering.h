#pragma once

#include <span>
#include <string>
#include <vector>

#include "alidade/board/board.h"
#include "alidade/board/board_view.h"
#include "alidade/calibrate/calibrate.h"

namespace alidade {

/// Whether points [m, board frame] are within a tenth of their largest coordinate of the plane z = 0: from behind
/// others may be seen as well.
[[nodiscard]] bool is_nearly_flat(std::span<const Eigen::Vector3d> board_points);

/// For each view what is wrong with how its corners are numbered, or with its image; empty where nothing is. A
/// perspective of the plane of the board takes the points to the corners but for distortion (Hartley & Zisserman,
/// §2.3): far from one is a view that another numbering brings to one, or that alone of all is in none. The view of a
/// board from behind is a fault where most views are from the front, of a board that is flat. `board_points` [m]: by
/// number, in the board frame.
[[nodiscard]] std::vector<std::string> numbering_faults(const Board& board, std::span<const BoardView> views,
                                                        std::span<const Eigen::Vector3d> board_points);

/// Whether a view was rejected as its corners do not fit the other photos.
[[nodiscard]] bool is_misfit_reason(const std::string& reason);

/// Rejects views in use whose corners fit the lens of all others only once the image is mirrored, or rotated by half a
/// turn, by name; solved without them.
void reject_flipped_photos(const Board& board, ImageSize size, const CalibrateConfig& config,
                           std::vector<BoardView>& views, CalibrateReport& report);

/// Says in the reason of such a view where its corners fit once the image is mirrored, or rotated by half a turn: a
/// rotated image puts the centre and p1, p2 on the other side, a mirrored one exchanges left and right as well.
void name_flipped_photos(const Board& board, std::span<const BoardView> views, CalibrateReport& report);

}  // namespace alidade
