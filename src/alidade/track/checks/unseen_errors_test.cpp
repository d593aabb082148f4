#include "alidade/track/checks/unseen_errors.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>

#include "alidade/pantilt/rig_uncertainty.h"
#include "alidade/testing/track_sample.h"
#include "alidade/testing/trials.h"
#include "alidade/track/checks/rig_faults.h"
#include "alidade/track/checks/track_assumed.h"

// What of a rig's errors no observations show, and what it moves: against the tracker itself with another rig file.

namespace alidade {
namespace {

constexpr double small_rad = 0.0017453292519943295;

/// Scenario C by two heads, or by three side by side, with a rig file that says that it is exact.
struct Sample {
  TrackScene scene = *track_scenario("C");
  Rig rig;
  FollowConfig config;

  explicit Sample(std::size_t num_heads) {
    if (num_heads == 3) {
      scene.heads.push_back(scene.heads[1]);
      scene.heads[2].head.id = 3;
      scene.heads[2].head.world_from_base.translation += Eigen::Vector3d(1.0, 0.0, 0.0);
      scene.rate_hz = {20.0, 20.0, 20.0};
      scene.phase_s = {0.0, 0.01, 0.02};
    }
    rig.heads.assign(scene.heads.begin(), scene.heads.end());
    const auto num = num_head_params * static_cast<Eigen::Index>(num_heads);
    rig.cov.setZero(num, num);
    config.tracker.sigma_a_m_s2 = scene.sigma_a_m_s2;
    config.find_sigma_a = false;
  }

  [[nodiscard]] std::vector<TargetObservation> observations(int seed) const {
    return testing::observations_of(scene, static_cast<std::uint64_t>(seed));
  }
  [[nodiscard]] UnseenErrors unseen(const std::vector<TargetObservation>& observations,
                                    const TrackReport& report) const {
    return unseen_errors(observations, rig.heads, config.tracker, true, report);
  }
};

bool lists(const UnseenErrors& unseen, const std::string& name) {
  return std::ranges::any_of(unseen.params, [&](const RigPower* one) { return one->name == name; });
}

/// By how much the tracker's positions differ, RMS over the track, as a share of the distance from the first head.
double share_between(const TrackReport& one, const TrackReport& other, const Eigen::Vector3d& head) {
  double sum = 0.0, num = 0.0;
  for (std::size_t i = one.steps.size() / 10; i < one.steps.size(); ++i) {
    if (!one.steps[i].has_belief || !other.steps[i].has_belief) continue;
    const Eigen::Vector3d at = one.steps[i].belief.x.head<3>(), moved = other.steps[i].belief.x.head<3>() - at;
    sum += moved.squaredNorm() / (at - head).squaredNorm();
    num += 1.0;
  }
  return std::sqrt(sum / num);
}

/// Two heads: what rotates rays in their common plane is listed, what moves them out of it is not; and each size stated
/// is what the tracker does with a rig file that is off by the stated error.
TEST(UnseenErrors, OfTwoHeadsMoveTheTargetAsStated) {
  const Sample sample(2);
  const auto observations = sample.observations(1);
  const TrackReport report = track_target(observations, sample.rig.heads, sample.config);
  const UnseenErrors unseen = sample.unseen(observations, report);
  for (const char* name : {"head1.pan_zero_rad", "head2.pan_zero_rad", "head2.base_ry_rad", "head2.camera.cx"})
    EXPECT_TRUE(lists(unseen, name)) << name;
  for (const char* name : {"head1.tilt_zero_rad", "head2.tilt_zero_rad", "head2.base_rx_rad", "head2.camera.cy"})
    EXPECT_FALSE(lists(unseen, name)) << name;
  ASSERT_GE(unseen.worst.size(), 3u);
  FollowConfig plain = sample.config;
  plain.judge = false;
  for (const TargetMove& stated : unseen.worst) {
    Rig other = sample.rig;
    RigHead& head = other.heads[stated.name.starts_with("head1") ? 0 : 1];
    const std::string name = stated.name.substr(6);
    if (name == "pan_zero_rad") {
      head.head.encoder.pan_zero_rad += small_rad;
      EXPECT_EQ(stated.error, "0.1°");
    } else if (name == "camera.cx") {
      Eigen::VectorXd lens = params(head.camera.lens);
      lens[2] += 2.0;
      head.camera.lens = with_params(head.camera.lens, lens);
      EXPECT_EQ(stated.error, "2 px");
    } else if (name == "base_x_m") {
      head.head.world_from_base.translation.x() += 0.001;
      EXPECT_EQ(stated.error, "1 mm");
    } else if (name == "pan_scale") {
      head.head.encoder.pan_scale += 0.005;
      EXPECT_EQ(stated.error, "0.5 %");
    } else {
      ADD_FAILURE() << stated.name;
    }
    const double moved = share_between(track_target(observations, sample.rig.heads, plain),
                                       track_target(observations, other.heads, plain),
                                       sample.rig.heads[0].head.world_from_base.translation);
    EXPECT_NEAR(stated.share / moved, 1.0, 0.15) << stated.name;
    RecordProperty(stated.name, std::to_string(stated.share) + " " + std::to_string(moved));
  }
}

/// Such an error is not named, and the target is more than 5σ off: only the line in `assumed` tells.
TEST(UnseenErrors, AreSaidInOneRow) {
  const Sample sample(2);
  Rig rig = sample.rig;
  rig.heads[1].head.encoder.pan_zero_rad += 10.0 * small_rad;
  const auto observations = sample.observations(2);
  const TrackReport report = track_target(observations, rig.heads, sample.config);
  EXPECT_LT(report.faults.front().z, max_fault_z(report));
  std::size_t wrong = 0;
  for (const TrackStep& step : report.steps)
    wrong += step.has_belief && std::abs(step.belief.x[2] - sample.scene.position(step.t_s)[2]) >
                                    5.0 * std::sqrt(step.belief.P(2, 2))
                 ? 1
                 : 0;
  EXPECT_GT(wrong, report.steps.size() / 4);
  const auto assumed = track_assumed(observations, rig, sample.config, report, {});
  const auto row = std::ranges::find(assumed, "rig.not_tested", &Assumption::name);
  ASSERT_NE(row, assumed.end());
  EXPECT_EQ(row->sigma, 0.0);
  for (const char* part : {"pan_zero_rad", "camera.cx", "0.1° of head", " % of its range ("})
    EXPECT_NE(row->moved.find(part), std::string::npos) << row->moved;
  // As far as the rig file says how large they may be, they are in σ.
  for (const int axis : {0, 1}) rig.encoder_errors.push_back({.sigma_zero_rad = axis * small_rad, .sigma_scale = 0.0});
  FollowConfig counting = sample.config;
  counting.tracker.errors = rig_uncertainty(rig);
  const TrackReport counted = track_target(observations, rig.heads, counting);
  const UnseenErrors known = unseen_errors(observations, rig.heads, counting.tracker, true, counted);
  ASSERT_TRUE(known.sigma_share.has_value());
  EXPECT_GT(*known.sigma_share, 0.005);
  EXPECT_LT(*known.sigma_in_sigma, 1.2);
}

/// An oval ring (two periods a turn) of the second head's pan: no observations of two heads show it, and the target is
/// more than 5σ off; by a rig file that states the encoder's σ it is not.
TEST(UnseenErrors, CountAnEncoderThatIsWrongAtSomeAngles) {
  constexpr double amplitude_rad = 5.0 * small_rad;
  Sample sample(2);
  auto observations = sample.observations(4);
  for (TargetObservation& observation : observations)
    if (observation.head == 1)
      observation.pan_tilt_rad.x() += amplitude_rad * std::sin(2.0 * observation.pan_tilt_rad.x() + 1.0);
  const auto worst_sigma = [&](const TrackReport& report) {
    double worst = 0.0;
    for (const TrackStep& step : report.steps)
      if (step.has_belief && step.t_s > 1.5)
        for (int k = 0; k < 3; ++k)
          worst = std::max(
              worst, std::abs(step.belief.x[k] - sample.scene.position(step.t_s)[k]) / std::sqrt(step.belief.P(k, k)));
    return worst;
  };
  const TrackReport exact = track_target(observations, sample.rig.heads, sample.config);
  EXPECT_LT(exact.faults.front().z, max_fault_z(exact));
  EXPECT_GT(worst_sigma(exact), 5.0);
  const std::string text = unseen_text(sample.unseen(observations, exact));
  EXPECT_NE(text.find("an error that an encoder has only at some angles"), std::string::npos) << text;
  for (int h = 0; h < 2; ++h)
    sample.rig.encoder_errors.push_back({.sigma_zero_rad = amplitude_rad * std::sqrt(0.5), .sigma_scale = 0.0});
  sample.config.tracker.errors = rig_uncertainty(sample.rig);
  EXPECT_LT(worst_sigma(track_target(observations, sample.rig.heads, sample.config)), 4.0);
}

/// Three heads: an error of the second's pan zero shows, and as clearly as stated.
TEST(UnseenErrors, OfThreeHeadsShowAsStated) {
  const int draws = testing::trials(6);
  const Sample sample(3);
  double z = 0.0, expected = 0.0;
  for (int seed = 1; seed <= draws; ++seed) {
    const auto observations = sample.observations(seed);
    const TrackReport right = track_target(observations, sample.rig.heads, sample.config);
    EXPECT_FALSE(lists(sample.unseen(observations, right), "head2.pan_zero_rad"));
    const auto power = std::ranges::find(right.power, "head2.pan_zero_rad", &RigPower::name);
    ASSERT_NE(power, right.power.end());
    Rig off = sample.rig;
    off.heads[1].head.encoder.pan_zero_rad += 8.0 / power->z_per_unit;
    const TrackReport report = track_target(observations, off.heads, sample.config);
    const auto fault = std::ranges::find(report.faults, "head2.pan_zero_rad", &RigFault::name);
    z += fault != report.faults.end() ? fault->z / draws : 0.0;
    expected += 8.0 / draws;
  }
  EXPECT_NEAR(z, expected, 4.0 / std::sqrt(draws) + 0.1 * expected);  // the noise is estimated, and the path bends
  RecordProperty("z", std::to_string(z));
}

}  // namespace
}  // namespace alidade
