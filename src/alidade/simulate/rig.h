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

/// A world for `rig`: heads, placements of a board, and the angles from which each was observed. The world is the first
/// head's camera at readings of zero.
struct RigScene {
  Rig rig;
  Board board;
  std::vector<Rigid3> world_from_board;
  std::vector<HeadView> views;  ///< True: angles without noise, corners where the lens puts them.
};

struct RigSceneConfig {
  std::vector<RigHead> nominal;  ///< Drawn heads are near these; empty: the paper's two.
  Board board{.cols = 9, .rows = 6, .square_m = 0.025};
  int num_boards = 5;
  std::vector<double> pans_rad, tilts_rad;  ///< Empty: −40 to 40° in 5 and −15 to 30° in 4.
  double min_range_m = 0.7, max_range_m = 1.3;
  int max_views_of_a_board = 4;  ///< By one head, spread over those that see it whole.
  double mounting_sigma_rad = 0.04, offset_sigma_m = 0.02, base_sigma_rad = 0.05, base_sigma_m = 0.03;
  double skew_sigma_rad = 0.01;
  double encoder_scale = 1.0;       ///< Radians of each axis of each head for each radian read.
  bool first_encoder_only = false;  ///< That scale is the first head's alone; the others' are 1.
  double once_rad = 0.0;            ///< Amplitude of an error of one period per turn of each axis, its phase drawn.
  bool shared = true;               ///< Each board is seen by all heads.
  double sigma_moved_m = 0.0;       ///< Of each coordinate by which a board is moved before the other heads' views.
  double print_stretch = 0.0;       ///< By how much wider columns are printed than rows.
  double board_bend_m = 0.0;        ///< By which the board's ends stand off its middle.
};

/// Draws heads and boards. Boards that some head does not see at two pairs of angles are drawn again. Same seed, same
/// scene.
[[nodiscard]] RigScene draw_rig_scene(const RigSceneConfig& config, std::uint64_t seed);

struct RigNoise {
  double sigma_px = 0.2;
  double sigma_encoder_rad = 0.02 * 0.017453292519943295;
  double wrong_views = 0.0;       ///< Share of the views whose angles are those of another view.
  double twice_rad = 0.0;         ///< Amplitude of an error of two periods per turn of each axis, its phase drawn.
  double backlash_rad = 0.0;      ///< Of each axis: readings are half of it too large where the axis came from below.
  double wrong_corners = 0.0;     ///< Share of the corners that are found elsewhere, by up to
  double wrong_corner_px = 30.0;  ///< so much in u and in v.
};
struct SimulatedViews {
  std::vector<HeadView> views;
  std::vector<bool> is_wrong;
};
[[nodiscard]] SimulatedViews simulate_head_views(const RigScene& scene, const RigNoise& noise, std::uint64_t seed);

/// What a user got wrong, or did not know, about such a world.
struct RigMistake {
  double focal = 0.0;         ///< Share by which the camera files' focal lengths are too long.
  double centre_px = 0.0;     ///< By which their centres lie aside, in u and in v.
  bool swap_angles = false;   ///< Pan is in the column of tilt.
  bool flip_pan = false;      ///< Pan counts the other way.
  bool mirror = false;        ///< Images are mirrored.
  bool swap_heads = false;    ///< The heads' numbers are exchanged.
  bool shift_rows = false;    ///< Each view has the angles of the one before.
  double pan_read = 1.0;      ///< What the second head's pan column has of its true angles: half, or twice.
  bool turn_corners = false;  ///< The second head's corners are numbered from the other end of the board.
};
[[nodiscard]] std::vector<HeadView> mistaken_views(std::vector<HeadView> views, const RigScene& scene,
                                                   const RigMistake& mistake);

}  // namespace alidade
