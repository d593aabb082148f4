#include "alidade/servo/identify/identify_causes.h"

#include <algorithm>
#include <array>
#include <cmath>

#include "alidade/geometry/degree.h"
#include "alidade/servo/identify/identify_flaws.h"

namespace alidade {
namespace {

constexpr double ordinary_dead_band = 0.002;  // of the largest command: friction, rounded commands
constexpr double ordinary_backlash_rad = 0.03 * degree;

/// A flaw that is taken to be none, and σ of what there may be of it.
struct Ordinary {
  double ServoFlaws::*flaw;
  double sigma;
};

bool is_freed(const ServoFit& fit, double ServoFlaws::*flaw) {
  return std::ranges::any_of(fit.freed, [&](std::size_t each) { return servo_flaws[each] == flaw; });
}

}  // namespace

void count_ordinary_flaws(std::span<const ServoSample> log, const Eigen::MatrixXd& J, const Eigen::MatrixXd& inverse,
                          ServoIdentification& result) {
  ServoFit& fit = result.fit;
  const FlawGround ground = flaw_ground(log, fit);
  const double variance = fit.rms_rad * fit.rms_rad * std::max(1.0, result.clusters.design_effect);
  const std::array<Ordinary, 2> all{{{&ServoFlaws::dead_band, ordinary_dead_band * largest_command(log)},
                                     {&ServoFlaws::backlash_rad, ordinary_backlash_rad}}};
  for (const Ordinary& each : all) {
    if (is_freed(fit, each.flaw) || !(each.sigma > 0.0) || !(variance > 0.0)) continue;
    ServoFlaws flaws = fit.flaws;
    flaws.*each.flaw = each.sigma;
    const Eigen::VectorXd added = flawed_response(log, fit, flaws) - ground.response;
    const Eigen::VectorXd own = added - ground.across * (ground.across.transpose() * added);
    // In units of its σ: what is left of it after the log, about zero.
    const double left2 = 1.0 / (1.0 + own.squaredNorm() / variance), mean = -left2 * own.dot(ground.misfit) / variance;
    const double share = std::sqrt(left2 + std::pow(std::max(mean, 0.0), 2));
    const Eigen::VectorXd follow = -share * (inverse * (J.transpose() * added));
    fit.cov += follow.head<num_servo_params>() * follow.head<num_servo_params>().transpose();
    for (std::size_t i = 0; i < fit.freed.size(); ++i) {
      double& sigma = fit.flaw_sigma[fit.freed[i]];
      sigma = std::hypot(sigma, follow[num_servo_params + static_cast<Eigen::Index>(i)]);
    }
    const auto flaw = std::ranges::find(servo_flaws, each.flaw) - servo_flaws.begin();
    result.counted.push_back({static_cast<std::size_t>(flaw), each.sigma, follow[ServoParam::gain]});
  }
}

}  // namespace alidade
