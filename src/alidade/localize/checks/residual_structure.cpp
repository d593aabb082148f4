#include "alidade/localize/checks/residual_structure.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <iterator>
#include <map>
#include <vector>

#include "alidade/geometry/decompositions.h"

namespace alidade {
namespace {

constexpr std::size_t num_across = 4, num_down = 3;

/// Mean of residuals over σ, with their points.
class MeanResidual {
 public:
  void add(long id, double residual, double residual_px) {
    num_ += 1.0;
    sum_ += residual;
    sum_px_ += residual_px;
    of_point_[id] += residual;
  }
  [[nodiscard]] bool has_enough(double least, bool lasts) const {
    constexpr std::size_t few_points = 8;
    return num_ >= least && (!lasts || of_point_.size() >= few_points);
  }
  /// Adds changes of a residual by a common cause.
  void add_moves(const Eigen::RowVectorXd& moves) {
    if (moves_.size() == 0) moves_.setZero(moves.size());
    moves_ += moves;
  }
  [[nodiscard]] Eigen::RowVectorXd moves() const { return moves_ / num_; }
  [[nodiscard]] double mean() const { return sum_ / num_; }
  [[nodiscard]] double mean_px() const { return sum_px_ / num_; }
  /// Variance of the mean by chance. With clusters by point, mean²/variance is the square of Student's t, for one
  /// degree of freedom less than there are points, divided by its expectation.
  [[nodiscard]] double variance(bool lasts) const {
    if (!lasts) return 1.0 / num_;
    double squares = 0.0;
    for (const auto& [id, sum] : of_point_) squares += sum * sum;
    const double dof = static_cast<double>(of_point_.size()) - 1.0;
    return squares / (num_ * num_) * dof / (dof - 2.0);
  }
  [[nodiscard]] double chi2(bool lasts) const { return mean() * mean() / variance(lasts); }

 private:
  double num_ = 0.0, sum_ = 0.0, sum_px_ = 0.0;
  std::map<long, double> of_point_;
  Eigen::RowVectorXd moves_;
};

struct ImagePart {
  MeanResidual u, v;
};

std::string name_of(std::size_t part) {
  constexpr std::array<const char*, num_down> rows{"upper", "middle", "lower"};
  constexpr std::array<const char*, num_across> columns{"left", "centre left", "centre right", "right"};
  return std::string(rows[part / num_across]) + " " + columns[part % num_across];
}

double found_sigma_px(const PlacedResidual& residual) { return residual.error_factor * residual.sigma_px; }

/// Correlation of residuals of the same point in consecutive frames.
void add_autocorrelation(std::span<const PlacedResidual> residuals, ResidualStructure& structure) {
  std::map<long, const PlacedResidual*> last;
  double products = 0.0, squares = 0.0, num = 0.0;
  for (const PlacedResidual& residual : residuals) {
    const PlacedResidual*& before = last[residual.id];
    if (before != nullptr && before->frame + 1 == residual.frame) {
      const double variance = found_sigma_px(*before) * found_sigma_px(residual);
      products += before->residual_px.dot(residual.residual_px) / variance;
      squares += 0.5 * (before->residual_px.squaredNorm() + residual.residual_px.squaredNorm()) / variance;
      num += 2.0;
    }
    before = &residual;
  }
  if (!(squares > 0.0)) return;
  structure.autocorrelation = products / squares;
  structure.sigma_autocorrelation = 1.0 / std::sqrt(num);
}

}  // namespace

ResidualStructure residual_structure(std::span<const PlacedResidual> residuals, const Camera& camera) {
  ResidualStructure structure;
  add_autocorrelation(residuals, structure);
  std::array<ImagePart, num_across * num_down> parts;
  for (const PlacedResidual& residual : residuals) {
    const auto index = [](double share, std::size_t num) {
      return static_cast<std::size_t>(std::clamp(share, 0.0, 0.999) * static_cast<double>(num));
    };
    ImagePart& part = parts[index(residual.px.y() / camera.height_px, num_down) * num_across +
                            index(residual.px.x() / camera.width_px, num_across)];
    part.u.add(residual.id, residual.residual_px.x() / found_sigma_px(residual), residual.residual_px.x());
    part.v.add(residual.id, residual.residual_px.y() / found_sigma_px(residual), residual.residual_px.y());
  }
  constexpr double least = 30.0;
  const bool lasts = structure.is_autocorrelated();
  double num = 0.0;
  for (std::size_t i = 0; i < parts.size(); ++i) {
    if (!parts[i].u.has_enough(least, lasts)) continue;
    num += 2.0;
    structure.mean_chi2 += parts[i].u.chi2(lasts) + parts[i].v.chi2(lasts);
    const double mean_px = std::hypot(parts[i].u.mean_px(), parts[i].v.mean_px());
    if (!(mean_px > structure.worst_px)) continue;
    structure.worst_px = mean_px;
    structure.worst_region = name_of(i);
  }
  if (!(num > 0.0)) return structure;
  structure.mean_chi2 /= num;
  constexpr double z = 3.09;  // of χ², by Wilson & Hilferty 1931
  const double w = 2.0 / (9.0 * num);
  structure.mean_chi2_limit = std::pow(1.0 - w + z * std::sqrt(w), 3);
  return structure;
}

namespace {

/// χ² of the means, with the covariance by common causes.
double chi2_of(std::span<const MeanResidual> means, bool lasts, bool has_moves) {
  const auto num = static_cast<Eigen::Index>(means.size());
  Eigen::VectorXd mean(num);
  Eigen::MatrixXd cov = Eigen::MatrixXd::Zero(num, num);
  for (Eigen::Index i = 0; i < num; ++i) {
    const MeanResidual& at = means[static_cast<std::size_t>(i)];
    mean[i] = at.mean();
    cov(i, i) += at.variance(lasts);
    for (Eigen::Index j = 0; has_moves && j < num; ++j)
      cov(i, j) += at.moves().dot(means[static_cast<std::size_t>(j)].moves());
  }
  return squared_mahalanobis(mean, cov);
}

}  // namespace

RadialStructure radial_structure(std::span<const PlacedResidual> residuals, const Camera& camera, bool lasts,
                                 const ResidualMoves& moves) {
  constexpr std::size_t num_rings = 6;
  constexpr double least = 10.0;
  const Eigen::Vector2d middle = 0.5 * Eigen::Vector2d(camera.width_px, camera.height_px);
  std::array<MeanResidual, num_rings> rings;
  for (const PlacedResidual& residual : residuals) {
    const Eigen::Vector2d out = residual.px - middle;
    if (!(out.norm() > 1.0)) continue;
    const double along_px = out.normalized().dot(residual.residual_px);
    const double share = std::min(out.norm() / middle.norm(), 0.999);
    MeanResidual& ring = rings[static_cast<std::size_t>(share * num_rings)];
    ring.add(residual.id, along_px / residual.sigma_px, along_px);
    if (moves) ring.add_moves(out.normalized().transpose() / residual.sigma_px * moves(residual));
  }
  std::vector<MeanResidual> judged;
  std::ranges::copy_if(rings, std::back_inserter(judged),
                       [&](const MeanResidual& ring) { return ring.has_enough(least, lasts); });
  RadialStructure structure;
  for (const MeanResidual& ring : judged) {
    structure.share += ring.mean() * ring.mean();
    structure.worst_px = std::max(structure.worst_px, std::abs(ring.mean_px()));
  }
  if (judged.empty()) return structure;
  const auto num = static_cast<double>(judged.size());
  structure.share = std::sqrt(structure.share / num);
  structure.chi2_per_ring = chi2_of(judged, lasts, static_cast<bool>(moves)) / num;
  return structure;
}

}  // namespace alidade
