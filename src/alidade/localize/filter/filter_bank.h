#pragma once

#include <span>
#include <vector>

#include "alidade/localize/filter/filter.h"

namespace alidade {

/// One hypothesis of the initial pose and motion; `cost` is −2 ln of its weight.
struct StartHypothesis {
  CameraMotion motion;
  MotionMatrix cov = MotionMatrix::Zero();
  double cost = 0.0;
};

/// Parallel filters with different initial guesses, until the observations decide. In front of a small or flat target,
/// sideways translation and rotation look alike: the posterior of the first frames is a long curved valley, a Gaussian
/// fitted to it is overconfident, and one in ten runs diverges. So the prior of the sideways speed is split into
/// narrower ones (a Gaussian sum; D. L. Alspach & H. W. Sorenson, "Nonlinear Bayesian Estimation Using Gaussian Sum
/// Approximations", IEEE TAC 17(4), 1972), each weighted by its likelihood. The two possible poses of a flat
/// target are two hypotheses.
class FilterBank {
 public:
  FilterBank(const Camera& camera, std::span<const StartHypothesis> starts, const LocalizationFilterConfig& filter,
             const FilterBankConfig& config = {});

  void predict(double dt_s);
  ObservationsReport update(std::span<const FeatureObservation> observations);
  void add_known(long id, const Eigen::Vector3d& point_in_world, double sigma_m);
  /// False if the best filter cannot add it.
  bool add(long id, const Eigen::Vector2d& px, const RangePrior& prior, FeatureKind kind = FeatureKind::inverse_depth);
  void remove(long id);
  int convert_linear();
  void fit_frame();
  /// Restarts from these hypotheses and keeps the map.
  void restart(std::span<const StartHypothesis> starts);

  [[nodiscard]] const LocalizationFilter& best() const { return parts_[best_].filter; }
  [[nodiscard]] std::size_t size() const { return parts_.size(); }

 private:
  struct Part {
    LocalizationFilter filter;
    double cost;
  };
  [[nodiscard]] std::vector<StartHypothesis> split(std::span<const StartHypothesis> starts) const;
  void prune();

  FilterBankConfig config_;
  std::vector<Part> parts_;
  std::size_t best_ = 0;
  int num_updates_ = 0;
};

}  // namespace alidade
