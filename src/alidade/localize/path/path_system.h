#pragma once

#include <Eigen/Core>
#include <map>
#include <optional>
#include <span>
#include <vector>

#include "alidade/localize/path/path_smoother.h"
#include "alidade/localize/path/pose_chain.h"

// The work behind path_smoother.h: its factors in path_factors.cpp, its steps and what comes of them in
// path_smoother.cpp.

namespace alidade {

struct SmootherState {
  Camera camera;
  std::vector<Rigid3> poses;
  std::vector<Eigen::Vector3d> points;
};

struct SmootherSystem {
  PoseChain chain;
  double cost = 0.0;
};

/// Behind the lens in the border: see given_numbers.h.
inline constexpr int num_causes = 6, scale_cause = 0, shape_cause = 1, speed_cause = 2, readout_cause = 5;

class PathSmoother {
 public:
  explicit PathSmoother(const SmootherProblem& problem);

  std::optional<SmoothedPath> solve();

 private:
  /// Of the shared numbers those that are solved for: the estimated part of the lens, which stands first.
  [[nodiscard]] int num_solved() const { return num_estimated_; }
  [[nodiscard]] bool settle();
  [[nodiscard]] std::optional<SmootherSystem> build(const SmootherState& state) const;
  [[nodiscard]] SmootherState moved_by(const Eigen::VectorXd& shared, const PoseChain::Steps& steps,
                                       double share) const;
  void find_lives();
  void add_told_lens(const SmootherState& state, SmootherSystem& system) const;
  void add_told_point(const SmootherState& state, std::size_t point, SmootherSystem& system) const;
  using Twist = Eigen::Vector<double, 6>;  ///< How fast a pose changes: in the world, and on the right. [m/s, rad/s]
  [[nodiscard]] Twist twist_at(const SmootherState& state, std::size_t k) const;
  using GivenRows = Eigen::Matrix<double, 2, Eigen::Dynamic, 0, 2, 16 + num_causes>;
  [[nodiscard]] GivenRows given_rows(const ExpectedView& view, const UsedObservation& observation,
                                     const Twist& twist) const;
  [[nodiscard]] bool add_observation(const SmootherState& state, const UsedObservation& observation, const Twist& twist,
                                     SmootherSystem& system) const;
  void add_range(const SmootherState& state, std::size_t point, SmootherSystem& system) const;
  struct Speeds {
    Eigen::Vector<double, 6> values;
    Eigen::Matrix<double, 6, 6> J_from, J_to;
  };
  [[nodiscard]] Speeds speeds(const SmootherState& state, std::size_t i) const;
  void add_motion(const SmootherState& state, std::size_t k, SmootherSystem& system) const;
  void add_start(const SmootherState& state, SmootherSystem& system) const;
  [[nodiscard]] Eigen::Vector3d shape_change(const Eigen::Vector3d& told_in_world) const;
  /// The observations within the gate of where they are expected now. Whether these are others than before.
  [[nodiscard]] bool choose_observations();
  [[nodiscard]] Eigen::MatrixXd lens_information() const;
  [[nodiscard]] Eigen::MatrixXd considered_cov() const;
  void fill_map(std::span<const Eigen::Matrix3d> covs, SmoothedPath& path) const;
  void fill_lens(const Eigen::MatrixXd& cov, SmoothedPath& path) const;
  void add_clock(SmoothedPath& path) const;
  /// path_gauge.cpp.
  void align(const SmootherSystem& system, const Eigen::MatrixXd& considered, PoseChain::Spread& spread) const;
  /// path_profile.cpp.
  void widen(double min_cost, SmoothedPath& path);
  [[nodiscard]] bool hold_weakest(const SmoothedPath& path);
  void add_held(const SmootherState& state, SmootherSystem& system) const;
  [[nodiscard]] SmoothedPath result(const SmootherSystem& system) const;

  const SmootherProblem& problem_;
  std::vector<UsedObservation> observations_;  ///< Those that fit.
  std::map<long, std::size_t> index_of_;
  std::vector<int> lens_order_;  ///< Those estimated, then the others.
  int num_estimated_ = 0;
  static constexpr int lens_at_ = 0;
  int causes_at_ = 0;  ///< The target's scale and shape, its speed, and the image's readout: tested, not solved for.
  Eigen::Vector3d target_middle_ = Eigen::Vector3d::Zero();
  double middle_s_ = 0.0;
  /// A combination of one pose's numbers that is held at a value while all else is solved for.
  struct Held {
    std::size_t frame = 0;
    Rigid3 from;
    Eigen::Vector<double, 6> weights;  ///< Of the right perturbation.
    double value = 0.0, sigma = 1.0;
  };
  std::optional<Held> held_;
  Eigen::VectorXd told_lens_;
  SmootherState state_;
  /// The frames in which a point is in the equations, by its observations; none: it has no part in them.
  struct Life {
    std::size_t first = 0, last = 0;
  };
  std::vector<std::optional<Life>> lives_;
  std::vector<std::vector<std::size_t>> entering_, leaving_;  ///< Points, by frame.
  int most_at_once_ = 0;
};

}  // namespace alidade
