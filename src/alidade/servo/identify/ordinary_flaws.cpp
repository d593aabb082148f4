#include <algorithm>
#include <array>
#include <cmath>

#include "alidade/geometry/degree.h"
#include "alidade/servo/identify/identify_causes.h"
#include "alidade/servo/identify/identify_flaws.h"

namespace alidade {
namespace {

constexpr double ordinary_dead_band = 0.002;  // of the largest command: friction, rounded commands
constexpr double ordinary_backlash_rad = 0.03 * degree;
constexpr double ordinary_eccentricity_rad = 1e-3;  // 20 µm for an encoder ring of 40 mm
constexpr double ordinary_damping = 0.2, ordinary_share = 0.5;

/// A flaw that is assumed absent, and σ of its typical size.
struct Ordinary {
  double ServoFlaws::*flaw;
  double sigma;
};

bool is_freed(const ServoFit& fit, double ServoFlaws::*flaw) {
  return std::ranges::any_of(fit.freed, [&](std::size_t each) { return servo_flaws[each] == flaw; });
}

/// Response of the estimated parameters to effects that are not in the model (considered parameters).
class Considered {
 public:
  Considered(const ServoIdentification& identified, const FlawGround& ground, const Eigen::MatrixXd& J,
             const Eigen::MatrixXd& inverse)
      : ground_(ground),
        J_(J),
        inverse_(inverse),
        variance_(std::pow(identified.fit.rms_rad, 2) * std::max(1.0, identified.clusters.design_effect)) {}
  [[nodiscard]] bool knows() const { return variance_ > 0.0; }

  /// Change of the parameters for an effect with σ `added` on the response, given the log. For
  /// an effect with a single sign the mean is zero if the residuals indicate the opposite sign.
  [[nodiscard]] Eigen::VectorXd follow(const Eigen::VectorXd& added, bool has_one_sign) const {
    const Eigen::VectorXd own = added - ground_.across * (ground_.across.transpose() * added);
    // In units of its σ: root mean square after the log.
    const double left2 = 1.0 / (1.0 + own.squaredNorm() / variance_);
    const double mean = -left2 * own.dot(ground_.misfit) / variance_;
    const double share = std::sqrt(left2 + std::pow(has_one_sign ? std::max(mean, 0.0) : mean, 2));
    return -share * (inverse_ * (J_.transpose() * added));
  }

 private:
  const FlawGround& ground_;
  const Eigen::MatrixXd &J_, &inverse_;
  double variance_;
};

void count(const Eigen::VectorXd& follow, ServoFit& fit) {
  fit.cov += follow.head<num_servo_params>() * follow.head<num_servo_params>().transpose();
  for (std::size_t i = 0; i < fit.freed.size(); ++i) {
    double& sigma = fit.flaw_sigma[fit.freed[i]];
    sigma = std::hypot(sigma, follow[num_servo_params + static_cast<Eigen::Index>(i)]);
  }
}

/// An eccentric encoder ring adds a sine of the angle with unknown phase to the reading: a sine and a cosine.
void count_eccentricity(const FlawGround& ground, const Considered& considered, ServoIdentification& result) {
  const std::array<Eigen::VectorXd, 2> waves{ground.response.array().cos(), ground.response.array().sin()};
  for (const Eigen::VectorXd& wave : waves) {
    const Eigen::VectorXd follow = considered.follow(ordinary_eccentricity_rad * wave, false);
    count(follow, result.fit);
    result.counted.push_back(
        {"encoder_eccentricity_rad", ordinary_eccentricity_rad, follow.head<num_servo_params>(), {}});
  }
}

/// A resonance that the log does not excite, at the frequency with the largest effect on the latency: lower ones show.
void count_resonance(std::span<const ServoSample> log, const FlawGround& ground, const Considered& considered,
                     ServoIdentification& result) {
  if (is_freed(result.fit, &ServoFlaws::resonance_hz)) return;
  const AddedResonances all = added_resonances(log, ground.response, ordinary_damping);
  Eigen::VectorXd most = Eigen::VectorXd::Zero(num_servo_params);
  double hz = 0.0;
  for (std::size_t i = 0; i < all.hz.size(); ++i) {
    const Eigen::VectorXd follow =
        considered.follow(ordinary_share * all.added.col(static_cast<Eigen::Index>(i)), false);
    if (!(std::abs(follow[ServoParam::latency]) > std::abs(most[ServoParam::latency]))) continue;
    most = follow;
    hz = all.hz[i];
  }
  if (!(hz > 0.0)) return;
  count(most, result.fit);
  result.counted.push_back({"resonance_share", ordinary_share, most.head<num_servo_params>(),
                            "log steps, or a chirp up to " + text_of(hz, 2) + " Hz"});
}

}  // namespace

void count_ordinary_flaws(std::span<const ServoSample> log, const Eigen::MatrixXd& J, const Eigen::MatrixXd& inverse,
                          ServoIdentification& result) {
  ServoFit& fit = result.fit;
  const FlawGround ground = flaw_ground(log, fit);
  const Considered considered(result, ground, J, inverse);
  if (!considered.knows()) return;
  const std::array<Ordinary, 2> all{{{&ServoFlaws::dead_band, ordinary_dead_band * largest_command(log)},
                                     {&ServoFlaws::backlash_rad, ordinary_backlash_rad}}};
  for (const Ordinary& each : all) {
    if (is_freed(fit, each.flaw) || !(each.sigma > 0.0)) continue;
    ServoFlaws flaws = fit.flaws;
    flaws.*each.flaw = each.sigma;
    const Eigen::VectorXd follow = considered.follow(flawed_response(log, fit, flaws) - ground.response, true);
    count(follow, fit);
    const auto flaw = static_cast<std::size_t>(std::ranges::find(servo_flaws, each.flaw) - servo_flaws.begin());
    result.counted.push_back({servo_flaw_names[flaw], each.sigma, follow.head<num_servo_params>(), {}});
  }
  count_eccentricity(ground, considered, result);
  count_resonance(log, ground, considered, result);
}

}  // namespace alidade
