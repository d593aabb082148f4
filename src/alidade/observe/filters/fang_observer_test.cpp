#include "alidade/observe/filters/fang_observer.h"

#include <gtest/gtest.h>

#include <Eigen/LU>
#include <fstream>
#include <map>
#include <nlohmann/json.hpp>

#include "alidade/geometry/decompositions.h"
#include "alidade/testing/allocations.h"
#include "alidade/testing/reference_case.h"
#include "alidade/testing/rotation_sample.h"

namespace alidade {
namespace {

using namespace testing;
using Matrix8 = Eigen::Matrix<double, 8, 8>;

FangConfig observer_config(FangProfile profile, std::size_t num_points = 4) {
  FangConfig config;
  config.num_points = num_points;
  config.scale = paper_scale;
  config.profile = profile;
  config.start = paper_start;
  config.roll_columns = false;  // the paper's motion has none
  return config;
}

// --- the reference cases --------------------------------------------------------------------------------------------

/// Estimates of the reference at its times, each method as it is there: point 1 is the reference, gains are diagonal.
void expect_reference(const std::string& method, const FangConfig& config, double tolerance_px,
                      const std::map<std::string, std::vector<double>>& rejected) {
  std::ifstream file(testing::reference_case("a_expected.json"));
  const nlohmann::json cases = nlohmann::json::parse(file)["cases"];
  int checked = 0;
  for (const auto& [name, methods] : cases.items()) {
    FangObserver observer(config);
    const auto estimates = observe_log(observer, *paper_case(name));
    for (const auto& [t, expected] : methods[method].items()) {
      const auto skip = rejected.find(name);
      const double t_s = std::stod(t);
      if (skip != rejected.end() && t_s >= skip->second[0] && t_s <= skip->second[1]) continue;
      const IntrinsicsEstimate& estimate = estimates[static_cast<std::size_t>(std::lround(30.0 * t_s))];
      for (std::size_t i = 0; i < 4; ++i)
        EXPECT_NEAR(estimate.values()[static_cast<Eigen::Index>(i)], expected[i].get<double>(), tolerance_px)
            << name << " t=" << t;
      ++checked;
    }
  }
  EXPECT_GE(checked, 20);
}

FangConfig reference_config(FangProfile profile) {
  FangConfig config = observer_config(profile);
  config.rates_at_ends = true;
  config.reference_point = 0;
  DifferenceParameters diagonal;  // the reference's dG; the last two do not matter without roll
  diagonal << 0.00271605, 0.03838248, 0.0080096, 0.00047259, 0.00132494, 0.00933727, 1.0, 1.0;
  config.mean_gramian = Matrix8(diagonal.asDiagonal());
  config.prior_floor = 1e-8;
  config.drift_px_per_sqrt_s = 400.0 * std::sqrt(30.0 * 1e-10);  // 10⁻¹⁰ a frame
  return config;
}

TEST(FangObserverCase, FastAgreesWithTheReference) {
  // 1/θ̂ makes 100 px of the ninth digit of the files, while θ̂ passes near zero: in a burst, in a ramp, and in noise.
  expect_reference("paper_fast", reference_config(FangProfile::fast), 0.005,
                   {{"a_exp1_noise", {0.0, 20.0}},
                    {"a_exp3_zoom_noise", {0.0, 20.0}},
                    {"a_exp2_burst", {6.0, 9.9}},
                    {"a_exp3_zoom", {6.0, 9.9}}});
}

TEST(FangObserverCase, QuietAgreesWithTheReference) {
  FangConfig config = reference_config(FangProfile::quiet);
  config.gains = FangGains{.k1 = 8.0, .gain = 8.0, .lowpass_hz = 0.0};  // the reference's own
  expect_reference("paper_quiet", config, 1e-4, {});
}

TEST(FangObserverCase, KalmanAgreesWithTheReference) {
  expect_reference("kf_diff", reference_config(FangProfile::kalman), 1e-4, {});
}

TEST(FangObserverCase, StateAgreesWithTheReference) {
  std::ifstream file(testing::reference_case("a_expected.json"));
  const nlohmann::json step = nlohmann::json::parse(file)["cases"]["a_clean"]["paper_fast_one_step"];
  FangObserver observer(reference_config(FangProfile::fast));
  RotationLog log = *paper_case("a_clean");
  log.rows.resize(61);
  (void)observe_log(observer, log);
  for (std::size_t i = 0; i < 6; ++i) {
    // 5·10⁻⁷ px of the files' pixels make 2·10⁻⁶ of θ: 0.005 px of fx is 4·10⁻⁶ of 1/fx.
    EXPECT_NEAR(observer.theta()[static_cast<Eigen::Index>(i)], step["theta_after_60_steps"][i].get<double>(), 4e-6);
    EXPECT_NEAR(observer.error(1 + i / 2)[static_cast<Eigen::Index>(i % 2)], step["e_after_60_steps"][i].get<double>(),
                5e-9);
  }
}

// --- laws -----------------------------------------------------------------------------------------------------------

/// Pixels for which the trapezoid rule holds exactly: q₁ = q₀ + h/2 (G₀ + G₁)ᵀΘ, by fixed-point iteration.
RotationLog trapezoid_log(std::uint64_t seed) {
  const FlowParameters theta = flow_parameters(scaled_intrinsics(paper_scale, paper_truth));
  RotationLog log;
  log.num_points = 4;
  log.rows.resize(120);
  log.rows[0].px = draw_points(780, 582, 4, seed);
  for (std::size_t r = 0; r < log.rows.size(); ++r) {
    RotationRow& row = log.rows[r];
    row.t_s = 0.05 * static_cast<double>(r) + 0.01 * static_cast<double>(r % 3);  // steps of 40, 60 and 60 ms
    row.rate_rad_per_s = paper_rate(row.t_s) + Eigen::Vector3d(0.0, 0.0, 0.05 * std::cos(row.t_s));
    if (r == 0) continue;
    const RotationRow& last = log.rows[r - 1];
    for (const Eigen::Vector2d& px : last.px) {
      const Eigen::Vector2d q_0 = paper_scale.normalised(px);
      Eigen::Vector2d q = q_0;
      for (int i = 0; i < 40; ++i)
        q = q_0 + 0.5 * (row.t_s - last.t_s) *
                      (flow_regressor(q_0, last.rate_rad_per_s) + flow_regressor(q, row.rate_rad_per_s)).transpose() *
                      theta;
      row.px.push_back(paper_scale.scale * q + paper_scale.centre);
    }
  }
  return log;
}

TEST(FangObserver, LosesEnergyAtEveryGainAndStep) {
  const DifferenceParameters truth = difference_parameters(scaled_intrinsics(paper_scale, paper_truth));
  for (const double gain : {1.0, 1e3, 1e6}) {
    for (const double k1 : {0.5, 15.0, 1000.0}) {
      const RotationLog log = trapezoid_log(3);
      FangConfig config = observer_config(FangProfile::fast);
      config.roll_columns = config.rates_at_ends = true;
      config.gains = FangGains{.k1 = k1, .gain = gain, .lowpass_hz = 0.0};
      config.mean_gramian = Matrix8::Identity();  // Γ = gain
      FangObserver observer(config);
      MotionReader reader(log.source, 0.5);
      double last_energy = std::numeric_limits<double>::infinity(), first_energy = 0.0;
      std::array<Eigen::Vector2d, 4> last_e;
      last_e.fill(Eigen::Vector2d::Zero());
      for (const RotationRow& row : log.rows) {
        const RotationFrame frame = reader.next(row);
        (void)observer.step(frame);
        double energy = (observer.theta() - truth).squaredNorm() / gain, lost = 0.0;
        for (std::size_t i = 0; i < 4; ++i) {
          energy += observer.error(i).squaredNorm();
          if (frame.dt_s > 0.0) lost += 2.0 * frame.dt_s * k1 * (0.5 * (observer.error(i) + last_e[i])).squaredNorm();
          last_e[i] = observer.error(i);
        }
        if (frame.dt_s > 0.0) {
          EXPECT_NEAR(last_energy - energy, lost, 1e-13) << gain << " " << k1;  // an identity: rounding alone
        } else {
          first_energy = energy;
        }
        last_energy = energy;
      }
      EXPECT_LT(last_energy, first_energy);
    }
  }
}

TEST(FangObserver, LowPassOfBothSidesDoesNotBias) {
  const RotationLog log = trapezoid_log(3);
  FangConfig config = observer_config(FangProfile::quiet);
  config.roll_columns = config.rates_at_ends = true;
  config.start = paper_truth;
  FangObserver observer(config);
  // From the true start nothing is left to learn: filtered or not, the regression holds to rounding.
  for (const IntrinsicsEstimate& estimate : observe_log(observer, log))
    EXPECT_LT((estimate.values() - paper_truth).norm(), 1e-8);
}

/// The filter of the kalman profile as textbooks have it: [ξ; θ] with R = σ²(I + 11ᵀ) an axis. Point 0 is the
/// reference.
class JointFilter {
 public:
  JointFilter(const FangConfig& config, Eigen::Index num_differences)
      : config_(config), n_(2 * num_differences), variance_(std::pow(config.sigma_px / config.scale.scale, 2)) {
    const Eigen::Vector4d k = scaled_intrinsics(config.scale, config.start);
    const double f = config.prior_sigma_f_px / config.scale.scale,
                 c = config.prior_sigma_centre_px / config.scale.scale;
    const auto j = difference_parameters_jacobian(k);
    x_ = Eigen::VectorXd::Zero(n_ + 8);
    x_.tail<8>() = difference_parameters(k);
    p_ = Eigen::MatrixXd::Zero(n_ + 8, n_ + 8);
    p_.bottomRightCorner<8, 8>() = j * Eigen::Vector4d(f * f, f * f, c * c, c * c).asDiagonal() * j.transpose() +
                                   config.prior_floor * Matrix8::Identity();
  }

  void step(const RotationFrame& frame, const RotationFrame& last) {
    std::vector<Eigen::Index> seen;
    const double drift = config_.drift_px_per_sqrt_s / config_.scale.scale;
    Eigen::MatrixXd f = Eigen::MatrixXd::Identity(n_ + 8, n_ + 8), noise = Eigen::MatrixXd::Zero(n_ + 8, n_ + 8);
    for (Eigen::Index i = 1; i <= n_ / 2; ++i) {
      const auto point = static_cast<std::size_t>(i);
      if (!is_seen(frame.px[point])) continue;
      seen.push_back(i);
      if (last.px.empty() || !is_seen(last.px[point])) {
        x_.segment<2>(2 * i - 2) = q(frame, i) - q(frame, 0);
        p_.middleRows<2>(2 * i - 2).setZero();
        p_.middleCols<2>(2 * i - 2).setZero();
        p_.block<2, 2>(2 * i - 2, 2 * i - 2) = 100.0 * Eigen::Matrix2d::Identity();
        continue;
      }
      f.block<2, 8>(2 * i - 2, n_) = 0.5 * frame.dt_s *
                                     (difference_regressor(q(last, i), q(last, 0), frame.mean_rate_rad_per_s) +
                                      difference_regressor(q(frame, i), q(frame, 0), frame.mean_rate_rad_per_s))
                                         .transpose();
      noise.block<2, 2>(2 * i - 2, 2 * i - 2) = drift * drift * frame.dt_s * Eigen::Matrix2d::Identity();
    }
    x_ = f * x_;
    p_ = f * p_ * f.transpose() + noise;
    update(frame, seen);
  }

  [[nodiscard]] DifferenceParameters theta() const { return x_.tail<8>(); }
  [[nodiscard]] Matrix8 covariance() const { return p_.bottomRightCorner<8, 8>(); }
  [[nodiscard]] double nis() const { return nis_; }

 private:
  [[nodiscard]] Eigen::Vector2d q(const RotationFrame& of, Eigen::Index i) const {
    return config_.scale.normalised(of.px[static_cast<std::size_t>(i)]);
  }

  void update(const RotationFrame& frame, const std::vector<Eigen::Index>& seen) {
    const auto m = static_cast<Eigen::Index>(2 * seen.size());
    Eigen::MatrixXd h = Eigen::MatrixXd::Zero(m, n_ + 8), r = Eigen::MatrixXd::Zero(m, m);
    Eigen::VectorXd innovation(m);
    for (Eigen::Index a = 0; a < m; ++a) {
      const Eigen::Index i = seen[static_cast<std::size_t>(a / 2)], at = 2 * i - 2 + a % 2;
      h(a, at) = 1.0;
      innovation[a] = (q(frame, i) - q(frame, 0))[a % 2] - x_[at];
      for (Eigen::Index b = 0; b < m; ++b) r(a, b) = a % 2 == b % 2 ? variance_ * (a == b ? 2.0 : 1.0) : 0.0;
    }
    const Eigen::MatrixXd s = h * p_ * h.transpose() + r;
    const Eigen::MatrixXd gain = Ldlt(s).solve_each(h * p_).transpose();
    const Eigen::MatrixXd left = Eigen::MatrixXd::Identity(n_ + 8, n_ + 8) - gain * h;
    nis_ = squared_mahalanobis(innovation, s);
    x_ += gain * innovation;
    p_ = left * p_ * left.transpose() + gain * r * gain.transpose();
  }

  FangConfig config_;
  Eigen::Index n_;
  double variance_, nis_ = 0.0;
  Eigen::VectorXd x_;
  Eigen::MatrixXd p_;
};

TEST(FangObserver, KalmanIsTheJointFilterToTheLastDigits) {
  RotationScene scene = random_paper_scene(3, 5);
  scene.motion = [](double t_s) {
    return Eigen::Vector3d(paper_rate(t_s) + Eigen::Vector3d(0, 0, 0.05 * std::cos(t_s)));
  };
  RotationLog log = simulate_rotation(scene, {.duration_s = 5.0, .sigma_px = 0.3, .lost_share = 0.05}, 3);
  for (RotationRow& row : log.rows)
    if (!is_seen(row.px[0])) row.px[0] = {300.0, 300.0};  // the reference stays, be it wrong
  FangConfig config = observer_config(FangProfile::kalman, 5);
  config.roll_columns = true;
  config.reference_point = 0;
  FangObserver observer(config);
  JointFilter joint(config, 4);
  MotionReader reader(log.source, 0.5);
  RotationFrame last;
  IntrinsicsEstimate estimate;
  for (const RotationRow& row : log.rows) {
    const RotationFrame frame = reader.next(row);
    estimate = observer.step(frame);
    joint.step(frame, last);
    last = frame;
    // The joint covariance loses digits where 100 meets σ² of 10⁻⁶.
    EXPECT_LT((observer.theta() - joint.theta()).norm(), 1e-6 * joint.theta().norm()) << row.t_s;
    if (estimate.nis_dof > 0) {
      EXPECT_NEAR(estimate.nis, joint.nis(), 1e-5 * joint.nis() + 1e-5) << row.t_s;
    }
  }
  const auto j = intrinsics_jacobian(joint.theta());
  const Eigen::Array4d sigma = 400.0 * (j * joint.covariance() * j.transpose()).diagonal().array().sqrt();
  EXPECT_LT((estimate.sigma.array() / sigma - 1.0).abs().maxCoeff(), 1e-5);
}

// --- what is asked of it frame by frame -----------------------------------------------------------------------------

TEST(FangObserver, GivesNoIntrinsicsWhileAFocalLengthIsWild) {
  FangConfig config = observer_config(FangProfile::fast);
  config.start = {1e5, 1e5, 390.0, 291.0};  // 1/fx is 1/250 in scaled pixels
  FangObserver observer(config);
  const auto estimates = observe_log(observer, paper_log(1, false));
  EXPECT_FALSE(estimates[1].has_value);
  EXPECT_TRUE(estimates.back().has_value);
  int starts = 0;
  for (const IntrinsicsEstimate& estimate : estimates) {
    starts += estimate.event == ObserveEvent::start;
    if (!estimate.has_value) continue;
    EXPECT_GT(std::min(estimate.fx, estimate.fy), 0.0);
    EXPECT_LT(std::max(estimate.fx, estimate.fy), 20.0 * 400.0);
  }
  EXPECT_EQ(starts, 1);
}

TEST(FangObserver, SaysWhichProfileHasASigma) {
  for (const FangProfile profile : {FangProfile::fast, FangProfile::quiet, FangProfile::kalman}) {
    FangObserver observer(observer_config(profile));
    const IntrinsicsEstimate last = observe_log(observer, paper_log(1, true)).back();
    EXPECT_EQ(last.sigma.allFinite(), profile == FangProfile::kalman);
    EXPECT_EQ(last.nis_dof, profile == FangProfile::kalman ? 6 : 0);
  }
}

TEST(FangObserver, LivesWithLostPointsLostFramesAndGaps) {
  for (const FangProfile profile : {FangProfile::fast, FangProfile::kalman}) {
    RotationScene scene = random_paper_scene(7, 6);
    RotationLog log = simulate_rotation(scene, {.sigma_px = 0.0, .lost_share = 0.02}, 7);
    for (std::size_t r = 40; r < 44; ++r) log.rows[r].rate_rad_per_s.setConstant(not_seen);
    log.rows[60].px.assign(6, Eigen::Vector2d::Constant(not_seen));
    for (std::size_t r = 100; r < 130; ++r) log.rows[r].rate_rad_per_s.setConstant(not_seen);  // 1 s: a new segment
    log.rows.insert(log.rows.begin() + 200, log.rows[200]);                                    // the same instant twice
    log.truth.push_back(log.truth[0]);
    FangObserver observer(observer_config(profile, 6));
    const auto estimates = observe_log(observer, log);
    EXPECT_EQ(estimates[42].values(), estimates[39].values());
    EXPECT_EQ(estimates[60].values(), estimates[39 + 20].values());
    EXPECT_EQ(estimates[201].values(), estimates[200].values());
    EXPECT_EQ(estimates[130].event, ObserveEvent::new_segment);
    EXPECT_EQ(estimates[130].values(), estimates[99].values());  // θ stays
    EXPECT_LT(error_px(log, estimates, log.rows.size() - 1).cwiseAbs().maxCoeff(), 1.0);
  }
}

TEST(FangObserver, AllocatesNothingOnceItStands) {
  for (const FangProfile profile : {FangProfile::fast, FangProfile::quiet, FangProfile::kalman}) {
    const RotationScene scene = paper_scene(draw_points(780, 582, 40, 9));
    const RotationLog log = simulate_rotation(scene, {.duration_s = 9.0, .lost_share = 0.01}, 9);
    FangObserver observer(observer_config(profile, 40));
    MotionReader reader(log.source, 0.5);
    const std::size_t before = num_allocations();
    double lambda = 0.0;
    for (const RotationRow& row : log.rows) {
      (void)observer.step(reader.next(row));
      lambda += observer.gramian_lambda_min();
    }
    EXPECT_EQ(num_allocations(), before);
    EXPECT_GT(lambda, 0.0);
  }
}

}  // namespace
}  // namespace alidade
