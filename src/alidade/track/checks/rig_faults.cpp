#include "alidade/track/checks/rig_faults.h"

#include <algorithm>
#include <array>
#include <cmath>

#include "alidade/geometry/decompositions.h"

namespace alidade {
namespace {

/// An error that moves a ray within the plane of both rays changes only the range: it is unobservable, and a filter's
/// apparent information about it comes from its own linearisation. Observable are the parameters across that plane:
/// for heads side by side rotations about x or z, vertical offsets, and of a lens fy and cy.
bool is_across(std::span<const RigHead> heads, Eigen::Index param) {
  const Eigen::Vector3d apart =
      heads.back().head.world_from_base.translation - heads.front().head.world_from_base.translation;
  const bool side_by_side = std::abs(apart.x()) >= std::abs(apart.y());
  constexpr std::array<Eigen::Index, 8> vertical{1, 3, 5, 12, 16, 18, num_head_params + 1, num_head_params + 3};
  constexpr std::array<Eigen::Index, 8> horizontal{0, 4, 5, 13, 15, 17, num_head_params + 0, num_head_params + 2};
  return std::ranges::count(side_by_side ? vertical : horizontal, param) > 0;
}

}  // namespace

std::vector<RigFault> rig_faults(std::span<const RigHead> heads, const RigUncertainty& errors,
                                 const Tracker::Learned& learned, bool is_supposed) {
  // Of the variance: what the observations determine to a tenth of the file's precision, the file may contradict by
  // fifty of its σ.
  constexpr double min_given = 0.01;
  std::vector<RigFault> faults;
  // What the observations add to u ~ N(0, 1): the information, and its vector.
  const Eigen::MatrixXd inverse = inverse_symmetric(learned.cov);
  const Eigen::MatrixXd given = inverse - Eigen::MatrixXd::Identity(inverse.rows(), inverse.cols());
  const Eigen::VectorXd given_u = inverse * learned.u;
  for (std::size_t h = 0; h < heads.size() && h < errors.factor.size(); ++h) {
    const Eigen::MatrixXd& factor = errors.factor[h];
    const std::vector<std::string> lens = param_names(heads[h].camera.lens);
    for (Eigen::Index p = 0; p < factor.rows(); ++p) {
      if (!is_across(heads, p)) continue;
      const Eigen::RowVectorXd row = factor.row(p);
      const double before = row.squaredNorm(), after = row * learned.cov * row.transpose();
      if (!(before > 0.0) || !(before - after > min_given * before)) continue;
      const Eigen::Index k = p - num_head_params;
      const std::string name = k < 0 ? std::string(head_param_names[static_cast<std::size_t>(p)])
                                     : "camera." + lens[static_cast<std::size_t>(k)];
      double off = row * learned.u, z = std::abs(off) / std::sqrt(before - after);
      if (is_supposed) {  // if it alone errs: one cause is tested, not all of them at once
        const Eigen::VectorXd alone = row.transpose() / std::sqrt(before);
        const double pull = alone.dot(given_u), weight = alone.dot(given * alone);
        if (!(weight > 0.0)) continue;
        off = std::sqrt(before) * pull / weight;
        z = std::abs(pull) / std::sqrt(weight);
      }
      faults.push_back({"head" + std::to_string(heads[h].head.id) + "." + name, off, z});
    }
  }
  std::ranges::stable_sort(faults, std::ranges::greater{}, &RigFault::z);
  return faults;
}

RigUncertainty supposed_errors(std::span<const RigHead> heads) {
  constexpr double turn_rad = 0.01, scale = 0.01, share_of_f = 0.01;
  Rig rig;
  rig.heads.assign(heads.begin(), heads.end());
  const auto num = num_head_params * static_cast<Eigen::Index>(heads.size());
  rig.cov.setZero(num, num);
  for (std::size_t h = 0; h < heads.size(); ++h) {
    const Eigen::Index first = num_head_params * static_cast<Eigen::Index>(h);
    const auto suppose = [&](Eigen::Index param, double sigma) {
      if (is_across(heads, param)) rig.cov(first + param, first + param) = sigma * sigma;
    };
    for (const Eigen::Index turn : {3, 4, 5}) suppose(turn, h > 0 ? turn_rad : 0.0);
    for (const Eigen::Index axis : {17, 18}) suppose(axis, scale);
    Camera& camera = rig.heads[h].camera;
    const Eigen::VectorXd values = params(camera.lens);
    camera.cov.setZero(values.size(), values.size());
    for (const Eigen::Index f : {0, 1})
      if (is_across(heads, num_head_params + f)) camera.cov(f, f) = std::pow(share_of_f * values[f], 2);
  }
  return rig_uncertainty(rig);
}

}  // namespace alidade
