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
  gated,        ///< Too far from where it was expected.
  not_in_map,   ///< No such feature.
  not_visible,  ///< The lens does not see the feature from here.
};

/// Predicted pixel of a feature with its covariance: search its 3σ ellipse.
struct ExpectedObservation {
  Eigen::Vector2d px;
  Eigen::Matrix2d S;  ///< Covariance of the innovation, with the pixel's own noise. [px²]
  double depth_m = 0.0;
};

/// What became of the observations of one moment.
struct ObservationsReport {
  std::span<const ObservationOutcome> outcomes;  ///< One per observation; valid until the next update.
  /// νᵀS⁻¹ν of each when its turn came, behind those before it (of one in a group: its share); NaN if not expected.
  std::span<const double> nis;
  std::size_t num_used = 0, num_gated = 0;
  double nis_per_dof = 0.0;  ///< Of those used, together; 0 where none was.
  /// −2 ln of the probability of what was seen: νᵀS⁻¹ν + ln det 2πS of those used, at the updated state (Laplace's
  /// approximation); each gated one is anywhere in a window of 100 px, and one in ten is.
  double cost = 0.0;
  bool is_sound = true;  ///< False: nothing positive came out; the state is as it was before.
};

/// Where a moving camera is, and the points that it sees: an error-state extended Kalman filter over the camera's
/// motion, the lens where asked, and a map of positions and inverse depths. Drive it by
///     predict(dt);  expected(id) …;  update(observations);  add(id, px, prior) …;  remove(id)
/// It allocates nothing after its construction, except for more features than it had before.
/// A. J. Davison et al., PAMI 29(6), 2007; J. Civera et al., TRO 24(5), 2008; docs/maths/localization.md.
class LocalizationFilter {
 public:
  LocalizationFilter(Camera camera, const CameraMotion& start, const MotionMatrix& start_cov,
                     LocalizationFilterConfig config = {});

  void predict(double dt_s);
  /// Updates with the observations of one moment.
  ObservationsReport update(std::span<const FeatureObservation> observations);
  /// A known point, given with the σ of each of its coordinates. False where there is no room, or it is there already.
  bool add_known(long id, const Eigen::Vector3d& point_in_world, double sigma_m);
  /// A feature on the ray of its pixel, fully correlated with camera and lens. False where there is no room, it is
  /// there already, or the lens sees nothing there.
  bool add(long id, const Eigen::Vector2d& px, const RangePrior& prior, FeatureKind kind = FeatureKind::inverse_depth);
  void remove(long id);
  /// Frame and scale of the state become those of its known points as they were given: fitted_frame.h. For a world of
  /// which nothing but these points says where and how large it is.
  void fit_frame();
  /// Whether so many more components fit into the state.
  [[nodiscard]] bool has_room(int count) const { return P_.dim() + count <= config_.state_capacity; }
  /// Inverse depths that are nearly linear become positions: half the components. Their count.
  int convert_linear();
  /// Relocalisation: the camera's correlations with the map are dropped, the map is kept.
  void place_camera(const CameraMotion& motion, const MotionMatrix& cov);

  /// Where a feature of the map should be seen now. None: not in the map, or not visible.
  [[nodiscard]] std::optional<ExpectedObservation> expected(long id) const;
  [[nodiscard]] bool has(long id) const { return find(id) != nullptr; }
  [[nodiscard]] const std::vector<Feature>& features() const { return features_; }
  /// Position of a feature and its covariance, what is given counted. None: not in the map.
  struct Place {
    Eigen::Vector3d point_in_world;
    Eigen::Matrix3d cov;
  };
  [[nodiscard]] std::optional<Place> place(long id) const;

  [[nodiscard]] const CameraMotion& motion() const { return motion_; }
  [[nodiscard]] MotionMatrix motion_covariance() const;
  /// Of the right perturbation ξ = [translation, rotation] of world_from_cam, as everywhere in this library; what is
  /// given counted.
  [[nodiscard]] Eigen::Matrix<double, 6, 6> pose_covariance() const;
  [[nodiscard]] const Camera& camera() const { return camera_; }
  /// σ of the lens's parameters that are in the state, in the order of the configuration.
  [[nodiscard]] Eigen::VectorXd lens_sigmas() const;
  /// What is taken as given: sensitivity of the state to it, and its score test.
  [[nodiscard]] const GivenEffects& given() const { return given_; }
  /// How the pose's right perturbation moves with each given number.
  [[nodiscard]] Eigen::Matrix<double, 6, Eigen::Dynamic> J_pose_given() const;
  [[nodiscard]] int dim() const { return P_.dim(); }
  [[nodiscard]] const StateCovariance& covariance() const { return P_; }
  [[nodiscard]] const LocalizationFilterConfig& config() const { return config_; }

 private:
  using SmallMatrix = Eigen::Matrix<double, Eigen::Dynamic, Eigen::Dynamic, Eigen::RowMajor,
                                    StateCovariance::max_columns, StateCovariance::max_columns>;
  /// An observation with its derivatives by the components of the state that it depends on.
  struct Measured {
    std::size_t observation = 0;
    const Feature* feature = nullptr;
    Eigen::Matrix<double, 6, 3> J_before = Eigen::Matrix<double, 6, 3>::Zero();  ///< J_before_rotation() of it.
    Eigen::Vector2d px = Eigen::Vector2d::Zero();
    double variance_px2 = 0.0;
    Eigen::Vector2d nu = Eigen::Vector2d::Zero();  ///< Innovation at the last linearisation,
    Eigen::Vector2d c = Eigen::Vector2d::Zero();   ///< and by it at the nominal state: ν(δ) = c − H δ.
    Eigen::Matrix2d S = Eigen::Matrix2d::Identity();
    double nis = 0.0;
    int num_support = 0;
    std::array<int, StateCovariance::max_support> columns{};
    std::array<double, StateCovariance::max_support> h0{}, h1{};

    [[nodiscard]] StateCovariance::Rows rows() const {
      return {{columns.data(), static_cast<std::size_t>(num_support)}, h0.data(), h1.data()};
    }
  };

  /// What nobody reads before it is written: a copy has none.
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
  /// Derivatives and innovation at nominal ⊞ delta_. False where it is not seen.
  bool linearise(Measured& measured);
  struct Moved;
  [[nodiscard]] Moved moved_by_delta(const Measured& measured, const WorldRotation& turn);
  [[nodiscard]] Eigen::Matrix<double, 2, 3> J_px_rotation(const ExpectedView& view, const Measured& measured,
                                                          const Moved& moved, const WorldRotation& turn) const;
  void put_columns(const ExpectedView& view, const Eigen::Matrix<double, 2, 3>& J_rotation, const Moved& moved,
                   Measured& measured) const;
  void expect(Measured& measured) const;  ///< S and NIS from the current covariance.
  void collect(std::span<const FeatureObservation> observations);
  /// What comes first in an update.
  enum class Attempt {
    in_order,      ///< One observation after another.
    by_consensus,  ///< Those that agree with one of them.
    jointly,       ///< As many as a group holds, together.
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
  /// Iterated update with a few measurements at once. False, and no change, where they have no answer.
  [[nodiscard]] bool take(std::span<Measured*> group);
  [[nodiscard]] bool solve(std::span<Measured*> group);
  struct StepCost {
    double prior = 0.0, all = 0.0;
  };
  [[nodiscard]] bool step(std::span<Measured*> group, bool must_fall, StepCost& at);
  [[nodiscard]] std::optional<double> iterate(std::span<Measured*> group, bool must_fall);
  /// How far, in σ, the innovation `there`, at delta_, is from what the derivatives `here` say.
  [[nodiscard]] double bend_between(const Measured& here, const Measured& there) const;
  /// All that were used once more from the prior, linearised where they led: the maximum of the posterior.
  void refine();
  [[nodiscard]] bool use_again();
  [[nodiscard]] bool finish_update();
  void drop_update();  ///< The state stays where it was.
  void note_used();
  void transform(const FittedFrame& frame);
  /// The state goes where delta_ says, and the covariance's errors are counted from there.
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
  /// What the last attempt came to, put aside while another is made, and taken back.
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
  Eigen::VectorXd delta_;  ///< Error from the nominal state while an update goes on.

  // Work of an update, kept so that nothing is allocated.
  std::vector<Measured> measured_;
  std::vector<Measured*> waiting_, doubtful_, used_;
  std::vector<ObservationOutcome> outcomes_;
  std::vector<double> nis_;
  Eigen::VectorXd start_, next_, before_;
  static constexpr std::size_t max_in_group = StateCovariance::max_columns / 2;
  std::array<Measured, max_in_group> there_;
  Eigen::Matrix<double, Eigen::Dynamic, 3> shear_;
  bool turns_world_ = false;     ///< Whether the errors of this update are those of world_rotation.h.
  ScaleReading scale_;           ///< Of the state before the update,
  std::optional<int> scale_at_;  ///< and its component while the update goes on.
  Camera camera_at_delta_;
  Scratch<Eigen::MatrixXd> joint_x_, joint_s_;
  SmallMatrix triangle_;
  Scratch<Eigen::VectorXd> joint_nu_;
  double group_prior_ = 0.0;                      ///< What the last step costs before its group is seen: δᵀP⁻¹δ.
  double group_nis_ = 0.0, group_log_det_ = 0.0;  ///< νᵀS⁻¹ν and ln det S of the group that was solved last,
  double total_nis_ = 0.0, total_log_det_ = 0.0;  ///< and of all that are used.
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
