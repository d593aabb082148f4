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

/// Consider parameters: sensitivity of a filter's state to what it takes as given: the lens, unless in the state, and
/// the scale of the target. The gains are computed as if these were exact; their covariance Σ adds M Σ Mᵀ to the
/// covariance of the state, with M = ∂state/∂given propagated beside it: M ← F M in a prediction,
/// M ← M − P⁺ Hᵀ R⁻¹ (H M + H_g) in an update, and like P where the errors are re-referenced (S. F. Schmidt,
/// "Application of State-Space Methods to Navigation Problems", 1966; unlike there, the gains ignore Σ). Score tests of
/// the given numbers follow from it: with D = H M + H_g, score Dᵀ S⁻¹ ν = Dᵀ R⁻¹ r of the residuals r, and information
/// Dᵀ R⁻¹ (D + H (M⁺ − M)). Allocates nothing after its construction.
class GivenEffects {
 public:
  static constexpr int max_given = 17;  ///< Lens parameters and the scale.
  using Columns = Eigen::Matrix<double, Eigen::Dynamic, Eigen::Dynamic>;

  GivenEffects() = default;
  /// Lens parameters considered: fx, fy, cx, cy, k1, a port's water index, gap and normal, and every one that has a
  /// covariance, except those in `estimated`.
  GivenEffects(const Camera& camera, std::span<const int> estimated, double sigma_scale, int capacity,
               int observations);

  [[nodiscard]] int num() const { return static_cast<int>(M_.cols()); }
  [[nodiscard]] const std::vector<int>& lens_params() const { return lens_params_; }  ///< The scale follows them.
  [[nodiscard]] const Eigen::MatrixXd& cov() const { return cov_; }                   ///< Σ; zero where unknown.
  [[nodiscard]] const Eigen::VectorXd& score() const { return score_; }
  [[nodiscard]] const Eigen::MatrixXd& information() const { return information_; }
  /// Cluster-robust covariance of the score: observations of one point share errors, those of different points do not;
  /// Σ s sᵀ over the points, with s the contribution of one point.
  [[nodiscard]] Eigen::MatrixXd score_cov() const { return of_left_ + by_point_.transpose() * by_point_; }
  [[nodiscard]] bool counts() const { return counts_; }  ///< Whether Σ is non-zero.
  [[nodiscard]] auto rows(int first, int count) const { return M_.middleRows(first, count); }

  void predict(const MotionMatrix& F);
  void add_known(int offset, const Eigen::Vector3d& point_in_world);
  void add(int offset, const NewFeature& made, std::span<const int> estimated, const ScaleReading& scale);
  void remove(int offset, int count, int dim);  ///< `dim`: state size before.
  void make_place(int offset, const Eigen::Matrix<double, 3, 6>& J);
  void forget_motion();  ///< After a relocalisation: resets the camera's rows and the scores.
  /// The same operations as those of StateCovariance.
  void turn(const double* blocks, int stride, int single_at, int num_single, int dim);
  void shear(int at, const double* K, int stride, int dim);
  void shear_along(std::span<const int> columns, std::span<const double> weights, const double* u, int dim);

  /// Adds an observation of an update, linearised at the updated state; finish() then applies their effect on M.
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
  std::vector<int> rows_;  ///< Non-zero rows of G; `weights_`: two columns of them.
  std::array<std::vector<double>, 2> weights_;
  Columns by_point_;         ///< Contribution of each feature to the score, in its first row.
  Eigen::MatrixXd of_left_;  ///< Σ s sᵀ of the features that were removed.
  std::vector<Seen> seen_;
  std::size_t max_seen_ = 0;
  bool counts_ = false;
};

}  // namespace alidade
