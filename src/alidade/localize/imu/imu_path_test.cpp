#include <gtest/gtest.h>

#include <functional>
#include <numbers>

#include "alidade/geometry/similarity.h"
#include "alidade/localize.h"
#include "alidade/simulate/draws.h"
#include "alidade/simulate/imu/imu_readings.h"
#include "alidade/simulate/underwater.h"
#include "alidade/testing/imu_run.h"

// Metres and gravity by an IMU, without a target; with one a check of its scale.

namespace alidade {
namespace {

using testing::ImuRun;
using testing::swinging;
using testing::with_imu;
using testing::worst_sigmas;

/// A camera on any path before points at 0.6 to 1.6 m; the mounting is as given.
ImuRun moving(const std::function<Rigid3(double)>& world_from_cam, std::uint64_t seed) {
  Draws draws(seed);
  ImuRun run{underwater_camera(), {}, {}, {}, {}, {}, {}};
  run.given = run.scene.mounting;
  std::vector<Eigen::Vector3d> points;
  for (int i = 0; i < 80; ++i)
    points.emplace_back(draws.uniform(-1.0, 1.0), draws.uniform(-0.8, 0.8), draws.uniform(0.6, 1.6));
  constexpr int num_frames = 240;
  for (long k = 0; k < num_frames; ++k) {
    const double t_s = static_cast<double>(k) / 30.0;
    ObservationFrame seen{k, t_s, {}};
    for (std::size_t i = 0; i < points.size(); ++i) {
      const auto px = project(run.camera, world_from_cam(t_s).inverse() * points[i]);
      if (!px || px->x() < 0.0 || px->y() < 0.0 || px->x() > run.camera.width_px || px->y() > run.camera.height_px)
        continue;
      const Eigen::Vector2d noise(draws.normal(), draws.normal());
      seen.observations.push_back({static_cast<long>(i), *px + 0.5 * noise, 0.0});
    }
    run.truth.push_back({t_s, world_from_cam(t_s)});
    run.frames.push_back(std::move(seen));
  }
  run.imu = simulate_imu(run.scene, world_from_cam, -0.5, run.truth.back().t_s + 0.5, seed + 100);
  return run;
}

Eigen::Vector3d swing(double size, double t_s) {
  return size * Eigen::Vector3d(std::sin(1.9 * t_s), std::sin(2.3 * t_s + 1.0), std::sin(1.6 * t_s + 2.0));
}

/// Length of the path over that of the truth.
double scale_of(const Localization& result, const ImuRun& run) {
  std::vector<Eigen::Vector3d> truth, path;
  for (std::size_t k = 0; k < result.path.size(); ++k) {
    truth.push_back(run.truth[k].world_from_cam.translation);
    path.push_back(result.path[k].world_from_cam.translation);
  }
  return aligned(truth, path, false)->scale;
}

double chi2(const Eigen::Vector3d& error, const Eigen::Vector3d& sigma) {
  return error.cwiseQuotient(sigma).squaredNorm();
}

TEST(LocalizeImu, GivesMetresGravityAndItsOwnErrorsWithoutATarget) {
  constexpr int num_seeds = 6;
  double num_used = 0.0, scales = 0.0, rates = 0.0, forces = 0.0, clocks = 0.0, gravities = 0.0;
  for (std::uint64_t seed = 1; seed <= num_seeds; ++seed) {
    const ImuRun run = swinging(seed);
    const Localization result = localize(run.frames, run.camera, with_imu(run), run.truth);
    ASSERT_TRUE(result.imu);
    ASSERT_EQ(result.imu->fault, ImuFault::none) << seed << ": " << result.verdict.sentence;
    num_used += 1.0;
    EXPECT_TRUE(result.is_scale_read);
    EXPECT_TRUE(result.verdict.ok()) << result.verdict.sentence;
    // The truth stands in a frame of its own: nothing says where a camera begins.
    EXPECT_EQ(result.verdict.sentence.find("another frame"), std::string::npos) << result.verdict.sentence;
    const ImuEstimate& imu = *result.imu;
    const double off = std::log(scale_of(result, run));
    RecordProperty("scale_percent_" + std::to_string(seed), std::to_string(100.0 * off));
    RecordProperty("sigma_percent_" + std::to_string(seed), std::to_string(100.0 * imu.sigma_scale));
    EXPECT_NEAR(off, 0.0, 0.01) << seed;
    EXPECT_LT(imu.sigma_scale, 0.01);
    scales += std::pow(off / imu.sigma_scale, 2);
    rates += chi2(imu.rate_bias - run.imu.rate_bias.back(), imu.sigma_rate_bias) / 3.0;
    forces += chi2(imu.force_bias - run.imu.force_bias.back(), imu.sigma_force_bias) / 3.0;
    clocks += std::pow(imu.late_s / imu.sigma_late_s, 2);
    // In the camera, where it does not depend on how the world lies.
    const Eigen::Vector3d is = result.path.back().world_from_cam.rotation.conjugate() * imu.gravity_in_world;
    const Eigen::Vector3d should = run.truth.back().world_from_cam.rotation.conjugate() * run.scene.gravity_in_world;
    EXPECT_LT((is - should).norm(), 3.0 * imu.sigma_gravity.norm()) << seed;
    EXPECT_LT(imu.sigma_gravity.norm(), 0.1) << seed;
    gravities += (is - should).norm();
  }
  ASSERT_EQ(num_used, num_seeds);
  for (double* sum : {&scales, &rates, &forces, &clocks, &gravities}) *sum /= num_used;
  RecordProperty("used", std::to_string(num_used));
  RecordProperty("nees_scale", std::to_string(scales));
  RecordProperty("nees_rate_bias", std::to_string(rates));
  RecordProperty("nees_force_bias", std::to_string(forces));
  RecordProperty("nees_clock", std::to_string(clocks));
  RecordProperty("gravity_m_s2", std::to_string(gravities));
  // Six draws of one number: 99.9 % within 3.7; of 18, which are not independent of each other, within 2.5.
  EXPECT_LT(gravities, 0.05);
  for (const double one : {scales, clocks}) EXPECT_LT(one, 3.7);
  for (const double three : {rates, forces}) EXPECT_LT(three, 2.5);
  EXPECT_GT(scales + clocks, 0.1);
}

/// A target that is given 3 % too large in all, as no observation of it shows.
TEST(LocalizeImu, ChecksTheScaleOfATarget) {
  for (const double larger : {1.0, 1.05}) {
    const ImuRun run = swinging(1);
    LocalizeConfig config = with_imu(run);
    for (KnownPoint point : run.target) {
      point.point_in_world *= larger;
      config.target.points.push_back(point);
    }
    const Localization result = localize(run.frames, run.camera, config, run.truth);
    ASSERT_EQ(result.sensor_scales.size(), 1u);
    const SensorScale& read = result.sensor_scales.front();
    ASSERT_GT(read.sigma_rel, 0.0) << result.verdict.sentence;
    EXPECT_LT(read.sigma_rel, 0.01);
    EXPECT_NEAR(std::log(read.scale * larger), 0.0, 3.5 * read.sigma_rel) << larger;
    const auto named = result.verdict.sentence.find("by the IMU than by the target");
    EXPECT_EQ(named != std::string::npos, larger != 1.0) << result.verdict.sentence;
  }
}

TEST(LocalizeImu, AClockThatIsOffIsFoundAndNamed) {
  ImuScene scene;
  scene.late_s = 0.12;
  const ImuRun run = swinging(2, scene);
  const Localization result = localize(run.frames, run.camera, with_imu(run), run.truth);
  ASSERT_TRUE(result.imu);
  EXPECT_EQ(result.imu->fault, ImuFault::none) << result.verdict.sentence;
  EXPECT_NEAR(result.imu->late_s, 0.12, 4.0 * result.imu->sigma_late_s);
  EXPECT_NE(result.verdict.sentence.find("the IMU's clock is 0.12 s after the camera's"), std::string::npos)
      << result.verdict.sentence;
  EXPECT_NEAR(std::log(scale_of(result, run)), 0.0, 3.5 * result.imu->sigma_scale);
}

/// An accelerometer that reads 3 % too much is that much of the scale, ten times what was given of it.
TEST(LocalizeImu, AScaleFactorThatIsOffIsNamed) {
  for (const double factor : {1.0, 0.97, 1.03}) {
    ImuRun run = swinging(4);
    for (ImuReading& each : run.imu.readings) each.force_m_s2 *= factor;
    const Localization result = localize(run.frames, run.camera, with_imu(run), {});
    ASSERT_TRUE(result.imu);
    const bool is_named = result.verdict.sentence.find("scale factor is off") != std::string::npos ||
                          result.verdict.to_add.find("scale factor is off") != std::string::npos;
    EXPECT_EQ(is_named, factor != 1.0) << factor << ": " << result.verdict.sentence << "; "
                                       << result.imu->gravity_sigmas;
  }
}

/// Axes of ordinary small IMUs: scales and angles off by 1 %. Taken for exact they put paths up to 12σ off.
TEST(LocalizeImu, AxesThatDifferALittleAreCounted) {
  for (std::uint64_t seed = 1; seed <= 3; ++seed) {
    Draws draws(seed + 900);
    ImuScene scene;
    for (double& each : scene.force_axes.reshaped()) each = 0.01 * draws.normal();
    for (double& each : scene.rate_axes.reshaped()) each = 0.01 * draws.normal();
    const ImuRun run = swinging(seed, scene);
    const Localization result = localize(run.frames, run.camera, with_imu(run), run.truth);
    ASSERT_TRUE(result.imu);
    ASSERT_EQ(result.imu->fault, ImuFault::none) << seed << ": " << result.verdict.sentence;
    EXPECT_LT(worst_sigmas(result, run), 4.0) << seed << ": " << result.verdict.sentence;
  }
}

TEST(LocalizeImu, AnAxisThatIsOffByMuchIsNamed) {
  ImuScene scene;
  scene.force_axes(1, 1) = 0.06;
  const ImuRun run = swinging(3, scene);
  const Localization result = localize(run.frames, run.camera, with_imu(run), run.truth);
  ASSERT_TRUE(result.imu);
  EXPECT_GT(result.imu->axes_sigmas, 3.5);
  EXPECT_NE(result.verdict.sentence.find("axes of the IMU differ in scale"), std::string::npos)
      << result.verdict.sentence;
}

/// Noise five times the one given: a path of few frames bends to it, and its residuals do not show it.
TEST(LocalizeImu, NoiseIsThatOfTheReadings) {
  ImuScene scene;
  scene.noise.rate_density *= 5.0;
  scene.noise.force_density *= 5.0;
  const ImuRun run = swinging(2, scene);
  LocalizeConfig config = with_imu(run);
  config.imu->noise = ImuNoise{};
  const Localization result = localize(run.frames, run.camera, config, run.truth);
  ASSERT_TRUE(result.imu);
  EXPECT_NEAR(result.imu->rate_noise_factor, 5.0, 1.0);
  EXPECT_NEAR(result.imu->force_noise_factor, 5.0, 1.0);
  EXPECT_LT(worst_sigmas(result, run), 4.0) << result.verdict.sentence;
}

TEST(LocalizeImu, WithoutAMountingItsRotationIsFound) {
  const ImuRun run = swinging(2);
  LocalizeConfig config = with_imu(run);
  config.imu->mounting.reset();
  const Localization result = localize(run.frames, run.camera, config, run.truth);
  ASSERT_TRUE(result.imu);
  ASSERT_EQ(result.imu->fault, ImuFault::none) << result.verdict.sentence;
  const Rigid3& should = run.scene.mounting.cam_from_imu;
  const Eigen::Vector3d off = log_so3(result.imu->cam_from_imu.rotation * should.rotation.conjugate());
  EXPECT_LT(off.norm(), 0.02);
  EXPECT_LT(chi2(off, result.imu->sigma_rotation_rad), 16.3);
  EXPECT_NEAR(std::log(scale_of(result, run)), 0.0, 3.5 * result.imu->sigma_scale);
}

TEST(LocalizeImu, GapsAndBlowsAreBridged) {
  ImuRun run = swinging(4);
  std::erase_if(run.imu.readings, [](const ImuReading& each) { return each.t_s > 3.0 && each.t_s < 4.0; });
  for (ImuReading& each : run.imu.readings)
    if (each.t_s > 6.0 && each.t_s < 6.03) each.force_m_s2.x() += 60.0;
  const Localization result = localize(run.frames, run.camera, with_imu(run), run.truth);
  ASSERT_TRUE(result.imu);
  ASSERT_EQ(result.imu->fault, ImuFault::none) << result.verdict.sentence;
  EXPECT_NEAR(static_cast<double>(result.imu->num_missing), 31.0, 2.0);
  EXPECT_GE(result.imu->num_rejected, 1u);
  EXPECT_NE(result.verdict.sentence.find("have no readings of the IMU"), std::string::npos) << result.verdict.sentence;
  EXPECT_NEAR(std::log(scale_of(result, run)), 0.0, 3.5 * result.imu->sigma_scale);
}

/// What is not as it is said to be is named, and the path is what it is without an IMU.
TEST(LocalizeImu, FaultsAreNamedAndNotUsed) {
  const ImuRun run = swinging(5);
  const auto fault_of = [&](const auto& change) {
    LocalizeConfig config = with_imu(run);
    change(*config.imu);
    const Localization result = localize(run.frames, run.camera, config, run.truth);
    EXPECT_FALSE(result.scale_known);
    EXPECT_EQ(result.verdict.state, State::care);
    EXPECT_NE(result.verdict.sentence.find("IMU"), std::string::npos) << result.verdict.sentence;
    return result.imu->fault;
  };
  const auto each_of = [](Imu& imu, const auto& change) {
    for (ImuReading& reading : imu.readings) change(reading);
  };
  EXPECT_EQ(fault_of([&](Imu& imu) { each_of(imu, [](ImuReading& r) { r.rate_rad_s *= 180.0 / std::numbers::pi; }); }),
            ImuFault::rate_degrees);
  EXPECT_EQ(fault_of([&](Imu& imu) { each_of(imu, [](ImuReading& r) { r.rate_rad_s *= 1.5; }); }), ImuFault::rate_unit);
  EXPECT_EQ(fault_of([&](Imu& imu) { each_of(imu, [](ImuReading& r) { r.force_m_s2 /= 9.80665; }); }),
            ImuFault::force_g);
  EXPECT_EQ(fault_of([&](Imu& imu) { each_of(imu, [](ImuReading& r) { r.force_m_s2 *= 1000.0; }); }),
            ImuFault::force_unit);
  EXPECT_EQ(fault_of([&](Imu& imu) { each_of(imu, [](ImuReading& r) { r.force_m_s2 *= -1.0; }); }), ImuFault::reversed);
  EXPECT_EQ(fault_of([&](Imu& imu) {
              each_of(imu, [](ImuReading& r) {
                r.rate_rad_s.x() *= -1.0;
                r.force_m_s2.x() *= -1.0;
              });
            }),
            ImuFault::mirrored);
  EXPECT_EQ(fault_of([&](Imu& imu) { imu.mounting->cam_from_imu.rotation = Eigen::Quaterniond::Identity(); }),
            ImuFault::mounting);
  EXPECT_EQ(fault_of([&](Imu& imu) { each_of(imu, [](ImuReading& r) { r.t_s += 1e9; }); }), ImuFault::other_time);
  EXPECT_EQ(fault_of([&](Imu& imu) {
              std::erase_if(imu.readings, [](const ImuReading& r) { return r.t_s < 2.0 || r.t_s > 3.5; });
            }),
            ImuFault::few);
  EXPECT_EQ(
      fault_of([&](Imu& imu) { each_of(imu, [](ImuReading& r) { std::swap(r.force_m_s2.x(), r.force_m_s2.z()); }); }),
      ImuFault::misfit);
}

/// Whoever removes gravity removes what tells the mounting's errors from accelerations.
TEST(LocalizeImu, GravityThatWasSubtractedIsNamed) {
  for (const double size_m : {0.05, 0.25}) {  // accelerations of 0.2 and 1.2 m/s², as much as gravity in g
    const auto path = [&](double t_s) { return Rigid3{exp_so3(swing(0.1, t_s)), swing(size_m, t_s)}; };
    ImuRun run = moving(path, 21);
    for (ImuReading& each : run.imu.readings) {
      const Eigen::Quaterniond imu_in_world =
          (path(each.t_s).rotation * run.scene.mounting.cam_from_imu.rotation).normalized();
      each.force_m_s2 += imu_in_world.conjugate() * run.scene.gravity_in_world;
    }
    const Localization result = localize(run.frames, run.camera, with_imu(run), {});
    ASSERT_TRUE(result.imu);
    EXPECT_FALSE(result.scale_known) << size_m;
    EXPECT_NE(result.verdict.sentence.find("gravity"), std::string::npos) << result.verdict.sentence;
    EXPECT_NE(result.verdict.sentence.find("subtracted"), std::string::npos) << result.verdict.sentence;
  }
}

/// At a constant velocity forces are the same whatever the unit of length.
TEST(LocalizeImu, AtAConstantVelocityTheScaleIsUnknown) {
  int num_solved = 0;
  for (std::uint64_t seed = 1; seed <= 3; ++seed) {
    for (const double turn_rad : {0.0, 0.15}) {
      const ImuRun run = moving(
          [&](double t_s) {
            return Rigid3{exp_so3(swing(turn_rad, t_s)), Eigen::Vector3d(-0.3 + 0.08 * t_s, 0.1 - 0.02 * t_s, 0.0)};
          },
          seed);
      const Localization result = localize(run.frames, run.camera, with_imu(run), run.truth);
      ASSERT_TRUE(result.imu);
      EXPECT_FALSE(result.scale_known);
      EXPECT_EQ(result.verdict.state, State::care);
      EXPECT_NE(result.verdict.sentence.find("IMU"), std::string::npos) << result.verdict.sentence;
      if (!result.is_smoothed) continue;  // a filter's rotations are not good enough to say that forces are constant
      ++num_solved;
      EXPECT_EQ(result.imu->fault, ImuFault::still)
          << seed << ", " << turn_rad << ": " << result.verdict.sentence << ", scale " << result.imu->scale << " ± "
          << result.imu->sigma_scale << ", true " << 1.0 / scale_of(result, run);
      EXPECT_NE(result.verdict.sentence.find("accelerates too little for the IMU"), std::string::npos)
          << result.verdict.sentence;
    }
  }
  EXPECT_GE(num_solved, 4);
}

/// Without a given mounting rotations have to determine it: about one axis they leave the rotation about it free.
TEST(LocalizeImu, AMountingThatRotationsDoNotDetermineIsNamed) {
  for (const double turn_rad : {0.0, 0.2}) {
    const ImuRun run = moving(
        [&](double t_s) {
          return Rigid3{exp_so3(Eigen::Vector3d(0.0, swing(turn_rad, t_s).x(), 0.0)), swing(0.1, t_s)};
        },
        31);
    LocalizeConfig config = with_imu(run);
    const Localization with = localize(run.frames, run.camera, config, run.truth);
    ASSERT_TRUE(with.imu);
    EXPECT_EQ(with.imu->fault, ImuFault::none) << turn_rad << ": " << with.verdict.sentence;
    EXPECT_NEAR(std::log(scale_of(with, run)), 0.0, 3.5 * with.imu->sigma_scale);
    config.imu->mounting.reset();
    const Localization without = localize(run.frames, run.camera, config, run.truth);
    ASSERT_TRUE(without.imu);
    EXPECT_EQ(without.imu->fault, ImuFault::unmounted) << turn_rad << ": " << without.verdict.sentence;
    EXPECT_FALSE(without.scale_known);
    EXPECT_NE(without.verdict.sentence.find("no mounting of the IMU is given"), std::string::npos)
        << without.verdict.sentence;
  }
}

}  // namespace
}  // namespace alidade
