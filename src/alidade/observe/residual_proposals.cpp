#include <Eigen/Cholesky>
#include <cmath>

#include "alidade/geometry/decompositions.h"

#include "alidade/observe/observe.h"

namespace alidade {
namespace {

struct Candidate {
  const char* name;
  bool ObserveNuisances::*wanted;
  int CommonLayout::*place;
  int width;
};

constexpr Candidate candidates[] = {{"k1", &ObserveNuisances::k1, &CommonLayout::k1, 1},
                                    {"mount", &ObserveNuisances::mount, &CommonLayout::mount, 3},
                                    {"delay", &ObserveNuisances::delay, &CommonLayout::delay, 1}};

}  // namespace

std::vector<std::pair<std::string, double>> residual_proposals(const FrameBuffer& buffer, const Adjustment& reference,
                                                               AdjustConfig config, const Progress& progress) {
  std::vector<std::pair<std::string, double>> proposals;
  config.start = reference.solution.camera;
  config.other_starts.clear();
  for (const Candidate& candidate : candidates) {
    if (config.nuisances.*candidate.wanted) continue;
    AdjustConfig more = config;
    more.nuisances.*candidate.wanted = true;
    const Adjustment adjustment = adjust(buffer, more, progress);
    if (!adjustment.has_value) continue;
    const CommonLayout layout(more.nuisances);
    const int at = layout.*candidate.place;
    const CommonVector offset = CommonPrior(RotatingCamera{}).offset(layout, adjustment.solution.camera);
    const Eigen::VectorXd value = offset.segment(at, candidate.width);
    const Eigen::MatrixXd cov = adjustment.solution.bound().block(at, at, candidate.width, candidate.width);
    const double z = std::sqrt(squared_mahalanobis(value, cov));
    if (std::isfinite(z)) proposals.emplace_back(candidate.name, z);
  }
  return proposals;
}

}  // namespace alidade
