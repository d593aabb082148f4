#include "alidade/localize/checks/residual_structure.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <map>

namespace alidade {
namespace {

constexpr std::size_t num_across = 4, num_down = 3;

struct ImagePart {
  double num = 0.0;
  Eigen::Vector2d sum = Eigen::Vector2d::Zero(), sum_px = Eigen::Vector2d::Zero();
};

std::string name_of(std::size_t part) {
  constexpr std::array<const char*, num_down> rows{"upper", "middle", "lower"};
  constexpr std::array<const char*, num_across> columns{"left", "centre left", "centre right", "right"};
  return std::string(rows[part / num_across]) + " " + columns[part % num_across];
}

/// Correlation of what neighbours in time have, of the same point.
void add_colour(std::span<const PlacedResidual> residuals, ResidualStructure& structure) {
  std::map<long, const PlacedResidual*> last;
  double products = 0.0, squares = 0.0, num = 0.0;
  for (const PlacedResidual& residual : residuals) {
    const PlacedResidual*& before = last[residual.id];
    if (before != nullptr && before->frame + 1 == residual.frame) {
      const double variance = before->sigma_px * residual.sigma_px;
      products += before->residual_px.dot(residual.residual_px) / variance;
      squares += 0.5 * (before->residual_px.squaredNorm() + residual.residual_px.squaredNorm()) / variance;
      num += 2.0;
    }
    before = &residual;
  }
  if (!(squares > 0.0)) return;
  structure.colour = products / squares;
  structure.sigma_colour = 1.0 / std::sqrt(num);
}

}  // namespace

ResidualStructure residual_structure(std::span<const PlacedResidual> residuals, int width_px, int height_px) {
  ResidualStructure structure;
  add_colour(residuals, structure);
  std::array<ImagePart, num_across * num_down> parts;
  for (const PlacedResidual& residual : residuals) {
    const auto index = [](double share, std::size_t num) {
      return static_cast<std::size_t>(std::clamp(share, 0.0, 0.999) * static_cast<double>(num));
    };
    ImagePart& part = parts[index(residual.px.y() / height_px, num_down) * num_across +
                            index(residual.px.x() / width_px, num_across)];
    part.num += 1.0;
    part.sum += residual.residual_px / residual.sigma_px;
    part.sum_px += residual.residual_px;
  }
  constexpr double least = 30.0;
  double num = 0.0;
  for (std::size_t i = 0; i < parts.size(); ++i) {
    if (parts[i].num < least) continue;
    num += 2.0;
    structure.place_chi2 += parts[i].sum.squaredNorm() / parts[i].num;
    const double mean_px = (parts[i].sum_px / parts[i].num).norm();
    if (!(mean_px > structure.worst_px)) continue;
    structure.worst_px = mean_px;
    structure.worst_place = name_of(i);
  }
  if (!(num > 0.0)) return structure;
  structure.place_chi2 /= num;
  constexpr double z = 3.09;  // of a χ² by Wilson & Hilferty 1931
  const double w = 2.0 / (9.0 * num);
  structure.place_limit = std::pow(1.0 - w + z * std::sqrt(w), 3);
  return structure;
}

}  // namespace alidade
