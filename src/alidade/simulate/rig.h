#pragma once

#include <array>
#include <cstdint>
#include <map>
#include <span>
#include <vector>

#include "alidade/board/board.h"
#include "alidade/geometry/rigid3.h"
#include "alidade/pantilt/head_view.h"
#include "alidade/pantilt/rig.h"

namespace alidade {

/// A world for `rig`: heads, placements of a board, and the angles from which each was observed. The world's frame is
/// that of the first head's camera at readings of zero.
struct RigScene {
  Rig rig;
  Board board;
  std::vector<Rigid3> world_from_board;
  std::vector<HeadView> views;  ///< The truth: angles and corners without noise.
};

struct RigSceneConfig {
  std::vector<RigHead> nominal;  ///< Drawn heads are near these; empty: the two heads of the paper.
  Board board{.cols = 9, .rows = 6, .square_m = 0.025};
  int num_boards = 5;
  std::vector<double> pans_rad, tilts_rad;  ///< Empty: −40 to 40° in 5 steps and −15 to 30° in 4 steps.
  double min_range_m = 0.7, max_range_m = 1.3;
  int max_views_of_a_board = 4;  ///< By one head, spread over those in which it is wholly in view.
  double mounting_sigma_rad = 0.04, offset_sigma_m = 0.02, base_sigma_rad = 0.05, base_sigma_m = 0.03;
  double skew_sigma_rad = 0.01;
  double encoder_scale = 1.0;       ///< True angle over reading, for each axis of each head.
  bool first_encoder_only = false;  ///< Only the first head has that scale; the others have 1.
  double once_rad = 0.0;            ///< Amplitude of an error with one period per revolution of an axis; random phase.
  bool shared = true;               ///< Each board is observed by all heads.
  double sigma_moved_m = 0.0;       ///< σ of each coordinate by which a board moves before the other heads' views.
  double print_stretch = 0.0;       ///< Relative excess of the columns' width over the rows'.
  double board_bend_m = 0.0;        ///< Distance of the board's ends from the plane at its centre.
};

/// Draws heads and boards. Boards that a head does not see at two pairs of angles at least are drawn again. Same seed,
/// same scene.
[[nodiscard]] RigScene draw_rig_scene(const RigSceneConfig& config, std::uint64_t seed);

struct RigNoise {
  double sigma_px = 0.2;
  double sigma_encoder_rad = 0.02 * 0.017453292519943295;
  double wrong_views = 0.0;       ///< Share of the views with the angles of another view.
  double twice_rad = 0.0;         ///< Amplitude of an error with two periods per revolution of an axis; random phase.
  double backlash_rad = 0.0;      ///< Per axis: readings are half of it too large after motion from below.
  double wrong_corners = 0.0;     ///< Share of the corners that are detected elsewhere, within
  double wrong_corner_px = 30.0;  ///< this distance in u and in v.
};
struct SimulatedViews {
  std::vector<HeadView> views;
  std::vector<bool> is_wrong;
};
[[nodiscard]] SimulatedViews simulate_head_views(const RigScene& scene, const RigNoise& noise, std::uint64_t seed);

/// Mistakes of a user, or unknown errors, in such a world.
struct RigMistake {
  double focal = 0.0;         ///< Relative excess of the camera files' focal lengths.
  double centre_px = 0.0;     ///< Error of their centres, in u and in v.
  bool swap_angles = false;   ///< Pan is in the column of tilt, and vice versa.
  bool flip_pan = false;      ///< Pan has the opposite sign.
  bool mirror = false;        ///< Images are mirrored.
  bool swap_heads = false;    ///< The heads' numbers are exchanged.
  bool shift_rows = false;    ///< Each view has the angles of the one before.
  double pan_read = 1.0;      ///< Factor on the second head's pan column: half, or twice.
  bool turn_corners = false;  ///< The second head's corners are numbered from the other end of the board.
};
[[nodiscard]] std::vector<HeadView> mistaken_views(std::vector<HeadView> views, const RigScene& scene,
                                                   const RigMistake& mistake);

}  // namespace alidade
