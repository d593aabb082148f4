#include <algorithm>
#include <cmath>

#include "alidade/geometry/decompositions.h"
#include "alidade/localize/path/path_system.h"

// Test of the given lens by the observations of a path: if they contradict it, it is estimated with the path.

namespace alidade {
namespace {

/// Lens parameters that are wrong if a camera file belongs to another lens, another setting or another medium, and the
/// σ of their errors.
struct OpenParam {
  const char* name;
  double sigma;
  bool is_relative;  ///< Centre: to the image width; focal length: to itself.
};
constexpr std::array<OpenParam, 6> open_params{{{"fx", 0.2, true},
                                                {"fy", 0.2, true},
                                                {"cx", 0.05, true},
                                                {"cy", 0.05, true},
                                                {"k1", 0.3, false},
                                                {"k2", 0.3, false}}};

}  // namespace

/// The estimated parameters come first in lens_order_.
void PathSmoother::estimate_lens(std::vector<int> estimated) {
  lens_order_ = std::move(estimated);
  num_estimated_ = static_cast<int>(lens_order_.size());
  for (int i = 0; i < static_cast<int>(params(problem_.camera.lens).size()); ++i)
    if (std::ranges::find(lens_order_.begin(), lens_order_.begin() + num_estimated_, i) ==
        lens_order_.begin() + num_estimated_)
      lens_order_.push_back(i);
}

void PathSmoother::free_lens() {
  const std::vector<std::string> names = param_names(problem_.camera.lens);
  std::vector<int> open;
  sigma_estimated_.clear();
  for (const OpenParam& each : open_params) {
    const auto at = std::ranges::find(names, each.name);
    if (at == names.end()) continue;
    open.push_back(static_cast<int>(at - names.begin()));
    const bool is_focal = each.name[0] == 'f';
    sigma_estimated_.push_back(each.sigma * (is_focal           ? given_lens_[open.back()]
                                             : each.is_relative ? problem_.camera.width_px
                                                                : 1.0));
  }
  estimate_lens(std::move(open));
  is_lens_freed_ = true;
  links_.clear();
}

/// Largest decrease of the cost by one of the causes that are tested beside the lens.
double PathSmoother::best_cause(const Asked& all) const {
  const Eigen::Index causes = causes_at_ - lens_at_;
  double best = 0.0;
  for (const auto& [first, num] : {std::pair{shape_cause, 1}, {speed_cause, 3}, {readout_cause, 1}, {turn_cause, 3}}) {
    if (!problem_.compares_causes && first != readout_cause) continue;
    const Eigen::MatrixXd information = all.information.block(causes + first, causes + first, num, num);
    const Eigen::VectorXd score = all.score.segment(causes + first, num);
    if (information.diagonal().minCoeff() > 0.0) best = std::max(best, squared_mahalanobis(score, information));
  }
  return best;
}

/// Whether the lens parameters together explain far more of the residuals than chance and their given covariance.
bool PathSmoother::asks_for_lens(const SmootherSystem& system) const {
  if (num_estimated_ > 0) return false;
  const std::vector<std::string> names = param_names(problem_.camera.lens);
  const Asked all = asked(system);
  std::vector<Eigen::Index> open;
  for (const OpenParam& each : open_params)
    if (const auto at = std::ranges::find(names, each.name); at != names.end()) open.push_back(at - names.begin());
  const Eigen::MatrixXd information = all.information(open, open), known = considered_cov()(open, open);
  const Eigen::VectorXd score = all.score(open);
  const double num_left =
      2.0 * static_cast<double>(observations_.size()) - 6.0 * static_cast<double>(state_.poses.size());
  // Matches of images may be far better than the σ floor: the residuals tell by how much, down to half of
  // it.
  const double least_noise = problem_.compares_causes ? 1.0 : 0.25;
  const double noise = std::max(least_noise, system.observed_cost / std::max(num_left, 1.0));
  constexpr double far_more = 60.0;
  if (!(squared_mahalanobis(score, noise * information + information * known * information) > far_more)) return false;
  return squared_mahalanobis(score, information) > best_cause(all);
}

/// Changes of residuals by the given covariance of the lens. `spread`: before its rows are rotated to the camera.
ResidualMoves PathSmoother::moves_by_lens(const Eigen::MatrixXd& considered, const Asked& asked,
                                          const PoseChain::Spread& spread) const {
  const Eigen::Index num = considered.rows() - num_causes;
  if (num == 0 || considered.topLeftCorner(num, num).isZero(0.0)) return {};
  const SymmetricEigen by = symmetric_eigen(considered.topLeftCorner(num, num));
  const Eigen::MatrixXd root = by.vectors * by.values.cwiseMax(0.0).cwiseSqrt().asDiagonal();
  const Eigen::MatrixXd J_estimated = asked.J.block(lens_at_, 0, num_estimated_, num);
  return [this, num, root, J_estimated, &spread](const PlacedResidual& residual) -> Eigen::Matrix2Xd {
    const std::size_t i = residual.index, point = point_of_[i];
    const auto rows = rows_of(state_, i, Twist::Zero(), true);
    if (!rows || !lives_[point]) return Eigen::Matrix2Xd::Zero(2, num);
    const Eigen::Matrix2Xd J =
        rows->J_shared.middleCols(num_estimated_, num) + rows->J_shared.leftCols(num_estimated_) * J_estimated +
        rows->J_pose * spread.J[residual.frame].leftCols(num) + rows->J_point * spread.point_J[point].leftCols(num);
    return residual.error_factor * residual.sigma_px * (J * root);
  };
}

namespace {

/// Lens parameters that may differ from the calibration (focus or zoom, a stabiliser), and their largest error.
struct HiddenParam {
  std::string_view given;
  std::array<std::string_view, 2> names;  ///< Names in the lens model.
  double most;                            ///< Relative for a focal length; over the image width for a centre.
};
constexpr std::array<HiddenParam, 3> hidden_params{
    {{"focal length", {"fx", "fy"}, 0.04}, {"centre u", {"cx", ""}, 0.02}, {"centre v", {"cy", ""}, 0.02}}};

constexpr double most_hidden_sigmas = 4.0;  ///< Limit for the move of a pose by an undetected error.

/// The largest error, at most `any`, that the score test would not detect, and the σ such that it moves no pose by more
/// than 4σ. A few points on a target hardly distinguish a longer focal length from a larger distance, or another centre
/// from a rotated camera, and the σ of the camera file may no longer apply.
void hide(double any, GivenNumber& given) {
  constexpr double named_z = 3.5, unseen_z = 2.4;
  const double z = std::min(std::abs(given.z), named_z);
  given.hidden = z > 0.0 ? std::min(std::abs(given.asked / given.z) * (z + unseen_z), any) : any;
  if (!(given.moves > 0.0)) return;
  const double counted = given.hidden / most_hidden_sigmas, by_path = 1.0 / given.moves;
  given.sigma_hidden = std::sqrt(std::max(counted * counted - by_path * by_path, 0.0));
}

/// Largest Mahalanobis distance by which a change along `direction` moves a pose.
double moves_together(const PoseChain::Spread& spread, const Eigen::VectorXd& direction,
                      std::span<const Eigen::Matrix<double, 6, 6>> covs) {
  double most = 0.0;
  for (std::size_t k = 0; k < covs.size(); ++k)
    most = std::max(most, squared_mahalanobis(spread.J[k] * direction, covs[k]));
  return std::sqrt(most);
}

/// Another centre moves position and rotation together, and combinations of these are far more certain than either: 4σ
/// of each are many σ of a combination. If the score would not show an ordinary error as 2σ, σ is such that it moves no
/// combination by more than 4σ; a change indicated by a score beyond 2σ is included as far as it is ordinary.
void count_together(double any, double moves, GivenNumber& given) {
  constexpr double in_doubt_z = 2.0;
  const double ordinary = 0.5 * any, z = std::abs(given.z), sigma = z > 0.0 ? std::abs(given.asked) / z : any;
  double counted = 0.0;
  if (in_doubt_z * sigma > ordinary)
    counted = std::sqrt(std::max(std::pow(given.hidden / most_hidden_sigmas, 2) - std::pow(moves, -2), 0.0));
  if (z > in_doubt_z) counted = std::max(counted, std::abs(given.asked) / (1.0 + std::pow(sigma / ordinary, 2)));
  given.sigma_hidden = std::max(given.sigma_hidden, std::min(counted, any));
}

}  // namespace

/// Requires `path.given` and the ids.
void PathSmoother::fill_hidden(const PoseChain::Spread& spread, SmoothedPath& path) const {
  const std::vector<std::string> names = param_names(problem_.camera.lens);
  for (const HiddenParam& param : hidden_params) {
    const auto given = std::ranges::find(path.given, param.given, &GivenNumber::name);
    if (given == path.given.end()) continue;
    const bool is_focal = !param.names[1].empty();
    if (!is_focal && problem_.gauge != PathGauge::fixed) continue;  // the rotation of such a world is undetermined
    hide(param.most * (is_focal ? 1.0 : problem_.camera.width_px), *given);
    Eigen::VectorXd direction = Eigen::VectorXd::Zero(spread.J.front().cols());
    for (int i = num_estimated_; i < static_cast<int>(lens_order_.size()); ++i) {
      const auto at = static_cast<std::size_t>(lens_order_[static_cast<std::size_t>(i)]);
      if (std::ranges::find(param.names, names[at]) != param.names.end())
        direction[i - num_estimated_] = is_focal ? given_lens_[static_cast<Eigen::Index>(at)] : 1.0;
    }
    if (!is_focal)
      count_together(param.most * problem_.camera.width_px, moves_together(spread, direction, path.cov), *given);
    if (!(given->sigma_hidden > 0.0)) continue;
    const Eigen::VectorXd move = given->sigma_hidden * direction;
    SmoothedPath::Hidden& hidden = path.hidden.emplace_back();
    for (const auto& J : spread.J) hidden.poses.emplace_back(J * move);
    for (const long id : path.ids) hidden.points.emplace_back(spread.point_J[index_of_.at(id)] * move);
  }
}

void PathSmoother::count_hidden(SmoothedPath& path) const {
  for (const SmoothedPath::Hidden& hidden : path.hidden) {
    for (std::size_t k = 0; k < path.cov.size(); ++k) path.cov[k] += hidden.poses[k] * hidden.poses[k].transpose();
    for (std::size_t i = 0; i < path.point_covs.size(); ++i)
      path.point_covs[i] += hidden.points[i] * hidden.points[i].transpose();
    if (problem_.gauge == PathGauge::fixed)
      widen_frame(hidden.points, 1.0, path);
    else
      for (std::size_t i = 0; i < path.covs_in_map.size(); ++i)
        path.covs_in_map[i] += hidden.points[i] * hidden.points[i].transpose();
  }
}

}  // namespace alidade
