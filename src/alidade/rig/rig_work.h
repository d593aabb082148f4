#pragma once

#include <limits>
#include <map>
#include <optional>
#include <span>
#include <vector>

#include "alidade/board/board_pose.h"
#include "alidade/estimation/median.h"
#include "alidade/geometry/degree.h"
#include "alidade/rig/rig.h"
#include "alidade/rig/rig_solve.h"
#include "alidade/rig/rig_start.h"

/// The steps of calibrate_rig() before the solve, and what they hand on.
namespace alidade {

/// Everything on the way: what is estimated, and what the views are.
using FreedParams = std::map<int, std::vector<int>>;  ///< By id of the head: parameters beside what is always free.

/// How long a solve is tried. A hypothesis is given up once it cannot be the one that is looked for.
struct Effort {
  int iterations = 40;                                             ///< Of each round.
  int unsettled_rounds = 99;                                       ///< So many rounds that do not converge end it.
  double max_sigma_rad = std::numeric_limits<double>::infinity();  ///< So does an estimated σ of a reading beyond it.
};

struct Work {
  std::span<const HeadView> given;
  const RigConfig& config;
  const Progress& progress;
  const FreedParams& freed;
  RigProblem problem;            ///< Its views: those given, in order.
  std::vector<int> ids, boards;  ///< By index.
  std::vector<RigHead> heads;
  std::vector<std::optional<BoardPoseFit>> poses;
  std::vector<bool> usable;
  RigReport report;
  double num_given = 0.0;  ///< Degrees of freedom by which σ of a reading was estimated; 0: given.
  Effort effort = {};
};

/// calibrate_rig() with these parameters estimated too. `sigma_free_scale`: what is known of an encoder's scale that is
/// estimated; 0: nothing.
[[nodiscard]] RigReport calibrated_with(std::span<const HeadView> views,
                                        std::span<const Eigen::Vector3d> points_in_board,
                                        const std::map<int, Camera>& cameras, const RigConfig& config,
                                        const FreedParams& freed, const Progress& progress, const Effort& effort = {},
                                        double sigma_free_scale = 0.0);
/// Causes indicated by the report's residuals, estimated too, one after another, as long as the views determine them.
[[nodiscard]] RigReport freed_by_need(RigReport report, std::span<const HeadView> views,
                                      std::span<const Eigen::Vector3d> points_in_board,
                                      const std::map<int, Camera>& cameras, const RigConfig& config,
                                      const Progress& progress);

/// Everything before the first solve: the views by index, their boards' poses, and what each head covers. Keeps
/// references to what it is given.
[[nodiscard]] Work prepared_work(std::span<const HeadView> views, std::span<const Eigen::Vector3d> points_in_board,
                                 const std::map<int, Camera>& cameras, const RigConfig& config,
                                 const FreedParams& freed, const Progress& progress);

/// Heads and boards by index; views without a camera or corners of the board are named and rejected.
void index_views(Work& work, const std::map<int, Camera>& cameras);
/// The pose of the board of each view by itself, and with them σ of a corner.
void fit_poses(Work& work);
/// The id of a head that sees the printed side of flat boards from behind in most of its views: its images are
/// mirrored.
[[nodiscard]] std::optional<int> mirrored_head(const Work& work);
/// By which a board's points come to stand in reverse order, the last where the first was: half a turn about its
/// centre. None: it has no such symmetry.
[[nodiscard]] std::optional<Rigid3> half_turn_of(std::span<const Eigen::Vector3d> points_in_board);
/// By the rotations of its boards alone. `views`: those of the table, with heads and readings as they are to be taken.
[[nodiscard]] MountingStart mounting_of(const Work& work, std::size_t head, std::span<const HeadView> views,
                                        double unit_rad = 1.0);
/// Rotations that agree no better than this were read otherwise than meant if another reading leaves this share of it.
inline constexpr double suspicious_misfit_rad = 3.0 * degree, clear_misfit = 0.3;
/// Mountings of all heads; false where the readings are degrees.
[[nodiscard]] bool start_mountings(Work& work);
/// Which parameters are estimated.
void choose_free(Work& work);

}  // namespace alidade
