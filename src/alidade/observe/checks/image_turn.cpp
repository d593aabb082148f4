#include "alidade/observe/checks/image_turn.h"

#include <algorithm>

#include "alidade/estimation/median.h"
#include "alidade/observe/setup.h"

namespace alidade {

std::optional<ImageTurn> image_turn(const RotationRow& from, const RotationRow& to, const Eigen::Vector2d& centre,
                                    double focal_px) {
  constexpr std::size_t enough = 4;
  std::vector<Eigen::Matrix<double, 2, 3>> J;
  std::vector<Eigen::Vector2d> flow;
  std::vector<double> moved_px;
  for (std::size_t i = 0; i < from.px.size(); ++i) {
    const Eigen::Vector2d &a = from.px[i], &b = to.px[i];
    if (!is_seen(a) || !is_seen(b)) continue;
    const Eigen::Vector2d p = (0.5 * (a + b) - centre) / focal_px;
    J.emplace_back();
    J.back() << p.x() * p.y(), -(1.0 + p.x() * p.x()), p.y(), 1.0 + p.y() * p.y(), -p.x() * p.y(), -p.x();
    flow.push_back((b - a) / focal_px);
    moved_px.push_back((b - a).norm());
  }
  if (flow.size() < enough) return std::nullopt;
  ImageTurn all{Eigen::Vector3d::Zero(), median_of(std::move(moved_px))};
  std::vector<double> weights(flow.size(), 1.0), off(flow.size());
  for (int i = 0; i < 4; ++i) {
    Eigen::Matrix3d A = Eigen::Matrix3d::Zero();
    Eigen::Vector3d b = Eigen::Vector3d::Zero();
    for (std::size_t k = 0; k < flow.size(); ++k) {
      A += weights[k] * J[k].transpose() * J[k];
      b += weights[k] * J[k].transpose() * flow[k];
    }
    all.turn = solved<3>(A, b);
    for (std::size_t k = 0; k < flow.size(); ++k) off[k] = (flow[k] - J[k] * all.turn).norm();
    weigh_errors(off, weights);
  }
  return all;
}

void weigh_errors(const std::vector<double>& off, std::vector<double>& weights) {
  const double usual = 2.0 * median_of(off) + 1e-12;
  for (std::size_t k = 0; k < off.size(); ++k) weights[k] = usual / std::max(usual, off[k]);
}

}  // namespace alidade
