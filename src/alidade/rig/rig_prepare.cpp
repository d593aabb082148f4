#include <algorithm>
#include <cmath>
#include <limits>
#include <map>
#include <utility>

#include "alidade/geometry/degree.h"
#include "alidade/rig/ray_start.h"
#include "alidade/rig/rig_start.h"
#include "alidade/rig/rig_work.h"

namespace alidade {
namespace {

std::size_t index_of(std::vector<int>& known, int value) {
  const auto found = std::ranges::find(known, value);
  if (found != known.end()) return static_cast<std::size_t>(found - known.begin());
  known.push_back(value);
  return known.size() - 1;
}

std::string view_fault(const Work& work, const HeadView& view) {
  if (view.seen.corners.empty()) return "no corners of the board";
  return corners_fault(view.seen, static_cast<int>(work.problem.points_in_board.size()));
}

std::vector<std::optional<BoardPoseFit>> fitted_poses(const Work& work, std::span<const RigHead> heads) {
  std::vector<std::optional<BoardPoseFit>> poses(work.given.size());
  for (std::size_t v = 0; v < work.given.size(); ++v) {
    report_progress(work.progress, "views", v, work.given.size());
    if (work.usable[v])
      poses[v] = fit_board_pose(heads[work.problem.views[v].head].camera, work.given[v].seen,
                                work.problem.points_in_board, 1.0);
  }
  return poses;
}

/// σ of a corner that half of the views fit at least as well as; 0: no view determines it.
double sigma_of_poses(const std::vector<std::optional<BoardPoseFit>>& poses) {
  std::vector<double> variances;
  for (const auto& pose : poses) {
    if (!pose || pose->dof < 2) continue;
    // Median over mean of χ²: Wilson & Hilferty, 1931.
    variances.push_back(pose->chi2 / pose->dof / std::pow(1.0 - 2.0 / (9.0 * pose->dof), 3));
  }
  return std::sqrt(median_of(variances));
}

/// Which way the encoders count, of a head that sees single points only: what explains its best board best.
void choose_counting(const Work& work, std::size_t head, RigHead& rig_head) {
  double least = std::numeric_limits<double>::infinity();
  const RigHead nominal = rig_head;
  for (std::size_t board = 0; board < work.boards.size(); ++board) {
    for (const Eigen::Vector2d& scales : {Eigen::Vector2d(1.0, 1.0), Eigen::Vector2d(-1.0, 1.0),
                                          Eigen::Vector2d(1.0, -1.0), Eigen::Vector2d(-1.0, -1.0)}) {
      RigHead trial = nominal;
      trial.head.encoder.pan_scale = scales.x();
      trial.head.encoder.tilt_scale = scales.y();
      const auto seen = observation_pose(work.problem, work.usable, trial, head, board);
      if (seen && seen->misfit_rad < 0.999 * least) least = seen->misfit_rad, rig_head = trial;
    }
  }
}

/// Which way the axes of each head went, view after view.
class Travels {
 public:
  Eigen::Vector2d to(const HeadView& view) {
    constexpr double min_rad = 5e-3;  // less is a reading's noise: the axis stayed where it was
    const auto [last, is_first] = last_.try_emplace(view.head, view.pan_tilt_rad, Eigen::Vector2d::Zero());
    auto& [reading_rad, travel] = last->second;
    for (int axis = 0; axis < 2 && !is_first; ++axis) {
      const double by_rad = view.pan_tilt_rad[axis] - reading_rad[axis];
      if (std::abs(by_rad) > min_rad) travel[axis] = by_rad > 0.0 ? 0.5 : -0.5;
    }
    reading_rad = view.pan_tilt_rad;
    return travel;
  }

 private:
  std::map<int, std::pair<Eigen::Vector2d, Eigen::Vector2d>> last_;  ///< By head: reading, travel.
};

void count_cover(Work& work) {
  for (std::size_t h = 0; h < work.heads.size(); ++h) {
    HeadCover cover{.id = work.ids[h]};
    std::map<std::size_t, int> seen_boards;
    for (std::size_t v = 0; v < work.given.size(); ++v) {
      if (!work.usable[v] || work.problem.views[v].head != h) continue;
      const Eigen::Vector2d& angles = work.given[v].pan_tilt_rad;
      cover.lowest_rad = cover.num_views == 0 ? angles : Eigen::Vector2d(cover.lowest_rad.cwiseMin(angles));
      cover.highest_rad = cover.num_views == 0 ? angles : Eigen::Vector2d(cover.highest_rad.cwiseMax(angles));
      ++cover.num_views;
      ++seen_boards[work.problem.views[v].board];
    }
    cover.num_boards = static_cast<int>(seen_boards.size());
    for (const auto& [board, count] : seen_boards) {
      const bool is_shared = std::ranges::any_of(work.problem.views, [&, board = board](const RigView& view) {
        return view.board == board && view.head != h &&
               work.usable[static_cast<std::size_t>(&view - work.problem.views.data())];
      });
      cover.num_shared_boards += is_shared ? 1 : 0;
    }
    work.report.covers.push_back(cover);
  }
}

}  // namespace

void index_views(Work& work, const std::map<int, Camera>& cameras) {
  for (const auto& [id, camera] : cameras) {
    if (std::ranges::none_of(work.given, [id = id](const HeadView& view) { return view.head == id; })) continue;
    work.ids.push_back(id);
    work.heads.push_back({{}, camera});
    work.heads.back().head.id = id;
  }
  work.report.views.resize(work.given.size());
  Travels travels;
  for (std::size_t v = 0; v < work.given.size(); ++v) {
    const HeadView& view = work.given[v];
    const bool has_camera = cameras.contains(view.head);
    work.report.views[v].name = view.seen.photo.empty() ? "view " + std::to_string(v) : view.seen.photo;
    work.report.views[v].reason = view_fault(work, view);
    work.usable.push_back(has_camera && work.report.views[v].reason.empty());
    if (!has_camera) work.report.views[v].reason = "no camera of head " + std::to_string(view.head);
    const std::size_t head = has_camera ? index_of(work.ids, view.head) : 0;
    work.problem.views.push_back({&view, head, index_of(work.boards, view.board), travels.to(view)});
  }
}

void fit_poses(Work& work) {
  work.poses = fitted_poses(work, work.heads);
  const double given_px = sigma_of_poses(work.poses);
  work.report.sigma_px_is_estimated = !work.config.sigma_px && given_px > 0.0;
  work.report.sigma_px = work.config.sigma_px ? *work.config.sigma_px : given_px > 0.0 ? std::max(given_px, 1e-3) : 0.5;
  work.problem.sigma_px = work.report.sigma_px;
  constexpr double max_sigmas = 6.0;  // of one view's own residuals: blurred is not wrong, a wrong corner is
  for (std::size_t v = 0; v < work.given.size(); ++v) {
    if (!work.usable[v]) continue;
    const auto& pose = work.poses[v];
    // A view without a pose of its own is located by the others.
    if (pose && work.config.reject_outliers && pose->dof > 0 &&
        pose->chi2 / pose->dof > std::pow(max_sigmas * std::max(given_px, work.report.sigma_px), 2)) {
      work.usable[v] = false;
      work.report.views[v].reason = "its corners do not fit the board";
      work.poses[v].reset();
    }
  }
}

std::optional<int> mirrored_head(const Work& work) {
  const auto& points = work.problem.points_in_board;
  const bool is_flat = std::ranges::all_of(points, [](const Eigen::Vector3d& point) { return point.z() == 0.0; });
  for (std::size_t h = 0; is_flat && h < work.heads.size(); ++h) {
    std::size_t behind = 0, seen = 0;
    for (std::size_t v = 0; v < work.given.size(); ++v) {
      if (work.problem.views[v].head != h || !work.poses[v]) continue;
      ++seen;
      // z of the board points away from who sees its printed side.
      if (work.poses[v]->pose.cam_from_board.inverse().translation.z() > 0.0) ++behind;
    }
    if (2 * behind > seen) return work.ids[h];
  }
  return std::nullopt;
}

std::optional<Rigid3> half_turn_of(std::span<const Eigen::Vector3d> points_in_board) {
  if (points_in_board.size() < 3) return std::nullopt;
  const Eigen::Vector3d twice_centre = points_in_board.front() + points_in_board.back();
  for (std::size_t i = 0; i < points_in_board.size(); ++i) {
    const Eigen::Vector3d sum = points_in_board[i] + points_in_board[points_in_board.size() - 1 - i];
    if (points_in_board[i].z() != 0.0 || !((sum - twice_centre).norm() < 1e-9)) return std::nullopt;
  }
  return Rigid3{Eigen::Quaterniond(0.0, 0.0, 0.0, 1.0), twice_centre};
}

MountingStart mounting_of(const Work& work, std::size_t head, std::span<const HeadView> views, double unit_rad) {
  std::vector<TurnedView> turned;
  for (std::size_t v = 0; v < views.size(); ++v) {
    if (views[v].head != work.ids[head] || !work.usable[v] || !work.poses[v]) continue;
    turned.push_back(
        {views[v].pan_tilt_rad * unit_rad, work.poses[v]->pose.cam_from_board.rotation, work.problem.views[v].board});
  }
  return mounting_start(turned);
}

bool start_mountings(Work& work) {
  for (std::size_t h = 0; h < work.heads.size(); ++h) {
    const MountingStart mounting = mounting_of(work, h, work.given);
    if (mounting.misfit_rad > suspicious_misfit_rad &&
        mounting_of(work, h, work.given, degree).misfit_rad < clear_misfit * mounting.misfit_rad)
      return false;
    Head& head = work.heads[h].head;
    head.cam_from_tilt = mounting.cam_from_tilt;
    head.encoder.pan_scale = mounting.pan_scale;
    head.encoder.tilt_scale = mounting.tilt_scale;
    if (mounting.num_compared == 0) choose_counting(work, h, work.heads[h]);
  }
  return true;
}

/// The first head keeps its base; redundant parameters of a general head are fixed (docs/maths/pan-tilt-heads.md).
void choose_free(Work& work) {
  for (std::size_t h = 0; h < work.heads.size(); ++h) {
    std::vector<int> free;
    const auto add = [&free](int first, int count) {
      for (int i = 0; i < count; ++i) free.push_back(first + i);
    };
    if (h > 0) add(base_param, 6);
    add(pan_to_tilt_param + 2, 1);  // its z: what x and y do the base and tilt_to_cam do, too
    add(tilt_to_cam_param, 3);
    add(cam_rotation_param, 3);
    const RigConfig& config = work.config;
    if (config.estimate_scales) add(pan_scale_param, 2);
    if (config.estimate_skew) add(axes_skew_param, 1);
    if (config.estimate_once) add(pan_cos_param, 4);
    if (config.estimate_focal) free.push_back(focal_param);
    if (config.estimate_centre) free.insert(free.end(), {centre_x_param, centre_y_param});
    if (config.estimate_backlash) free.insert(free.end(), {pan_backlash_param, tilt_backlash_param});
    if (const auto more = work.freed.find(work.ids[h]); more != work.freed.end())
      free.insert(free.end(), more->second.begin(), more->second.end());
    std::ranges::sort(free);
    free.erase(std::unique(free.begin(), free.end()), free.end());
    work.problem.free.push_back(free);
  }
}

Work prepared_work(std::span<const HeadView> views, std::span<const Eigen::Vector3d> points_in_board,
                   const std::map<int, Camera>& cameras, const RigConfig& config, const FreedParams& freed,
                   const Progress& progress) {
  Work work{views, config, progress, freed, {}, {}, {}, {}, {}, {}, {}};
  work.problem.points_in_board = points_in_board;
  index_views(work, cameras);
  fit_poses(work);
  count_cover(work);
  return work;
}

}  // namespace alidade
