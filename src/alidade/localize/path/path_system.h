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

// The work behind path_smoother.h: its factors in path_observations.cpp and path_factors.cpp, its weights in
// path_weights.cpp, its steps and what comes
// of them in path_smoother.cpp.

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
  double observed_cost = 0.0;  ///< Of that, the observations'.
  bool has_given = false;      ///< What is given and not solved for stands in the border, too.
  /// With that, what the motion's part of the cost asks of each pose and point: −½ of its derivatives.
  PoseChain::Steps motion_pull = {};
};

/// Behind the lens in the border: see given_numbers.h.
inline constexpr int num_causes = 9, scale_cause = 0, shape_cause = 1, speed_cause = 2, readout_cause = 5,
                     turn_cause = 6;

class PathSmoother {
 public:
  explicit PathSmoother(const SmootherProblem& problem);

  std::optional<SmoothedPath> solve();

  using WindowRows = Eigen::Matrix<double, 6, PoseChain::window>;

 private:
  /// Of the shared parameters those that are solved for, which stand first: an IMU's, then the estimated part of the
  /// lens.
  [[nodiscard]] int num_solved() const { return lens_at_ + num_estimated_; }
  static constexpr double well = 1e-3;
  [[nodiscard]] bool settle(double settled = well);
  [[nodiscard]] std::optional<SmootherSystem> begun();
  [[nodiscard]] std::optional<SmootherSystem> step_along(const SmootherSystem& system);
  [[nodiscard]] std::optional<SmootherSystem> short_step(double& share);
  void keep_steps_short(const SmootherState& state, std::size_t k, SmootherSystem& system) const;
  enum class Shared { solved, all };  ///< What stands in the border: all only for what comes of a solution.
  [[nodiscard]] std::optional<SmootherSystem> build(const SmootherState& state, Shared shared,
                                                    double most = std::numeric_limits<double>::infinity(),
                                                    std::optional<std::size_t>* vague = nullptr) const;
  [[nodiscard]] SmootherState moved_by(const Eigen::VectorXd& shared, const PoseChain::Steps& steps,
                                       double share) const;
  void find_lives();
  void add_given_lens(const SmootherState& state, SmootherSystem& system) const;
  void add_given_point(const SmootherState& state, std::size_t point, SmootherSystem& system) const;
  using Twist = Eigen::Vector<double, 6>;  ///< How fast a pose changes: in the world, and on the right. [m/s, rad/s]
  [[nodiscard]] Twist twist_at(const SmootherState& state, std::size_t k) const;
  using GivenRows = Eigen::Matrix<double, 2, Eigen::Dynamic, 0, 2, 16 + num_causes>;
  [[nodiscard]] GivenRows given_rows(const ExpectedView& view, std::size_t i, const Twist& twist) const;
  /// An observation as it is at a state, over its σ.
  struct ObservationRows {
    Eigen::Vector2d error;
    Eigen::Matrix<double, 2, 6> J_pose;
    Eigen::Matrix<double, 2, 3> J_point;
    GivenRows J_shared;
  };
  /// Of the frames of a window, each at its number modulo three; `next` is the first that is not there yet.
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
  /// path_weights.cpp.
  [[nodiscard]] bool weigh_points();
  [[nodiscard]] double gate_of(const UsedObservation& observation, std::size_t point) const;
  [[nodiscard]] bool settle_all();
  /// path_lens.cpp.
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
    Eigen::Vector3d by_position;  ///< Of its logarithm.
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
  /// What is left of the normal equations for what is given, all that is solved for at its best.
  struct Asked {
    Eigen::MatrixXd J;  ///< Of all that is shared, by what is given.
    Eigen::MatrixXd information;
    Eigen::VectorXd score;  ///< Without what the motion says.
  };
  [[nodiscard]] double motion_score(const SmootherSystem& system, const Eigen::VectorXd& direction,
                                    const PoseChain::Steps& at_rest) const;
  [[nodiscard]] double best_cause(const Asked& all) const;
  [[nodiscard]] ResidualMoves moves_by_lens(const Eigen::MatrixXd& considered, const Asked& asked,
                                            const PoseChain::Spread& spread) const;
  /// path_imu.cpp.
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
  /// The observations within the gate of where they are expected now. Whether these are others than before.
  [[nodiscard]] bool choose_observations();
  [[nodiscard]] Eigen::MatrixXd lens_information() const;
  [[nodiscard]] Asked asked(const SmootherSystem& system) const;
  [[nodiscard]] Eigen::MatrixXd considered_cov() const;
  void fill_map(std::span<const Eigen::Matrix3d> covs, SmoothedPath& path) const;
  void fill_lens(const Eigen::MatrixXd& cov, SmoothedPath& path) const;
  void add_clock(SmoothedPath& path) const;
  /// path_gauge.cpp.
  void align(const SmootherSystem& system, const Eigen::MatrixXd& considered, PoseChain::Spread& spread) const;
  void fill_frame(const SmootherSystem& system, const Eigen::MatrixXd& considered, const PoseChain::Spread& spread,
                  SmoothedPath& path) const;
  void widen_frame(std::span<const Eigen::Vector3d> moves, double more, SmoothedPath& path) const;
  /// path_profile.cpp.
  void widen(double min_cost, SmoothedPath& path);
  [[nodiscard]] bool fix_weakest(const SmoothedPath& path);
  void add_fixed(const SmootherState& state, SmootherSystem& system) const;
  [[nodiscard]] SmoothedPath result(const SmootherSystem& system) const;
  [[nodiscard]] SmoothedPath finished(const SmootherSystem& system);

  const SmootherProblem& problem_;
  std::vector<UsedObservation> observations_;  ///< Those that fit,
  std::vector<std::size_t> point_of_;          ///< and the index of the point of each.
  std::vector<std::size_t> first_of_;          ///< Of each frame the first of them.
  /// What an observation's error shares with that of the one of the same point before it.
  struct Link {
    std::optional<std::size_t> before;  ///< Of at most two frames before.
    double correlation = 0.0;
    double weight = 1.0;  ///< Of what is new of it.
  };
  ResidualStructure structure_;
  std::vector<Link> links_;  ///< Of each observation; none: errors are independent.
  double link_correlation_ = 0.0;
  std::vector<double> error_factors_;  ///< Of each point.
  double usual_variance_ = 1.0;
  std::map<long, std::size_t> index_of_;
  std::vector<int> lens_order_;  ///< Those estimated, then the others.
  std::vector<double> sigma_estimated_;
  int num_estimated_ = 0;
  bool is_lens_freed_ = false;  ///< What was given of it contradicts the observations: estimated without it.
  int lens_at_ = 0;
  int causes_at_ = 0;  ///< The target's scale and shape, its speed, and the image's readout: tested, not solved for.
  Eigen::Vector3d target_centre_ = Eigen::Vector3d::Zero();
  double mid_s_ = 0.0;
  /// A combination of one pose's components that is fixed at a value while all else is solved for.
  struct FixedCombination {
    std::size_t frame = 0;
    Rigid3 from;
    Eigen::Vector<double, 6> weights;  ///< Of the right perturbation.
    double value = 0.0, sigma = 1.0;
  };
  std::optional<FixedCombination> fixed_;
  Eigen::VectorXd given_lens_;
  SmootherState state_;
  std::vector<std::optional<ImuStepAt>> steps_;              ///< Of an IMU, from each frame to the next.
  std::vector<bool> rates_used_, forces_used_;               ///< Of each step; of each frame and the two after it.
  double rate_noise_ = 1.0, force_noise_ = 1.0;              ///< By which the given variances are larger,
  double rate_noise_floor_ = 1.0, force_noise_floor_ = 1.0;  ///< and are by the readings alone.
  double rate_walk_ = 1.0, force_walk_ = 1.0;                ///< By which those of the biases' walks are,
  double clock_rate_ = 1.0;                                  ///< and that of the clock's rate.
  /// The frames in which a point is in the equations, by its observations; none: it has no part in them.
  struct Life {
    std::size_t first = 0, last = 0;
  };
  std::vector<std::optional<Life>> lives_;
  std::vector<std::vector<std::size_t>> entering_, leaving_, there_;  ///< Points, by frame.
  int max_at_once_ = 0;
  double step_share_ = 0.0;  ///< Of the distances, that steps are kept to; 0: not kept.
};

}  // namespace alidade
