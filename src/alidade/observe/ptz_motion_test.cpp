#include <gtest/gtest.h>

#include <algorithm>
#include <cstdlib>
#include <numbers>

#include "alidade/files/csv.h"
#include "alidade/observe/filters/hybrid.h"
#include "alidade/observe/solve/solve.h"
#include "alidade/simulate/draws.h"
#include "alidade/simulate/rotation.h"

namespace alidade {
namespace {

/// Pan, tilt [rad] and focal length [px] of a real broadcast camera, one row per frame.
struct BroadcastMotion {
  std::vector<double> pan_rad, tilt_rad, f_px;
  double rate_hz = 30.0;

  [[nodiscard]] double at(const std::vector<double>& values, double t_s) const {
    const double place = std::clamp(t_s * rate_hz, 0.0, static_cast<double>(values.size() - 1) - 1e-9);
    const auto k = static_cast<std::size_t>(place);
    const double share = place - static_cast<double>(k);
    return values[k] + share * (values[k + 1] - values[k]);
  }
};

std::optional<BroadcastMotion> broadcast(const std::string& name) {
  const char* data = std::getenv("ALIDADE_DATA");
  if (!data) return std::nullopt;
  const Csv csv = Csv::read(std::string(data) + "/data/ptz-sports/" + name + "_ptz.csv");
  BroadcastMotion motion;
  for (std::size_t row = 0; row < csv.num_rows(); ++row) {
    motion.pan_rad.push_back(csv.number(row, "pan_deg") * std::numbers::pi / 180.0);
    motion.tilt_rad.push_back(csv.number(row, "tilt_deg") * std::numbers::pi / 180.0);
    motion.f_px.push_back(csv.number(row, "f_px"));
  }
  return motion;
}

/// Before the broadcast the operator sways the camera, zoom at rest, for a period of the paper's motion.
const double sway_s = 2.0 * std::numbers::pi / 0.8;

/// Points all around the field, of which the image holds a dozen at a time.
RotationLog log_of(const BroadcastMotion& motion, double first_s, std::uint64_t seed) {
  RotationScene scene;
  scene.width_px = 1280;
  scene.height_px = 720;
  Draws draws(seed);
  for (int i = 0; i < 60; ++i)
    scene.start_px.emplace_back(draws.uniform(-1200.0, 2500.0), draws.uniform(-300.0, 1000.0));
  scene.intrinsics = [&motion, first_s](double t_s) {
    const double f = motion.at(motion.f_px, t_s - first_s);
    return RotatingIntrinsics{f, f, 640.0, 360.0};
  };
  scene.motion = [&motion, first_s](double t_s) {
    const Eigen::Vector3d broadcast(motion.at(motion.pan_rad, t_s - first_s), motion.at(motion.tilt_rad, t_s - first_s),
                                    0.0);
    return Eigen::Vector3d(broadcast + (t_s < first_s ? 0.5 : 0.0) * paper_pan_tilt(t_s, 0.0));
  };
  RotationLogConfig config;
  config.source = RotationSource::head;
  config.rate_hz = motion.rate_hz;
  config.duration_s = first_s + static_cast<double>(motion.f_px.size() - 1) / motion.rate_hz;
  config.sigma_px = 0.3;
  config.clip_to_image = true;
  return simulate_rotation(scene, config, seed);
}

ObserveSetup config_for_broadcast() {
  ObserveSetup config;
  config.width_px = 1280;
  config.height_px = 720;
  return config;
}

/// The real motion drives the simulator; the estimate follows the real zoom, which never rests.
void follow(const std::string& name, double median_most, double p95_most) {
  const auto motion = broadcast(name);
  if (!motion) GTEST_SKIP() << "ALIDADE_DATA is not set: the motion of real broadcast cameras is not at hand";
  const RotationLog log = log_of(*motion, sway_s, 1);
  const ObserveSolution report = solve_intrinsics(log, config_for_broadcast());
  ASSERT_EQ(report.status, ObserveSolution::Status::ok);
  std::vector<double> errors;
  std::size_t inside = 0;
  for (std::size_t k = 60; k < log.rows.size(); ++k) {
    ASSERT_TRUE(report.steps[k].has_value) << "row " << k;
    const double error = std::abs(report.steps[k].fx - log.truth[k][0]);
    errors.push_back(error / log.truth[k][0]);
    inside += error < 3.0 * report.steps[k].sigma[0];
  }
  std::ranges::sort(errors);
  EXPECT_LT(errors[errors.size() / 2], median_most);
  EXPECT_LT(errors[errors.size() * 95 / 100], p95_most);
  EXPECT_GT(static_cast<double>(inside) / static_cast<double>(errors.size()), 0.98);
  ::testing::Test::RecordProperty("median", std::to_string(errors[errors.size() / 2]));
}

TEST(PtzMotion, AFootballCameraIsFollowedFrom4200To1900Pixels) { follow("soccer2", 1e-3, 3e-3); }
TEST(PtzMotion, ABasketballCameraIsFollowedOverTwoMinutes) { follow("basketball", 1e-3, 3e-3); }

TEST(PtzMotion, AZoomThatNeverRestsIsRefusedNotGuessed) {
  const auto motion = broadcast("soccer2");
  if (!motion) GTEST_SKIP() << "ALIDADE_DATA is not set: the motion of real broadcast cameras is not at hand";
  const RotationLog log = log_of(*motion, 0.0, 1);
  for (const ObserveMethod method : {ObserveMethod::hybrid, ObserveMethod::batch}) {
    ObserveSetup config = config_for_broadcast();
    config.method = method;
    const ObserveSolution report = solve_intrinsics(log, config);
    const Verdict verdict = observe_verdict(report, log, config);
    EXPECT_NE(verdict.exit_code, ExitCode::ok) << verdict.sentence;
    EXPECT_NE((verdict.sentence + verdict.to_add).find("zoom"), std::string::npos) << verdict.sentence;
  }
}

}  // namespace
}  // namespace alidade
