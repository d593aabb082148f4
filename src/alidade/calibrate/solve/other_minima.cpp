#include "alidade/calibrate/solve/other_minima.h"

#include <algorithm>
#include <array>
#include <cmath>

#include "alidade/calibrate/solve/start.h"

namespace alidade {
namespace {

constexpr std::array<int, 2> centre{2, 3};  // cx and cy, of every lens

bool is_vague(const BundleProblem& problem, const BundleResult& found, double noise_variance, int width_px) {
  if (found.cov.size() == 0 || !is_central(found.state.lens)) return false;
  constexpr double vague = 0.01;  // of the width; a dozen photos of a wide lens reach a tenth of it
  double most = 0.0;
  for (const int parameter : centre) {
    const auto at = std::find(problem.free_lens.begin(), problem.free_lens.end(), parameter);
    if (at == problem.free_lens.end()) return false;
    const auto i = static_cast<Eigen::Index>(at - problem.free_lens.begin());
    most = std::max(most, std::sqrt(noise_variance * found.cov(i, i)));
  }
  return most > vague * width_px;
}

/// The lens with its principal point moved, and what else is free, but for the focal lengths, as before any photo.
Lens moved(const BundleProblem& problem, const Lens& lens, double du_px, double dv_px) {
  Eigen::VectorXd values = params(lens);
  for (const int parameter : problem.free_lens) {
    if (parameter > centre[1])
      values[parameter] = problem.prior_information[parameter] > 0.0 ? problem.prior_value[parameter] : 0.0;
  }
  values[centre[0]] += du_px;
  values[centre[1]] += dv_px;
  return with_params(lens, values);
}

bool is_same(const BundleProblem& problem, const BundleResult& a, const BundleResult& b, const BundleResult& scale) {
  const Eigen::VectorXd difference = params(a.state.lens) - params(b.state.lens);
  constexpr double same_sigmas = 0.3;  // a hundred times what the last steps move
  for (std::size_t i = 0; i < problem.free_lens.size(); ++i) {
    const auto at = static_cast<Eigen::Index>(i);
    const double move = difference[problem.free_lens[i]];
    if (move * move > same_sigmas * same_sigmas * scale.cov(at, at)) return false;
  }
  return true;
}

}  // namespace

std::vector<BundleState> starts_elsewhere(const BundleProblem& problem, const BundleResult& found,
                                          double noise_variance, std::span<const BoardView> views, int width_px) {
  std::vector<BundleState> starts;
  if (!is_vague(problem, found, noise_variance, width_px)) return starts;
  const double far_px = 0.2 * width_px;
  for (const auto& [du_px, dv_px] :
       std::array<std::array<double, 2>, 4>{{{far_px, 0.0}, {-far_px, 0.0}, {0.0, far_px}, {0.0, -far_px}}}) {
    BundleState start{moved(problem, found.state.lens, du_px, dv_px), {}, found.state.board_points};
    Camera camera;
    camera.lens = start.lens;
    for (const BoardView& view : views) {
      const auto pose = pose_from_plane(camera, view, start.board_points);
      if (!pose) break;
      start.cam_from_board.push_back(*pose);
    }
    if (start.cam_from_board.size() == views.size()) starts.push_back(std::move(start));
  }
  return starts;
}

std::vector<BundleResult> other_minima(const BundleProblem& problem, const BundleResult& found,
                                       const std::vector<BundleState>& starts, const BundleConfig& config) {
  std::vector<BundleResult> minima;
  for (const BundleState& start : starts) {
    if (start.cam_from_board.size() != problem.views.size()) continue;
    BundleResult result = solve_past_fold(problem, start, config);
    const auto is_known = [&](const BundleResult& other) { return is_same(problem, result, other, found); };
    if (result.status != BundleResult::Status::converged || is_known(found)) continue;
    if (std::none_of(minima.begin(), minima.end(), is_known)) minima.push_back(std::move(result));
  }
  std::sort(minima.begin(), minima.end(), [](const auto& a, const auto& b) { return a.cost < b.cost; });
  return minima;
}

}  // namespace alidade
