#pragma once

#include <Eigen/Core>
#include <array>
#include <span>
#include <vector>

#include "alidade/localize/camera_motion.h"
#include "alidade/localize/filter/feature.h"
#include "alidade/localize/filter/state_covariance.h"
#include "alidade/localize/filter/world_scale.h"

namespace alidade {

/// Consider parameters: how a filter's state depends on what it takes as given: the lens, where not in the state, and
/// the target's scale. The filter's gains are those of one that takes these as exact; what their covariance Σ adds to
/// the state's is M Σ Mᵀ, with M = ∂state/∂given carried beside it: M ← F M in a prediction, M ← M − P⁺ Hᵀ R⁻¹ (H M +
/// H_g) in an update, and as P where errors are counted again (S. F. Schmidt, "Application of State-Space Methods to
/// Navigation Problems", 1966; here the gains do not know of it). Score tests of the given numbers follow from it:
/// with D = H M + H_g, score Dᵀ S⁻¹ ν = Dᵀ R⁻¹ r of the residuals r, and information Dᵀ R⁻¹ (D + H (M⁺ − M)).
/// Allocates nothing after its construction.
class GivenEffects {
 public:
  static constexpr int max_given = 17;  ///< A lens's parameters and the scale.
  using Columns = Eigen::Matrix<double, Eigen::Dynamic, Eigen::Dynamic>;

  GivenEffects() = default;
  /// Of the lens: fx, fy, cx, cy, k1, a port's water, gap and normal, and whatever has a covariance, except
  /// `estimated`.
  GivenEffects(const Camera& camera, std::span<const int> estimated, double sigma_scale, int capacity,
               int observations);

  [[nodiscard]] int num() const { return static_cast<int>(M_.cols()); }
  [[nodiscard]] const std::vector<int>& lens_params() const { return lens_params_; }  ///< Then the scale.
  [[nodiscard]] const Eigen::MatrixXd& cov() const { return cov_; }                   ///< Σ; zero where none is known.
  [[nodiscard]] const Eigen::VectorXd& score() const { return score_; }
  [[nodiscard]] const Eigen::MatrixXd& information() const { return information_; }
  /// Of the score, as the observations of one point share their errors and those of different points do not: Σ s sᵀ of
  /// what each adds to it.
  [[nodiscard]] Eigen::MatrixXd score_cov() const { return of_left_ + by_point_.transpose() * by_point_; }
  [[nodiscard]] bool counts() const { return counts_; }  ///< Whether Σ is anything.
  [[nodiscard]] auto rows(int first, int count) const { return M_.middleRows(first, count); }

  void predict(const MotionMatrix& F);
  void add_known(int offset, const Eigen::Vector3d& point_in_world);
  void add(int offset, const NewFeature& made, std::span<const int> estimated, const ScaleReading& scale);
  void remove(int offset, int count, int dim);  ///< `dim` before.
  void make_place(int offset, const Eigen::Matrix<double, 3, 6>& J);
  void forget_motion();  ///< Of a camera that is localised again; and what was scored.
  /// As those of StateCovariance.
  void turn(const double* blocks, int stride, int single_at, int num_single, int dim);
  void shear(int at, const double* K, int stride, int dim);
  void shear_along(std::span<const int> columns, std::span<const double> weights, const double* u, int dim);

  /// The observations of an update, at the state that they led to; then what they change.
  void add_observation(const ExpectedView& view, const Feature& feature, std::span<const int> estimated,
                       const Eigen::Vector2d& residual_px, double variance_px2);
  void finish(const StateCovariance& P);

 private:
  using Derivatives = Eigen::Matrix<double, 2, Eigen::Dynamic, 0, 2, max_given>;
  struct Seen {
    std::array<int, StateCovariance::max_support> columns{};
    Eigen::Matrix<double, 2, StateCovariance::max_support> H;
    int num = 0;
    Derivatives D;
    double weight = 1.0;
  };
  [[nodiscard]] double read(std::span<const int> columns, std::span<const double> weights, Eigen::Index given) const;
  [[nodiscard]] Derivatives product(const Seen& seen, const Columns& M) const;

  std::vector<int> lens_params_;
  Eigen::MatrixXd cov_, information_;
  Eigen::VectorXd score_;
  Columns M_, change_, G_;
  std::vector<int> rows_;  ///< Of G those that are not zero, and two columns of them.
  std::array<std::vector<double>, 2> weights_;
  Columns by_point_;         ///< What each feature adds to the score, in the row of its first number.
  Eigen::MatrixXd of_left_;  ///< Σ s sᵀ of those that have left.
  std::vector<Seen> seen_;
  std::size_t max_seen_ = 0;
  bool counts_ = false;
};

}  // namespace alidade
