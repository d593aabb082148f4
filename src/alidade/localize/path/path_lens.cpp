#include <algorithm>
#include <cmath>

#include "alidade/geometry/decompositions.h"
#include "alidade/localize/path/path_system.h"

// What a path's observations say of the lens: where they contradict what was given, it is estimated with the path.

namespace alidade {
namespace {

/// Those of a lens's parameters that are off where a camera file is of another lens, another setting, or another
/// medium, and how far they may be.
struct OpenParam {
  const char* name;
  double sigma;
  bool is_relative;  ///< Centre: to the image's width; focal length: to itself.
};
constexpr std::array<OpenParam, 6> open_params{{{"fx", 0.2, true},
                                                {"fy", 0.2, true},
                                                {"cx", 0.05, true},
                                                {"cy", 0.05, true},
                                                {"k1", 0.3, false},
                                                {"k2", 0.3, false}}};

}  // namespace

/// They stand first of all that is shared.
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

/// What the best of the causes that are tested beside the lens explains of what is left over.
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

/// Whether the lens's parameters together explain of what is left over far more than chance and their covariance would.
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
  // Matches of images may be far better than the σ that is the least of any: what is left over says by how much, up to
  // a half.
  const double least_noise = problem_.compares_causes ? 1.0 : 0.25;
  const double noise = std::max(least_noise, system.observed_cost / std::max(num_left, 1.0));
  constexpr double far_more = 60.0;
  if (!(squared_mahalanobis(score, noise * information + information * known * information) > far_more)) return false;
  return squared_mahalanobis(score, information) > best_cause(all);
}

}  // namespace alidade
