#pragma once

#include <Eigen/Core>
#include <array>
#include <limits>
#include <map>
#include <optional>
#include <span>
#include <vector>

#include "alidade/localize/checks/residual_structure.h"
#include "alidade/localize/path/path_smoother.h"
#include "alidade/localize/path/pose_chain.h"

// Implementation of path_smoother.h: factors in path_observations.cpp and
// path_factors.cpp, weights in path_weights.cpp, Gauss–Newton steps and the results in
// path_smoother.cpp.

namespace alidade {

struct SmootherState {
  Camera camera;
  std::vector<Rigid3> poses;
  std::vector<Eigen::Vector3d> points;
  ImuState imu;
};

struct SmootherSystem {
  PoseChain chain;
  double cost = 0.0;
  double observed_cost = 0.0;  ///< The part of it from observations.
  bool has_given = false;      ///< Given numbers that are not estimated are in the border, too.
  /// If so: minus half the gradient of the motion's cost, by pose and point.
  PoseChain::Steps motion_pull = {};
};

/// Offsets of the causes behind the lens in the border: see given_numbers.h.
inline constexpr int num_causes = 9, scale_cause = 0, shape_cause = 1, speed_cause = 2, readout_cause = 5,
                     turn_cause = 6;

class PathSmoother {
 public:
  explicit PathSmoother(const SmootherProblem& problem);

  std::optional<SmoothedPath> solve();

  using WindowRows = Eigen::Matrix<double, 6, PoseChain::window>;

 private:
  /// Number of shared parameters that are estimated; they come first: the IMU's, then the estimated part of the
  /// lens.
  [[nodiscard]] int num_solved() const { return lens_at_ + num_estimated_; }
  static constexpr double well = 1e-3;
  [[nodiscard]] bool settle(double settled = well);
  [[nodiscard]] std::optional<SmootherSystem> begun();
  [[nodiscard]] std::optional<SmootherSystem> step_along(const SmootherSystem& system);
  [[nodiscard]] std::optional<SmootherSystem> short_step(double& share);
  void keep_steps_short(const SmootherState& state, std::size_t k, SmootherSystem& system) const;
  enum class Shared { solved, all };  ///< Content of the border; `all` only to evaluate a solution.
  [[nodiscard]] std::optional<SmootherSystem> build(const SmootherState& state, Shared shared,
                                                    double most = std::numeric_limits<double>::infinity(),
                                                    std::optional<std::size_t>* vague = nullptr) const;
  [[nodiscard]] SmootherState moved_by(const Eigen::VectorXd& shared, const PoseChain::Steps& steps,
                                       double share) const;
  void find_lives();
  void add_given_lens(const SmootherState& state, SmootherSystem& system) const;
  void add_given_point(const SmootherState& state, std::size_t point, SmootherSystem& system) const;
  using Twist = Eigen::Vector<double, 6>;  ///< Rate of a pose: velocity in the world, right angular rate. [m/s, rad/s]
  [[nodiscard]] Twist twist_at(const SmootherState& state, std::size_t k) const;
  using GivenRows = Eigen::Matrix<double, 2, Eigen::Dynamic, 0, 2, 16 + num_causes>;
  [[nodiscard]] GivenRows given_rows(const ExpectedView& view, std::size_t i, const Twist& twist) const;
  /// Residual and Jacobians of an observation at a state, over its σ.
  struct ObservationRows {
    Eigen::Vector2d error;
    Eigen::Matrix<double, 2, 6> J_pose;
    Eigen::Matrix<double, 2, 3> J_point;
    GivenRows J_shared;
  };
  /// Rows of the window's frames, each at its index modulo three; `next`: the first frame not computed yet.
  struct Lookahead {
    std::array<std::vector<ObservationRows>, 3> of_frame;
    std::size_t next = 0;
  };
  [[nodiscard]] std::optional<ObservationRows> rows_of(const SmootherState& state, std::size_t i, const Twist& twist,
                                                       bool has_given) const;
  [[nodiscard]] bool look_ahead(const SmootherState& state, std::size_t to, bool has_given, Lookahead& rows) const;
  void add(const ObservationRows& rows, const ObservationRows* before, double share, int row, int at,
           SmootherSystem& system) const;
  [[nodiscard]] bool add_observations(const SmootherState& state, std::size_t k, Lookahead& rows,
                                      SmootherSystem& system) const;
  void link_observations(double correlation);
  [[nodiscard]] std::vector<PlacedResidual> placed_residuals() const;
  [[nodiscard]] bool heed_colour();
  /// In path_weights.cpp.
  [[nodiscard]] bool weigh_points();
  [[nodiscard]] double gate_of(const UsedObservation& observation, std::size_t point) const;
  [[nodiscard]] bool settle_all();
  /// In path_lens.cpp.
  [[nodiscard]] bool asks_for_lens(const SmootherSystem& system) const;
  void free_lens();
  void estimate_lens(std::vector<int> estimated);
  void fill_hidden(const PoseChain::Spread& spread, SmoothedPath& path) const;
  void count_hidden(SmoothedPath& path) const;
  void add_range(const SmootherState& state, std::size_t point, SmootherSystem& system) const;
  struct Speeds {
    Eigen::Vector<double, 6> values;
    Eigen::Matrix<double, 6, 6> J_from, J_to;
  };
  [[nodiscard]] Speeds speeds(const SmootherState& state, std::size_t i) const;
  struct Surroundings {
    double size = 1.0;
    Eigen::Vector3d by_position;  ///< Derivative of ln(size).
    Eigen::VectorXd by_border;
    Eigen::Matrix3d world_from_cam;
  };
  [[nodiscard]] Surroundings surroundings(const SmootherState& state, std::size_t k, const PoseChain& chain) const;
  void add_acceleration(const Surroundings& around, const WindowRows& J, Eigen::Vector<double, 6> error,
                        const Eigen::Vector<double, 6>& variance, SmootherSystem& system) const;
  [[nodiscard]] double num_steps(std::size_t k) const;
  [[nodiscard]] Eigen::Vector<double, 6> step_variance() const;
  void add_first_speeds(const Speeds& first, std::size_t k, SmootherSystem& system) const;
  void add_motion(const SmootherState& state, std::size_t k, SmootherSystem& system) const;
  void add_motion_and_pull(const SmootherState& state, std::size_t k, SmootherSystem& system) const;
  void add_start(const SmootherState& state, SmootherSystem& system) const;
  /// Normal equations reduced to the given numbers: all estimated ones at their optimum.
  struct Asked {
    Eigen::MatrixXd J;  ///< ∂(shared parameters)/∂(given numbers).
    Eigen::MatrixXd information;
    Eigen::VectorXd score;  ///< Without the contribution of the motion.
  };
  [[nodiscard]] double motion_score(const SmootherSystem& system, const Eigen::VectorXd& direction,
                                    const PoseChain::Steps& at_rest) const;
  [[nodiscard]] double best_cause(const Asked& all) const;
  [[nodiscard]] ResidualMoves moves_by_lens(const Eigen::MatrixXd& considered, const Asked& asked,
                                            const PoseChain::Spread& spread) const;
  /// In path_imu.cpp.
  void begin_imu();
  void leave_out_blows();
  [[nodiscard]] bool uses_rates(std::size_t k) const { return k < rates_used_.size() && rates_used_[k]; }
  [[nodiscard]] bool uses_forces(std::size_t k) const { return k < forces_used_.size() && forces_used_[k]; }
  [[nodiscard]] ImuRows rates_at(const SmootherState& state, std::size_t k) const;
  [[nodiscard]] ImuRows forces_at(const SmootherState& state, std::size_t k) const;
  [[nodiscard]] double rates_variance(std::size_t k) const;
  [[nodiscard]] double forces_variance(std::size_t k) const;
  void add_imu(const SmootherState& state, std::size_t k, SmootherSystem& system) const;
  void add_given_imu(const SmootherState& state, SmootherSystem& system) const;
  static void add_given_axes(const ImuState& is, double sigma, PoseChain& chain, double& cost);
  [[nodiscard]] bool choose_steps();
  [[nodiscard]] bool choose_walks();
  void fill_imu(const SmootherSystem& system, const Eigen::MatrixXd& cov, const Asked& asked, SmoothedPath& path) const;
  [[nodiscard]] Eigen::Vector3d shape_change(const Eigen::Vector3d& given_in_world) const;
  /// Selects the observations within the gate of their predictions. Returns whether the selection changed.
  [[nodiscard]] bool choose_observations();
  [[nodiscard]] Eigen::MatrixXd lens_information() const;
  [[nodiscard]] Asked asked(const SmootherSystem& system) const;
  [[nodiscard]] Eigen::MatrixXd considered_cov() const;
  void fill_map(std::span<const Eigen::Matrix3d> covs, SmoothedPath& path) const;
  void fill_lens(const Eigen::MatrixXd& cov, SmoothedPath& path) const;
  void add_clock(SmoothedPath& path) const;
  /// In path_gauge.cpp.
  void align(const SmootherSystem& system, const Eigen::MatrixXd& considered, PoseChain::Spread& spread) const;
  void fill_frame(const SmootherSystem& system, const Eigen::MatrixXd& considered, const PoseChain::Spread& spread,
                  SmoothedPath& path) const;
  void widen_frame(std::span<const Eigen::Vector3d> moves, double more, SmoothedPath& path) const;
  /// In path_profile.cpp.
  void widen(double min_cost, SmoothedPath& path);
  [[nodiscard]] bool fix_weakest(const SmoothedPath& path);
  void add_fixed(const SmootherState& state, SmootherSystem& system) const;
  [[nodiscard]] SmoothedPath result(const SmootherSystem& system) const;
  [[nodiscard]] SmoothedPath finished(const SmootherSystem& system);

  const SmootherProblem& problem_;
  std::vector<UsedObservation> observations_;  ///< Those that fit,
  std::vector<std::size_t> point_of_;          ///< and the index of the point of each.
  std::vector<std::size_t> first_of_;          ///< Index of the first observation of each frame.
  /// Correlation of an observation's error with that of the previous observation of the same point.
  struct Link {
    std::optional<std::size_t> before;  ///< At most two frames earlier.
    double correlation = 0.0;
    double weight = 1.0;  ///< Of the innovation of its error.
  };
  ResidualStructure structure_;
  std::vector<Link> links_;  ///< One per observation; empty: errors are independent.
  double link_correlation_ = 0.0;
  std::vector<double> error_factors_;  ///< One per point.
  double usual_variance_ = 1.0;
  std::map<long, std::size_t> index_of_;
  std::vector<int> lens_order_;  ///< The estimated ones, then the others.
  std::vector<double> sigma_estimated_;
  int num_estimated_ = 0;
  bool is_lens_freed_ = false;  ///< The observations contradict the given lens: estimated without it as prior.
  int lens_at_ = 0;
  int causes_at_ = 0;  ///< The target's scale, shape and motion, and the readout: tested, not estimated.
  Eigen::Vector3d target_centre_ = Eigen::Vector3d::Zero();
  double mid_s_ = 0.0;
  /// A linear combination of one pose's components, fixed at a value while all else is estimated.
  struct FixedCombination {
    std::size_t frame = 0;
    Rigid3 from;
    Eigen::Vector<double, 6> weights;  ///< Of the right perturbation.
    double value = 0.0, sigma = 1.0;
  };
  std::optional<FixedCombination> fixed_;
  Eigen::VectorXd given_lens_;
  SmootherState state_;
  std::vector<std::optional<ImuStepAt>> steps_;              ///< IMU steps, from each frame to the next.
  std::vector<bool> rates_used_, forces_used_;               ///< Per step; per frame and the two after it.
  double rate_noise_ = 1.0, force_noise_ = 1.0;              ///< Factors on the given variances,
  double rate_noise_floor_ = 1.0, force_noise_floor_ = 1.0;  ///< and their lower bounds from the readings alone.
  double rate_walk_ = 1.0, force_walk_ = 1.0;                ///< Factors on the variances of the bias walks,
  double clock_rate_ = 1.0;                                  ///< and of the clock's rate.
  /// First and last frame of a point in the equations; empty: it is not in them.
  struct Life {
    std::size_t first = 0, last = 0;
  };
  std::vector<std::optional<Life>> lives_;
  std::vector<std::vector<std::size_t>> entering_, leaving_, there_;  ///< Points, by frame.
  int max_at_once_ = 0;
  double step_share_ = 0.0;  ///< Limit of a step relative to the distances; 0: no limit.
};

}  // namespace alidade
