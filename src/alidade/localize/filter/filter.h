#pragma once

#include <Eigen/Core>
#include <array>
#include <optional>
#include <span>
#include <vector>

#include "alidade/localize/config.h"
#include "alidade/localize/filter/feature.h"
#include "alidade/localize/filter/fitted_frame.h"
#include "alidade/localize/filter/given_effects.h"
#include "alidade/localize/filter/state_covariance.h"
#include "alidade/localize/filter/world_scale.h"

namespace alidade {

class WorldRotation;

enum class ObservationOutcome {
  used,
  gated,        ///< Innovation outside the gate.
  not_in_map,   ///< No feature with this id.
  not_visible,  ///< The feature is outside the domain of the lens or behind the camera.
};

/// Predicted pixel of a feature with its covariance: search its 3σ ellipse.
struct ExpectedObservation {
  Eigen::Vector2d px;
  Eigen::Matrix2d S;  ///< Innovation covariance, including the pixel noise. [px²]
  double depth_m = 0.0;
};

/// Result of an update with the observations of one instant.
struct ObservationsReport {
  std::span<const ObservationOutcome> outcomes;  ///< One per observation; valid until the next update.
  /// νᵀS⁻¹ν of each when it was processed, given those used before it (in a group: its share); NaN if not predicted.
  std::span<const double> nis;
  std::size_t num_used = 0, num_gated = 0;
  double nis_per_dof = 0.0;  ///< Over all used observations together; 0 if none was used.
  /// −2 ln of the likelihood of the observations: νᵀS⁻¹ν + ln det 2πS of the used ones, at the updated state (Laplace
  /// approximation); a gated one is taken as uniform in a window of 100 px, with an outlier probability of 0.1.
  double cost = 0.0;
  bool is_sound = true;  ///< False: the result was not positive definite or not finite; the state is unchanged.
};

/// Motion of a camera and a map of the points that it observes: an error-state extended Kalman filter over the camera's
/// motion, the lens if requested, and positions and inverse depths of the points. Typical use:
///     predict(dt);  expected(id) …;  update(observations);  add(id, px, prior) …;  remove(id)
/// Allocates nothing after construction, unless the map holds more features than ever before.
/// A. J. Davison et al., PAMI 29(6), 2007; J. Civera et al., TRO 24(5), 2008; docs/maths/localization.md.
class LocalizationFilter {
 public:
  LocalizationFilter(Camera camera, const CameraMotion& start, const MotionMatrix& start_cov,
                     LocalizationFilterConfig config = {});

  void predict(double dt_s);
  /// Updates the state with the observations of one instant.
  ObservationsReport update(std::span<const FeatureObservation> observations);
  /// Adds a known point; sigma_m is the σ of each coordinate. False if there is no room or the id exists already.
  bool add_known(long id, const Eigen::Vector3d& point_in_world, double sigma_m);
  /// Adds a feature on the ray of its pixel, fully correlated with camera and lens. False if there is no room, the id
  /// exists already, or the lens has no ray for the pixel.
  bool add(long id, const Eigen::Vector2d& px, const RangePrior& prior, FeatureKind kind = FeatureKind::inverse_depth);
  void remove(long id);
  /// Aligns frame and scale of the state with its known points as they were given: see fitted_frame.h. For a world
  /// whose frame and scale are determined by these points only.
  void fit_frame();
  /// Whether `count` more components fit into the state.
  [[nodiscard]] bool has_room(int count) const { return P_.dim() + count <= config_.state_capacity; }
  /// Converts inverse depths that are nearly linear to positions, with half the components; returns how many.
  int convert_linear();
  /// Relocalisation: drops the correlations between camera and map, and keeps the map.
  void place_camera(const CameraMotion& motion, const MotionMatrix& cov);

  /// Predicted observation of a feature. Empty if it is not in the map or not visible.
  [[nodiscard]] std::optional<ExpectedObservation> expected(long id) const;
  [[nodiscard]] bool has(long id) const { return find(id) != nullptr; }
  [[nodiscard]] const std::vector<Feature>& features() const { return features_; }
  /// Position of a feature and its covariance, including the contribution of the given numbers. Empty: not in the map.
  struct Place {
    Eigen::Vector3d point_in_world;
    Eigen::Matrix3d cov;
  };
  [[nodiscard]] std::optional<Place> place(long id) const;

  [[nodiscard]] const CameraMotion& motion() const { return motion_; }
  [[nodiscard]] MotionMatrix motion_covariance() const;
  /// Covariance of the right perturbation ξ = [translation, rotation] of world_from_cam, as everywhere in this library;
  /// includes the contribution of the given numbers.
  [[nodiscard]] Eigen::Matrix<double, 6, 6> pose_covariance() const;
  [[nodiscard]] const Camera& camera() const { return camera_; }
  /// σ of the lens parameters in the state, in the order of the configuration.
  [[nodiscard]] Eigen::VectorXd lens_sigmas() const;
  /// Numbers taken as given (consider parameters): sensitivity of the state to them, and their score test.
  [[nodiscard]] const GivenEffects& given() const { return given_; }
  /// Derivative of the pose's right perturbation with respect to each given number.
  [[nodiscard]] Eigen::Matrix<double, 6, Eigen::Dynamic> J_pose_given() const;
  [[nodiscard]] int dim() const { return P_.dim(); }
  [[nodiscard]] const StateCovariance& covariance() const { return P_; }
  [[nodiscard]] const LocalizationFilterConfig& config() const { return config_; }

 private:
  using SmallMatrix = Eigen::Matrix<double, Eigen::Dynamic, Eigen::Dynamic, Eigen::RowMajor,
                                    StateCovariance::max_columns, StateCovariance::max_columns>;
  /// An observation with its derivatives with respect to the state components that it depends on.
  struct Measured {
    std::size_t observation = 0;
    const Feature* feature = nullptr;
    Eigen::Matrix<double, 6, 3> J_before = Eigen::Matrix<double, 6, 3>::Zero();  ///< Its J_before_rotation().
    Eigen::Vector2d px = Eigen::Vector2d::Zero();
    double variance_px2 = 0.0;
    Eigen::Vector2d nu = Eigen::Vector2d::Zero();  ///< Innovation at the last linearisation,
    Eigen::Vector2d c = Eigen::Vector2d::Zero();   ///< and extrapolated to the nominal state: ν(δ) = c − H δ.
    Eigen::Matrix2d S = Eigen::Matrix2d::Identity();
    double nis = 0.0;
    int num_support = 0;
    std::array<int, StateCovariance::max_support> columns{};
    std::array<double, StateCovariance::max_support> h0{}, h1{};

    [[nodiscard]] StateCovariance::Rows rows() const {
      return {{columns.data(), static_cast<std::size_t>(num_support)}, h0.data(), h1.data()};
    }
  };

  /// A buffer that is always written before it is read: copies start empty.
  template <typename Matrix>
  struct Scratch : Matrix {
    Scratch() = default;
    ~Scratch() = default;
    Scratch(const Scratch& /*other*/) : Matrix() {}
    Scratch(Scratch&&) noexcept = default;
    Scratch& operator=(const Scratch& /*other*/) { return *this = Scratch(); }
    Scratch& operator=(Scratch&&) noexcept = default;
  };

  [[nodiscard]] const Feature* find(long id) const;
  void remove_numbers(int offset, int count);
  [[nodiscard]] int num_lens() const { return static_cast<int>(config_.lens_params.size()); }
  /// Jacobian and innovation at nominal ⊞ delta_. False if the feature is not visible there.
  bool linearise(Measured& measured);
  struct Moved;
  [[nodiscard]] Moved moved_by_delta(const Measured& measured, const WorldRotation& turn);
  [[nodiscard]] Eigen::Matrix<double, 2, 3> J_px_rotation(const ExpectedView& view, const Measured& measured,
                                                          const Moved& moved, const WorldRotation& turn) const;
  void put_columns(const ExpectedView& view, const Eigen::Matrix<double, 2, 3>& J_rotation, const Moved& moved,
                   Measured& measured) const;
  void expect(Measured& measured) const;  ///< S and NIS from the current covariance.
  void collect(std::span<const FeatureObservation> observations);
  /// Order in which an update processes the observations.
  enum class Attempt {
    in_order,      ///< One observation after another.
    by_consensus,  ///< First those that agree with one of them.
    jointly,       ///< First a full group at once.
  };
  [[nodiscard]] double attempt(Attempt way);
  [[nodiscard]] double attempt_also(Attempt way, double cost);
  void use_first_jointly();
  [[nodiscard]] double cost_of_used() const;
  void keep_consensus();
  void fill_joint_innovations();
  [[nodiscard]] double agreement_with(std::size_t chosen);
  void drop_doubtful();
  void use_in_order();
  void use_together();
  void settle(Measured& measured, bool is_used);
  /// Iterated update with a few measurements at once. False, without any change, if it fails.
  [[nodiscard]] bool take(std::span<Measured*> group);
  [[nodiscard]] bool solve(std::span<Measured*> group);
  struct StepCost {
    double prior = 0.0, all = 0.0;
  };
  [[nodiscard]] bool step(std::span<Measured*> group, bool must_fall, StepCost& at);
  [[nodiscard]] std::optional<double> iterate(std::span<Measured*> group, bool must_fall);
  /// Difference, in σ, between the innovation `there` (at delta_) and its prediction from the linearisation `here`.
  [[nodiscard]] double bend_between(const Measured& here, const Measured& there) const;
  /// Relinearises all used observations at the updated state and repeats the update from the prior: the posterior mode.
  void refine();
  [[nodiscard]] bool use_again();
  [[nodiscard]] bool finish_update();
  void drop_update();  ///< Leaves the state as it was before the update.
  void note_used();
  void transform(const FittedFrame& frame);
  /// Moves the state by delta_, and refers the errors of the covariance to the new state.
  void turn_by_delta();
  void move_by_delta();
  void move_lens_by_delta();
  void count_given();
  void count_scale();
  void begin_scale();
  void end_scale();
  [[nodiscard]] double relative_variance(const Feature& feature, const RelativeDistance& distance) const;
  [[nodiscard]] ScaleReading scale_reading(double max_sigma_rel) const;
  [[nodiscard]] double best_attempt();
  /// Sets the result of the last attempt aside while another is made, and restores it.
  void keep_attempt();
  void restore_attempt();
  [[nodiscard]] std::span<const double> error_of(const Feature& feature) const;
  void append_feature(const NewFeature& made, long id, const ScaleReading& scale);

  Camera camera_;
  CameraMotion motion_;
  LocalizationFilterConfig config_;
  StateCovariance P_;
  GivenEffects given_;
  std::vector<Feature> features_;
  Eigen::VectorXd delta_;  ///< Error relative to the nominal state during an update.

  // Work space of an update, kept so that nothing is allocated.
  std::vector<Measured> measured_;
  std::vector<Measured*> waiting_, doubtful_, used_;
  std::vector<ObservationOutcome> outcomes_;
  std::vector<double> nis_;
  Eigen::VectorXd start_, next_, before_;
  static constexpr std::size_t max_in_group = StateCovariance::max_columns / 2;
  std::array<Measured, max_in_group> there_;
  Eigen::Matrix<double, Eigen::Dynamic, 3> shear_;
  bool turns_world_ = false;     ///< Whether the errors of this update are those of world_rotation.h.
  ScaleReading scale_;           ///< For the state before the update,
  std::optional<int> scale_at_;  ///< and the index of its component during the update.
  Camera camera_at_delta_;
  Scratch<Eigen::MatrixXd> joint_x_, joint_s_;
  SmallMatrix triangle_;
  Scratch<Eigen::VectorXd> joint_nu_;
  double group_prior_ = 0.0;                      ///< Prior cost δᵀP⁻¹δ of the last step, without its group.
  double group_nis_ = 0.0, group_log_det_ = 0.0;  ///< νᵀS⁻¹ν and ln det S of the last solved group,
  double total_nis_ = 0.0, total_log_det_ = 0.0;  ///< and summed over all used ones.
  std::vector<unsigned char> agrees_, agrees_best_;
  struct KeptAttempt {
    std::vector<ObservationOutcome> outcomes;
    std::vector<double> nis;
    std::vector<Measured*> used;
    Eigen::VectorXd delta;
    double total_nis = 0.0, total_log_det = 0.0;
  } kept_;
};

}  // namespace alidade
