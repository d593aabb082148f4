#include "alidade/observe/checks/followed_changes.h"
#include "alidade/observe/solve/solve_once.h"

namespace alidade {
namespace {

void raise_sigma(const CommonMatrix& model, const CommonMatrix& stated, const Eigen::Array4d& inflation,
                 const Eigen::Vector4d& last_k, std::vector<IntrinsicsEstimate>& rows) {
  const Eigen::Array4d before = model.diagonal().head<4>(), after = stated.diagonal().head<4>();
  const Eigen::Array4d factor = inflation.square();
  const Eigen::Array4d share = (after - factor * before).max(0.0) / last_k.head<2>().prod();
  if (!before.allFinite() || !share.allFinite()) return;  // not every method provides its own σ
  for (IntrinsicsEstimate& row : rows) {
    if (row.has_value) row.sigma = (factor * row.sigma.array().square() + share * (row.fx * row.fy)).sqrt();
  }
}

}  // namespace

std::optional<Eigen::Vector4d> intrinsics_before(double until_s, const RotationLog& log,
                                                 const std::vector<IntrinsicsEstimate>& rows) {
  std::optional<Eigen::Vector4d> k;
  if (!(until_s < log.rows.back().t_s)) return k;
  for (std::size_t row = 0; row < rows.size() && log.rows[row].t_s <= until_s; ++row)
    if (rows[row].has_value) k = rows[row].values();
  return k;
}

std::vector<Check> state_rows(const RotationLog& log, const CommonMatrix& model, const CommonMatrix& stated,
                              const Eigen::Array4d& inflation, const Eigen::Vector4d& last_k,
                              std::vector<IntrinsicsEstimate>& rows) {
  raise_sigma(model, stated, inflation, last_k, rows);
  std::vector<Check> checks = followed_checks(rows, log);
  widen_before_zooms(rows);
  return checks;
}

}  // namespace alidade
