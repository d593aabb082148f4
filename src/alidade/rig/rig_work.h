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

/// The steps of calibrate_rig() before the solve, and the data that they pass on.
namespace alidade {

/// Everything on the way: what is estimated, and what the views are.
using FreedParams = std::map<int, std::vector<int>>;  ///< By id of the head: parameters beside what is always free.

/// Effort of a solve. A hypothesis is abandoned once it cannot be the one sought.
struct Effort {
  int iterations = 40;        ///< Per round.
  int unsettled_rounds = 99;  ///< Number of rounds without convergence after which it ends.
  double max_sigma_rad = std::numeric_limits<double>::infinity();  ///< Also ends it: a σ of a reading above this.
};

struct Work {
  std::span<const HeadView> given;
  const RigConfig& config;
  const Progress& progress;
  const FreedParams& freed;
  RigProblem problem;            ///< Its views: the given ones, in order.
  std::vector<int> ids, boards;  ///< By index.
  std::vector<RigHead> heads;
  std::vector<std::optional<BoardPoseFit>> poses;
  std::vector<bool> usable;
  RigReport report;
  double num_given = 0.0;  ///< Degrees of freedom from which σ of a reading was estimated; 0: given.
  Effort effort = {};
};

/// calibrate_rig() with these parameters estimated too. `sigma_free_scale`: prior σ of an encoder's scale that is
/// estimated; 0: none.
[[nodiscard]] RigReport calibrated_with(std::span<const HeadView> views,
                                        std::span<const Eigen::Vector3d> points_in_board,
                                        const std::map<int, Camera>& cameras, const RigConfig& config,
                                        const FreedParams& freed, const Progress& progress, const Effort& effort = {},
                                        double sigma_free_scale = 0.0);
/// Estimates the causes that the report's residuals indicate, one after another, as long as the views determine them.
[[nodiscard]] RigReport freed_by_need(RigReport report, std::span<const HeadView> views,
                                      std::span<const Eigen::Vector3d> points_in_board,
                                      const std::map<int, Camera>& cameras, const RigConfig& config,
                                      const Progress& progress);

/// Everything before the first solve: the views by index, their boards' poses, and what each head covers. Keeps
/// references to its arguments.
[[nodiscard]] Work prepared_work(std::span<const HeadView> views, std::span<const Eigen::Vector3d> points_in_board,
                                 const std::map<int, Camera>& cameras, const RigConfig& config,
                                 const FreedParams& freed, const Progress& progress);

/// Heads and boards by index; views without a camera or with corners not of the board are named and rejected.
void index_views(Work& work, const std::map<int, Camera>& cameras);
/// The pose of each view's board on its own, and from these σ of a corner.
void fit_poses(Work& work);
/// Id of a head that sees the printed side of flat boards from behind in most of its views: its images are
/// mirrored.
[[nodiscard]] std::optional<int> mirrored_head(const Work& work);
/// The symmetry that reverses the order of a board's points, the last becoming the first: half a revolution about its
/// centre. None: it has no such symmetry.
[[nodiscard]] std::optional<Rigid3> half_turn_of(std::span<const Eigen::Vector3d> points_in_board);
/// From the rotations of its boards only. `views`: those of the table, with the heads and readings to be used.
[[nodiscard]] MountingStart mounting_of(const Work& work, std::size_t head, std::span<const HeadView> views,
                                        double unit_rad = 1.0);
/// If another interpretation leaves at most this fraction of the disagreement, the rotations were misread.
inline constexpr double suspicious_misfit_rad = 3.0 * degree, clear_misfit = 0.3;
/// Mountings of all heads; false if the readings are degrees.
[[nodiscard]] bool start_mountings(Work& work);
/// Selects the parameters to estimate.
void choose_free(Work& work);

}  // namespace alidade
