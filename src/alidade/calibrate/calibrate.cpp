#include "alidade/calibrate/calibrate.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>

#include "alidade/board/same_place.h"
#include "alidade/calibrate/checks/corner_numbering.h"
#include "alidade/calibrate/checks/lens_covariance.h"
#include "alidade/calibrate/checks/repeated_views.h"
#include "alidade/calibrate/far_corners.h"
#include "alidade/calibrate/setup.h"
#include "alidade/calibrate/solve/bundle.h"
#include "alidade/calibrate/solve/initial_lens.h"
#include "alidade/calibrate/solve/port.h"
#include "alidade/calibrate/solve/robust_solve.h"
#include "alidade/calibrate/solve/start.h"
#include "alidade/calibrate/solve/weights.h"

namespace alidade {
namespace {

/// Every view that would have been used says why it was not.
void refuse(CalibrateReport& report, std::string reason, std::string to_add) {
  report.status = CalibrateReport::Status::degenerate;
  for (ViewFit& view : report.views) {
    if (!view.used && view.reason.empty()) view.reason = "no camera: " + reason;
  }
  report.reason = std::move(reason);
  report.to_add = std::move(to_add);
}

/// Takes in every view with enough corners, once; the others are named.
void take_usable_views(const Board& board, std::span<const BoardView> views, CalibrateReport& report,
                       CalibrationWork& work) {
  constexpr std::size_t min_corners = 6;  // a pose takes 3; the rest must say something of the lens
  const auto repeats = repeated_views(views);
  const std::vector<std::string> misnumbered = numbering_faults(board, views, report.board_points);
  for (std::size_t k = 0; k < views.size(); ++k) {
    report.views[k].corners.resize(views[k].corners.size());
    if (repeats[k]) {
      report.views[k].reason = "is the same image as " + views[*repeats[k]].photo;
    } else if (views[k].corners.empty()) {
      report.views[k].reason = "no corners";
    } else if (views[k].corners.size() < min_corners) {
      report.views[k].reason = "only " + std::to_string(views[k].corners.size()) + " corners";
    } else if (!misnumbered[k].empty()) {
      report.views[k].reason = misnumbered[k];
    } else {
      work.number.push_back(k);
      work.views.push_back(views[k]);
      work.far.push_back(far_corners(views[k], report.board_points));
    }
  }
}

/// The lens from a few views, evenly chosen: enough to refine the whole set from. Poses of the others stay open.
std::optional<InitialLens> first_lens(const CalibrationWork& work, const std::vector<Eigen::Vector3d>& board_points,
                                      ImageSize size, const Lens& held) {
  constexpr std::size_t enough = 24;
  const std::size_t count = std::min(enough, work.views.size());
  std::vector<BoardView> chosen;
  for (std::size_t i = 0; i < count; ++i) {
    const std::size_t k = i * work.views.size() / count;
    chosen.push_back(work.far[k].empty() ? work.views[k] : without(work.views[k], work.far[k]));
  }
  auto found = initial_lens(chosen, board_points, size, held, work.problem);
  if (!found) return std::nullopt;
  std::vector<std::optional<Rigid3>> poses(work.views.size());
  for (std::size_t i = 0; i < count; ++i) poses[i * work.views.size() / count] = found->cam_from_board[i];
  return InitialLens{found->lens, std::move(poses)};
}

/// Poses of all views by the lens, those that are not `known`; a view without one is dropped and named.
void find_poses(const std::vector<std::optional<Rigid3>>& known, CalibrateReport& report, CalibrationWork& work,
                BundleState& state) {
  Camera camera;
  camera.lens = state.lens;
  const auto pose_of = [&](const BoardView& view) { return pose_from_plane(camera, view, state.board_points); };
  for (const std::optional<Rigid3>& start : known) {
    const std::size_t at = state.cam_from_board.size();
    const auto pose = start                  ? start
                      : work.far[at].empty() ? pose_of(work.views[at])
                                             : pose_of(without(work.views[at], work.far[at]));
    if (pose) {
      state.cam_from_board.push_back(*pose);
    } else {
      drop_view(at, "its corners do not form a board seen from the front", report, work, state);
    }
  }
}

/// RMS, noise and the corners' fates, from the final residuals.
void fill_views(const CalibrationWork& work, const BundleResult& result, const NoiseEstimate& noise,
                CalibrateReport& report) {
  double total = 0.0;
  for (std::size_t k = 0; k < work.views.size(); ++k) {
    ViewFit& fit = report.views[work.number[k]];
    fit.used = true;
    fit.cam_from_board = result.state.cam_from_board[k];
    const auto residuals = residuals_px(result.state, k, work.arrays[k]);
    double sum = 0.0, count = 0.0;
    for (std::size_t i = 0; i < residuals.size(); ++i) {
      fit.corners[i] = {residuals[i], noise.used[k][i]};
      if (!noise.used[k][i]) continue;
      sum += residuals[i].squaredNorm();
      count += 1.0;
    }
    fit.rms_px = std::sqrt(sum / std::max(1.0, count));
    total += sum;
    report.corners_used += static_cast<int>(count);
    report.corners_dropped += static_cast<int>(residuals.size()) - static_cast<int>(count);
  }
  report.num_parameters = num_parameters(work);
  const double dof = std::max(1.0, 2.0 * report.corners_used - report.num_parameters);
  report.rms_px = std::sqrt(total / std::max(1, report.corners_used));
  report.noise_px = std::sqrt(total / dof);
  report.excess_px = noise.excess_px;
}

/// Poses follow the lens with its stated covariance.
void fill_pose_covariances(const CalibrationWork& work, const BundleResult& result, double variance_scale,
                           const Eigen::MatrixXd& stated, CalibrateReport& report) {
  const std::vector<int>& free = work.problem.free_lens;
  const auto num_free = static_cast<Eigen::Index>(free.size());
  Eigen::MatrixXd cov = variance_scale * result.cov;
  cov.topLeftCorner(num_free, num_free) = stated(free, free);
  const auto covs = pose_covariances(result, variance_scale, cov);
  for (std::size_t k = 0; k < covs.size(); ++k) report.views[work.number[k]].pose_cov = covs[k];
}

/// Lens, poses and board shape with their covariances. The model's is in units of what the residuals say; what is
/// stated counts that the corners of a photo share errors: photos are its clusters.
void fill_estimate(const CalibrationWork& work, Minima& minima, const NoiseEstimate& noise, ImageSize size,
                   CalibrateReport& report) {
  const BundleResult& result = minima.least;
  const double variance_scale = variance_of(work, result, noise);
  report.camera.width_px = size.width_px;
  report.camera.height_px = size.height_px;
  report.camera.lens = result.state.lens;
  report.board_points = result.state.board_points;
  const auto num_params = params(result.state.lens).size();
  report.camera.cov = report.model_cov = Eigen::MatrixXd::Zero(num_params, num_params);
  if (result.cov.size() == 0) return;
  LensCovariance lens = lens_covariance(work.problem, variance_scale, minima.others, result);
  for (std::size_t k = 0; k < minima.others.size(); ++k)
    report.other_lenses.push_back({minima.others[k].state.lens, lens.weights[k]});
  fill_pose_covariances(work, result, variance_scale, lens.stated, report);
  report.model_cov = std::move(lens.model);
  report.camera.cov = std::move(lens.stated);
  report.clusters = std::move(lens.clusters);
  report.board_sigma_z_m = shape_sigma_z(work.problem, result.cov, variance_scale);
}

/// Refuses the first parameter with a σ that makes it no answer.
bool refuse_ungiven(const CalibrationWork& work, CalibrateReport& report) {
  const Eigen::VectorXd values = params(report.camera.lens);
  const auto names = param_names(report.camera.lens);
  for (const int at : work.problem.free_lens) {
    const std::string& name = names[static_cast<std::size_t>(at)];
    const double sigma = std::sqrt(report.model_cov(at, at));  // at best, from these views
    if (sigma <= largest_given_sigma(name, values[at], report.camera)) continue;
    if (at < 4) {
      refuse(
          report,
          name + " cannot be determined: its σ is " + std::to_string(static_cast<long>(std::min(sigma, 1e9))) + " px",
          "tilt the board 20–45° in several directions and fill the image");
    } else {
      refuse(report, name + " cannot be determined: its σ is " + std::to_string(sigma),
             "hold the board at several distances, near ones too, and at the image's edges, or hold " + name +
                 " with --fix");
    }
    return true;
  }
  return false;
}

/// For a solve that does not settle.
std::string what_may_be_wrong(const CalibrationWork& work) {
  for (std::size_t k = 0; k < work.views.size(); ++k) {
    const auto first = std::find(work.far[k].begin(), work.far[k].end(), true);
    if (first == work.far[k].end()) continue;
    const auto at = static_cast<std::size_t>(first - work.far[k].begin());
    return "correct " + work.views[k].photo + ", corner " + std::to_string(work.views[k].corners[at].index) +
           ", which lies far from the others, or reject it with --outliers drop";
  }
  return "check --board and --square, and look at the photos that fit worst";
}

/// Refuses where the answer is no answer: singular, or a parameter with a huge σ.
void judge(const CalibrationWork& work, const BundleResult& result, bool settled, CalibrateReport& report) {
  if (result.status == BundleResult::Status::singular) {
    refuse(report, "these photos leave free: " + name_combination(work.problem, report.camera.lens, result.weakest),
           "add photos with the board tilted 20–45° in several directions, or hold a parameter with --fix");
    return;
  }
  const bool has_cov = result.status == BundleResult::Status::converged;
  if (has_cov && refuse_ungiven(work, report)) return;
  const auto* port = std::get_if<Calibrated<FlatPort>>(&report.camera.lens);
  if (port && has_cov && port->params[10] < 0.0) {  // gap_m
    refuse(report,
           "gap_m comes out below zero, " + std::to_string(port->params[10]) + " with a σ of " +
               std::to_string(std::sqrt(report.camera.cov(10, 10))),
           "if the lens touches the glass, fix the gap: --gap 0 --fix gap_m; else check --glass and --n-water");
  } else if (!settled) {
    report.status = CalibrateReport::Status::no_convergence;
    report.reason = "the solve did not settle in " + std::to_string(report.iterations) + " iterations";
    report.to_add = what_may_be_wrong(work);
  } else {
    report.status = CalibrateReport::Status::converged;
  }
}

void refuse_few(const CalibrationWork& work, std::size_t least, CalibrateReport& report) {
  const auto numbered = std::find_if(report.views.begin(), report.views.end(),
                                     [](const ViewFit& view) { return view.reason.starts_with("its corners are"); });
  if (numbered != report.views.end()) {
    const auto count = std::count_if(report.views.begin(), report.views.end(),
                                     [&](const ViewFit& view) { return view.reason == numbered->reason; });
    refuse(report, fmt::format("of {} of {} photos: {}", count, report.views.size(), numbered->reason),
           "number the corners row by row, from the left, as --board counts them");
    return;
  }
  const auto any = [&](auto&& is) { return std::ranges::any_of(report.views, is, &ViewFit::reason); };
  const bool same = any([](const std::string& reason) { return reason.starts_with("is the same image"); });
  const bool repeated = any([](const std::string& reason) { return reason.ends_with("with the same errors"); });
  const char* const others = same ? " (others are the same image)" : repeated ? " (others repeat them)" : "";
  refuse(report,
         "only " + std::to_string(work.views.size()) + " usable photo" + (work.views.size() == 1 ? "" : "s") +
             " of the board" + others + "; it takes " + std::to_string(least),
         "add photos of the board, tilted 20–45° in several directions");
}

/// Whether no tilt tells the focal length from the distance. A port behind a known lens may be determined from parallel
/// boards: its σ will say.
bool boards_are_parallel(const CalibrationWork& work, const Lens& held, std::span<const Rigid3> cam_from_board) {
  constexpr double parallel_rad = 0.05;  // 3°: below it, tilt is what noise makes of it
  const bool lens_is_known = !is_central(held) && work.problem.free_lens.front() >= 4;
  return !lens_is_known && spread_of_normals_rad(cam_from_board) < parallel_rad;
}

/// Of photos that show the board at one place with the same errors the first is kept; the others are named.
bool drop_repeats(const BundleState& solved, CalibrateReport& report, CalibrationWork& work, BundleState& state) {
  std::vector<std::vector<Eigen::Vector2d>> residuals;
  for (std::size_t k = 0; k < work.views.size(); ++k) residuals.push_back(residuals_px(solved, k, work.arrays[k]));
  const auto repeats = views_with_shared_errors(work.views, residuals);
  state = solved;
  bool dropped = false;
  for (std::size_t k = repeats.size(); k-- > 0;) {
    if (!repeats[k]) continue;
    drop_view(k, "shows the board where " + work.views[*repeats[k]].photo + " does, with the same errors", report, work,
              state);
    dropped = true;
  }
  return dropped;
}

/// From an initial guess on.
void solve_all(const CalibrateConfig& config, ImageSize size, BundleState state, CalibrationWork& work,
               CalibrateReport& report) {
  make_all_arrays(config, work);
  NoiseEstimate noise;
  Minima minima = solve_robustly(config, size, std::move(state), report, work, noise);
  if (minima.settled && drop_repeats(minima.least.state, report, work, state)) {
    make_all_arrays(config, work);
    minima = solve_robustly(config, size, std::move(state), report, work, noise);
  }
  fill_estimate(work, minima, noise, size, report);
  fill_views(work, minima.least, noise, report);
  report.camera.rms_px = report.rms_px;
  const std::size_t least = min_views(config);
  if (work.views.size() < least)
    refuse_few(work, least, report);
  else
    judge(work, minima.least, minima.settled, report);
}

}  // namespace

bool rejects_outliers(const CalibrateConfig& config, bool have_covariances) {
  return config.outliers == OutlierRule::drop || (config.outliers == OutlierRule::automatic && have_covariances);
}

double shared_noise_px(const CalibrateReport& report) {
  return report.noise_px * std::sqrt(std::max(1.0, report.clusters.design_effect));
}

CalibrateReport calibrate(const Board& board, std::span<const BoardView> views, ImageSize size,
                          const CalibrateConfig& config, std::span<const Eigen::Vector3d> given_points) {
  CalibrateReport report;
  report.views.resize(views.size());
  report.board_points = config.board_shape == BoardShape::given
                            ? std::vector<Eigen::Vector3d>(given_points.begin(), given_points.end())
                            : points_in_board(board);
  report.camera.width_px = size.width_px;
  report.camera.height_px = size.height_px;
  CalibrationWork work;
  take_usable_views(board, views, report, work);
  const std::size_t least = min_views(config);
  if (work.views.size() < least) {
    refuse_few(work, least, report);
    return report;
  }
  const Lens held = set_up_problem(board, config, size, work.problem);
  work.use_covariances = have_covariances(work.views);

  BundleState state{held, {}, report.board_points};
  const auto start = first_lens(work, report.board_points, size, held);
  if (start) state.lens = start->lens;
  report.camera.lens = state.lens;
  if (start) find_poses(start->cam_from_board, report, work, state);
  if (!start || work.views.size() < least) {
    refuse_few(work, least, report);
    return report;
  }
  if (boards_are_parallel(work, held, state.cam_from_board)) {
    refuse(report, "all boards are parallel: the focal length cannot be determined from the distance",
           "tilt the board 20–45° in several directions");
    return report;
  }
  solve_all(config, size, std::move(state), work, report);
  return report;
}

}  // namespace alidade
