#include "alidade/calibrate/checks/repeated_views.h"

#include <algorithm>
#include <cmath>

namespace alidade {
namespace {

/// Positions of a view's corners that fit, by increasing number.
std::vector<std::size_t> by_number(const BoardView& view, const std::vector<Eigen::Vector2d>& residuals) {
  std::vector<std::size_t> order;
  for (std::size_t i = 0; i < view.corners.size(); ++i)
    if (residuals[i].allFinite()) order.push_back(i);
  std::ranges::sort(order, {}, [&](std::size_t i) { return view.corners[i].index; });
  return order;
}

/// A view, its residuals, and its corners in order.
struct Seen {
  const BoardView& view;
  const std::vector<Eigen::Vector2d>& residuals;
  const std::vector<std::size_t>& order;
};

/// Correlation of the residuals of the corners that two views have in common, or 0 where they are few, or one of them
/// is elsewhere in the image.
double correlation_at_one_place(const Seen& a, const Seen& b) {
  constexpr double near_px = 2.0;
  constexpr std::size_t enough = 12;  // by chance, 1/√24 = 0.2
  double product = 0.0, square_a = 0.0, square_b = 0.0;
  std::size_t common = 0;
  for (auto i = a.order.begin(), j = b.order.begin(); i != a.order.end() && j != b.order.end();) {
    const Corner &p = a.view.corners[*i], &q = b.view.corners[*j];
    if (p.index == q.index) {
      if (!((p.px - q.px).squaredNorm() <= near_px * near_px)) return 0.0;
      product += a.residuals[*i].dot(b.residuals[*j]);
      square_a += a.residuals[*i].squaredNorm();
      square_b += b.residuals[*j].squaredNorm();
      ++common;
    }
    const bool steps_a = p.index <= q.index, steps_b = q.index <= p.index;
    i += steps_a ? 1 : 0;
    j += steps_b ? 1 : 0;
  }
  const bool overlap = common >= enough && 5 * common >= 4 * std::max(a.order.size(), b.order.size());
  return overlap ? product / std::sqrt(std::max(square_a * square_b, 1e-300)) : 0.0;
}

}  // namespace

std::vector<std::optional<std::size_t>> views_with_shared_errors(
    std::span<const BoardView> views, std::span<const std::vector<Eigen::Vector2d>> residuals) {
  constexpr double mostly_shared = 0.5;
  std::vector<std::vector<std::size_t>> orders;
  for (std::size_t k = 0; k < views.size(); ++k) orders.push_back(by_number(views[k], residuals[k]));
  std::vector<std::optional<std::size_t>> repeats(views.size());
  const auto seen = [&](std::size_t k) { return Seen{views[k], residuals[k], orders[k]}; };
  for (std::size_t k = 1; k < views.size(); ++k)
    for (std::size_t before = 0; before < k && !repeats[k]; ++before)
      if (!repeats[before] && correlation_at_one_place(seen(before), seen(k)) > mostly_shared) repeats[k] = before;
  return repeats;
}

}  // namespace alidade
