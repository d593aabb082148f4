#include <algorithm>
#include <utility>

#include "alidade/geometry/degree.h"
#include "alidade/rig/rig_work.h"

namespace alidade {
namespace {

using Status = RigReport::Status;

/// What a wrong camera looks like: encoders worse than any encoder, views that contradict each other.
bool is_suspicious(const RigReport& report) {
  constexpr double usual_rad = 0.3 * degree;
  if (report.status == Status::mirrored) return false;
  if (report.status != Status::converged)
    return report.status == Status::no_convergence || report.status == Status::degenerate;
  return report.sigma_encoder_rad > usual_rad || report.chi2_per_dof() > 2.0 ||
         5 * report.views_dropped > report.views_used;
}

/// Another reading of the same table, by which its views may agree.
struct Misreading {
  const char* words;
  std::vector<HeadView> views;
};

std::vector<Misreading> misreadings(std::span<const HeadView> views) {
  const std::vector<HeadView> given(views.begin(), views.end());
  std::vector<Misreading> all{{"pan and tilt are exchanged: the views agree with each in the other's column", given}};
  for (HeadView& view : all[0].views) view.pan_tilt_rad.reverseInPlace();
  for (const bool is_late : {true, false}) {
    Misreading& shifted = all.emplace_back(Misreading{
        is_late ? "the angles are those of the view before: the views agree with each row's angles one row earlier"
                : "the angles are those of the view after: the views agree with each row's angles one row later",
        given});
    for (std::size_t v = 0; v < given.size(); ++v)
      shifted.views[v].pan_tilt_rad = given[(v + (is_late ? 1 : given.size() - 1)) % given.size()].pan_tilt_rad;
  }
  return all;
}

/// Why views that contradict each other may do so: as they are read otherwise, they agree.
void look_for_misreading(std::span<const HeadView> views, std::span<const Eigen::Vector3d> points_in_board,
                         const std::map<int, Camera>& cameras, const RigConfig& config, const Progress& progress,
                         RigReport& report) {
  constexpr std::size_t min_views = 8;
  if (report.status == Status::degrees || report.status == Status::mirrored || views.size() < min_views) return;
  for (const Misreading& other : misreadings(views)) {
    const RigReport otherwise = calibrated_with(other.views, points_in_board, cameras, config, {}, progress);
    if (otherwise.status != Status::converged || is_suspicious(otherwise)) continue;
    report.status = Status::misread;
    report.misreading = other.words;
    return;
  }
}

}  // namespace

RigReport calibrate_rig(std::span<const HeadView> views, std::span<const Eigen::Vector3d> points_in_board,
                        const std::map<int, Camera>& cameras, const RigConfig& config, const Progress& progress) {
  RigReport report = calibrated_with(views, points_in_board, cameras, config, {}, progress);
  if (cameras.size() == 2 && is_suspicious(report)) {
    std::map<int, Camera> swapped = cameras;
    std::swap(swapped.begin()->second, swapped.rbegin()->second);
    const RigReport otherwise = calibrated_with(views, points_in_board, swapped, config, {}, progress);
    if (otherwise.status == Status::converged && !is_suspicious(otherwise)) report.status = Status::swapped;
  }
  const bool is_alone = report.status == Status::converged || report.status == Status::no_convergence ||
                        report.status == Status::degenerate;
  if (is_alone && is_suspicious(report)) look_for_misreading(views, points_in_board, cameras, config, progress, report);
  return report;
}

RigReport calibrate_rig_by_need(std::span<const HeadView> views, std::span<const Eigen::Vector3d> points_in_board,
                                const std::map<int, Camera>& cameras, const RigConfig& config,
                                const Progress& progress) {
  RigReport report = calibrate_rig(views, points_in_board, cameras, config, progress);
  if (report.status != Status::converged) return report;
  return freed_by_need(std::move(report), views, points_in_board, cameras, config, progress);
}

}  // namespace alidade
