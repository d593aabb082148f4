#include "alidade/pantilt/intrinsics_history.h"

#include <algorithm>
#include <cmath>

namespace alidade {

namespace {

/// fx, fy, cx, cy come first in every model. Allocates nothing.
Eigen::Vector4d intrinsics_of(const Lens& lens) {
  return std::visit([](const auto& own) { return Eigen::Vector4d(own.params.template head<4>()); }, lens);
}

}  // namespace

IntrinsicsSample own_lens(const Camera& camera) {
  IntrinsicsSample now;
  now.k = intrinsics_of(camera.lens);
  if (camera.cov.rows() >= 4) now.sigma = camera.cov.diagonal().head<4>().cwiseMax(0.0).cwiseSqrt();
  return now;
}

Zoomed::Zoomed(const Camera& camera, const Eigen::Vector4d& k) : centre(k.tail<2>()) {
  const Eigen::Vector4d own = intrinsics_of(camera.lens);
  own_centre = own.tail<2>();
  ratio = k.head<2>().cwiseQuotient(own.head<2>());
}

IntrinsicsSample IntrinsicsHistory::at(double at_s) const {
  const auto after = std::ranges::lower_bound(t_s, at_s);
  if (after == t_s.begin()) return lens.front();
  if (after == t_s.end()) return lens.back();
  const auto i = static_cast<std::size_t>(after - t_s.begin());
  const double share = (at_s - t_s[i - 1]) / (t_s[i] - t_s[i - 1]);
  // σ is not that of a mean: neighbouring answers share their errors.
  return {(1.0 - share) * lens[i - 1].k + share * lens[i].k, lens[i - 1].sigma.cwiseMax(lens[i].sigma)};
}

}  // namespace alidade
