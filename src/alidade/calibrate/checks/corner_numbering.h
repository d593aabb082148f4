#pragma once

#include <optional>
#include <span>
#include <string>
#include <vector>

#include "alidade/board/board.h"
#include "alidade/board/board_view.h"
#include "alidade/calibrate/calibrate.h"
#include "alidade/estimation/verdict.h"

namespace alidade {

/// Whether points [m, board frame] are within a tenth of their largest coordinate of the plane z = 0: points that are
/// not may also be seen from behind.
[[nodiscard]] bool is_nearly_flat(std::span<const Eigen::Vector3d> board_points);

/// For each view what is wrong with the numbering of its corners, or with its image; empty if nothing is wrong. Except
/// for distortion, a perspective of the board's plane maps the points to the corners (Hartley & Zisserman, §2.3):
/// faulty is a view far from any perspective that another numbering makes one, or the only view that fits none. The
/// view of a flat board from behind is a fault if most views are from the front. `board_points` [m]: by number, in the
/// board frame.
[[nodiscard]] std::vector<std::string> numbering_faults(const Board& board, std::span<const BoardView> views,
                                                        std::span<const Eigen::Vector3d> board_points);

/// Whether a view was rejected because its corners do not fit the other photos.
[[nodiscard]] bool is_misfit_reason(const std::string& reason);

/// Rejects used views whose corners fit the lens of all others only if the image is mirrored, or rotated by half a
/// turn, by name; the others are solved again. Several that are flipped alike are found together if the photos
/// disagree, and hardly do with these undone.
void reject_flipped_photos(const Board& board, ImageSize size, const CalibrateConfig& config,
                           std::vector<BoardView>& views, CalibrateReport& report);

/// Adds to the reason of such a view that its corners fit if the image is mirrored, or rotated by half a turn: a
/// rotated image moves the centre and p1, p2 to the other side, a mirrored one also exchanges left and right.
void name_flipped_photos(const Board& board, std::span<const BoardView> views, CalibrateReport& report);

/// What is to be said of several in use that were flipped alike, where none are rejected (OutlierRule::keep). Before
/// the board's shape is estimated, which would follow them.
[[nodiscard]] std::optional<Check> kept_flips(const Board& board, const CalibrateConfig& config,
                                              std::span<const BoardView> views, const CalibrateReport& report);

/// Names them in the verdict, which is State::bad: the stated lens is that of no photo.
void heed_kept_flips(const Check& check, Verdict& verdict);

/// Names in the verdict that more than a quarter of the photos were rejected so: it is of care at best.
void heed_flipped_photos(const CalibrateReport& report, Verdict& verdict);

}  // namespace alidade
