#include "alidade/localize/checks/depth_fit.h"

#include <algorithm>
#include <cmath>

#include "alidade/estimation/median.h"
#include "alidade/geometry/decompositions.h"
#include "alidade/localize/checks/scale_readings.h"

namespace alidade {
namespace {

/// Downward direction and scale by the current fit; zero if there is none.
struct Downwards {
  Eigen::Vector3d down = Eigen::Vector3d::Zero();
  double scale = 0.0;

  explicit Downwards(const Eigen::Vector3d& g) : scale(g.norm()) {
    if (scale > 0.0) down = g / scale;
  }
};

double depth_of(const DepthRow& row, const DepthModel& model, const DepthFit& fit, const Downwards& by) {
  double depth = fit.g().dot(row.place) + fit.values[3] + fit.values[4] * row.after_jump;
  depth += fit.values.segment(5, model.num_drift).dot(row.drift.head(model.num_drift));
  return model.has_arm() ? depth + by.down.dot(row.rotation * fit.arm_m) : depth;
}

/// One Gauss–Newton step, returning the full values, not increments: exact without an arm.
std::optional<DepthFit> stepped(const DepthModel& model, const DepthFit& from, std::vector<DepthRow>& rows) {
  const int dim = model.dim();
  const Downwards by(from.g());
  DepthFit::Matrix H = DepthFit::Matrix::Zero(dim, dim);
  DepthFit::Vector b = DepthFit::Vector::Zero(dim), J(dim);
  for (const DepthRow& row : rows) {
    double depth = row.depth_m;
    J.head<3>() = row.place;
    J[3] = 1.0;
    J[4] = row.after_jump;
    J.segment(5, model.num_drift) = row.drift.head(model.num_drift);
    if (model.has_arm() && by.scale > 0.0) {
      const Eigen::Vector3d arm = row.rotation * from.arm_m;
      const double along = by.down.dot(arm);
      J.head<3>() += (arm - along * by.down) / by.scale;
      if (!model.sigma_arm_m) depth -= along;
    }
    if (model.sigma_arm_m) J.tail<3>() = row.rotation.transpose() * by.down;
    const double weight = row.weight * row.weight;
    b += weight * depth * J;
    for (int j = 0; j < dim; ++j)
      for (int i = j; i < dim; ++i) H(i, j) += weight * J[j] * J[i];  // lower triangle only, for LDLᵀ
  }
  // A planar or straight path does not determine g across it: a weak prior sets that part to zero.
  constexpr double hardly = 1e-9;
  H.diagonal().head<3>().array() += hardly * H.diagonal().head<3>().sum();
  if (model.sigma_arm_m) {
    const double weight = 1.0 / (*model.sigma_arm_m * *model.sigma_arm_m);
    H.diagonal().tail<3>().array() += weight;
    b.tail<3>() += weight * model.arm_m;
  }
  for (int i = 4; i < dim; ++i)
    if (H(i, i) == 0.0) H(i, i) = 1.0;  // no jump
  const Ldlt ldlt(H);
  if (std::isnan(ldlt.min_pivot())) return std::nullopt;
  DepthFit fit{ldlt.solve(b), from.arm_m, ldlt.inverse()};
  if (!fit.values.allFinite() || !fit.cov.allFinite()) return std::nullopt;
  if (model.sigma_arm_m) fit.arm_m = fit.values.tail<3>();
  const Downwards fitted(fit.g());
  for (DepthRow& row : rows) row.left = row.weight * (row.depth_m - depth_of(row, model, fit, fitted));
  return fit;
}

}  // namespace

std::vector<DepthRow> rows_at(const DepthModel& model, double late_s, const SensorPath& path) {
  std::vector<DepthRow> rows;
  if (path.steps.empty()) return rows;
  const double from_s = path.steps.front().t_s, length_s = path.steps.back().t_s - from_s;
  rows.reserve(model.readings.size());
  for (const DepthReading& reading : model.readings) {
    const double t_s = reading.t_s - late_s;
    const auto there = path.at(t_s);
    if (!there) continue;
    DepthRow row{.depth_m = reading.depth_m, .weight = 1.0 / reading.sigma_m, .place = there->col(0)};
    row.after_jump = reading.t_s > model.jump_s ? 1.0 : 0.0;
    for (int i = 0; i < model.num_drift; ++i)
      row.drift[i] = std::clamp((t_s - from_s) / length_s * model.num_drift - i, 0.0, 1.0);
    if (model.has_arm()) row.rotation = there->rightCols<3>();
    rows.push_back(row);
  }
  return rows;
}

std::optional<DepthFit> fitted_without_far(const DepthModel& model, std::vector<DepthRow>& rows) {
  constexpr std::size_t enough = 10;
  constexpr double rejected_beyond = 4.0;  // of their robust σ
  const int rounds = 4, rounds_more = model.has_arm() ? 4 : 0;
  DepthFit fit;
  fit.values = DepthFit::Vector::Zero(model.dim());
  fit.values.head<3>() = model.g.value_or(Eigen::Vector3d::Zero());
  fit.arm_m = model.arm_at.value_or(model.arm_m);
  for (int round = -rounds_more; round < rounds; ++round) {
    if (rows.size() < enough) return std::nullopt;
    auto next = stepped(model, fit, rows);
    if (!next) return std::nullopt;
    fit = *std::move(next);
    std::vector<double> sizes;
    for (const DepthRow& row : rows) sizes.push_back(std::abs(row.left));
    const double limit = rejected_beyond * std::max(1.0, normal_from_mad * median_of(std::move(sizes)));
    fit.limit = limit;
    if (round >= 0 && round + 1 < rounds)
      std::erase_if(rows, [&](const DepthRow& row) { return std::abs(row.left) > limit; });
  }
  return fit;
}

DepthModel with_free_arm(DepthModel model, std::span<const DepthRow> rows) {
  constexpr double free_arm_m = 1.0;  // σ
  model.is_arm_free = true;
  model.sigma_arm_m = free_arm_m;
  using Vector13 = Eigen::Vector<double, 13>;
  Eigen::Matrix<double, 13, 13> H = Eigen::Matrix<double, 13, 13>::Zero();
  Vector13 b = Vector13::Zero(), J;
  for (const DepthRow& row : rows) {
    J.head<3>() = row.place;
    J[3] = 1.0;
    J.tail<9>() = row.rotation.reshaped();
    H += row.weight * row.weight * J * J.transpose();
    b += row.weight * row.weight * row.depth_m * J;
  }
  constexpr double hardly = 1e-9;
  H.diagonal().head<3>().array() += hardly * H.diagonal().head<3>().sum();
  H.diagonal().tail<9>().array() += 1.0 / (free_arm_m * free_arm_m);
  const Vector13 values = solve_symmetric(H, b);
  if (!values.allFinite() || values.head<3>().isZero(0.0)) return model;
  model.g = values.head<3>();
  const Eigen::Matrix3d down_arm = values.tail<9>().reshaped(3, 3);
  model.arm_at = down_arm.transpose() * model.g->normalized();
  return model;
}

double inflation(std::span<const DepthRow> rows) {
  double products = 0.0, squares = 0.0;
  for (std::size_t i = 0; i < rows.size(); ++i) {
    squares += rows[i].left * rows[i].left;
    if (i > 0) products += rows[i].left * rows[i - 1].left;
  }
  const double correlation = squares > 0.0 ? std::clamp(products / squares, 0.0, 0.98) : 0.0;
  return (1.0 + correlation) / (1.0 - correlation);
}

DepthCost cost_of(const DepthModel& model, const std::vector<DepthRow>& rows, std::optional<double> limit) {
  std::vector<DepthRow> near = rows;
  const auto fit = fitted_without_far(model, near);
  if (!fit) return {};
  DepthCost cost{0.0, 1.0, inflation(near), 0.0, limit.value_or(fit->limit)};
  const auto num = static_cast<double>(rows.size());
  const Downwards by(fit->g());
  for (const DepthRow& row : rows) {
    const double left = row.weight * (row.depth_m - depth_of(row, model, *fit, by));
    cost.cost += std::min(left * left, cost.limit * cost.limit) / num;
    cost.rejected += std::abs(left) > cost.limit ? 1.0 / num : 0.0;
  }
  cost.unit = std::max(1.0, cost.cost) * cost.alike / num;
  return cost;
}

}  // namespace alidade
