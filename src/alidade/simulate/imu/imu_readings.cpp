#include "alidade/simulate/imu/imu_readings.h"

#include <cmath>

#include "alidade/simulate/draws.h"

namespace alidade {

ImuSequence simulate_imu(const ImuScene& scene, const std::function<Rigid3(double t_s)>& world_from_cam, double from_s,
                         double to_s, std::uint64_t seed) {
  constexpr double h = 2e-4;
  Draws draws(seed);
  ImuSequence out;
  const double period_s = 1.0 / scene.rate_hz, root_s = std::sqrt(period_s);
  const auto imu_at = [&](double t_s) { return world_from_cam(t_s) * scene.mounting.cam_from_imu; };
  Eigen::Vector3d rate_bias = scene.rate_bias, force_bias = scene.force_bias;
  const auto num = static_cast<std::size_t>(std::floor((to_s - from_s) * scene.rate_hz + 1e-6)) + 1;
  for (std::size_t i = 0; i < num; ++i) {
    const double t_s = from_s + static_cast<double>(i) * period_s;
    const Rigid3 before = imu_at(t_s - h), now = imu_at(t_s), after = imu_at(t_s + h);
    const Eigen::Vector3d acceleration = (after.translation - 2.0 * now.translation + before.translation) / (h * h);
    ImuReading reading;
    reading.t_s = t_s + scene.late_s;
    const Eigen::Vector3d rate = log_so3(before.rotation.conjugate() * after.rotation) / (2.0 * h),
                          force = now.rotation.conjugate() * (acceleration - scene.gravity_in_world);
    reading.rate_rad_s =
        rate + scene.rate_axes * rate + rate_bias + scene.noise.rate_density / root_s * draws.normal3();
    reading.force_m_s2 = (force + scene.force_axes * force) / (1.0 + scene.force_scale) + force_bias +
                         scene.noise.force_density / root_s * draws.normal3();
    out.readings.push_back(reading);
    out.rate_bias.push_back(rate_bias);
    out.force_bias.push_back(force_bias);
    rate_bias += scene.noise.rate_walk * root_s * draws.normal3();
    force_bias += scene.noise.force_walk * root_s * draws.normal3();
  }
  return out;
}

}  // namespace alidade
