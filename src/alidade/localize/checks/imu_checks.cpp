#include <fmt/format.h>

#include <algorithm>
#include <cmath>

#include "alidade/geometry/degree.h"
#include "alidade/localize/checks/judge.h"

// Checks of an IMU beside the camera.

namespace alidade {
namespace {

std::string mounting_text(const ImuEstimate& imu) {
  const Eigen::Quaterniond& q = imu.cam_from_imu.rotation;
  return fmt::format(
      "the IMU's axes are rotated by {:.3g}° from the given mounting; by its rotations quaternion_wxyz is [{:.4f}, "
      "{:.4f}, {:.4f}, {:.4f}]",
      imu.angle_rad / degree, q.w(), q.x(), q.y(), q.z());
}

std::string misfit_text(const ImuEstimate& imu) {
  const bool is_of_path = imu.force_noise_factor > 1.0 || imu.rate_noise_factor > 1.0;
  const std::string what =
      is_of_path
          ? fmt::format(
                "the IMU's readings do not fit the path (noise of rates {:.2g}, of forces {:.2g} times the given "
                "one)",
                imu.rate_noise_factor, imu.force_noise_factor)
          : "the IMU's forces do not fit the path";
  return what + ": check the axes and units of the accelerometer";
}

std::string rate_fault_text(const ImuEstimate& imu) {
  switch (imu.fault) {
    case ImuFault::rate_degrees:
      return "the IMU's angular rates are in degrees per second, not rad/s";
    case ImuFault::rate_unit:
      return "the camera rotates " + text_of(imu.ratio) +
             " times as fast as the IMU's angular rates say: another unit?";
    case ImuFault::mirrored:
      return "the IMU's axes are left-handed: one has the wrong sign, or two are exchanged";
    case ImuFault::mounting:
      return mounting_text(imu);
    case ImuFault::unmounted:
      return "no mounting of the IMU is given, and the camera rotates too little to determine it";
    default:
      return "the IMU's angular rates and the camera's rotations have nothing in common: another recording, or a clock "
             "that is off by more than a second";
  }
}

std::string force_fault_text(const ImuEstimate& imu) {
  switch (imu.fault) {
    case ImuFault::force_g:
      return "the IMU's forces are in g, not m/s²";
    case ImuFault::force_unit:
      return "the IMU's mean force is " + text_of(imu.ratio) + " times gravity: another unit?";
    case ImuFault::no_gravity:
      return "gravity has been subtracted from the IMU's forces (on average " + text_of(imu.ratio) +
             " of it is left): they have to be as the accelerometer reads them";
    default:
      return "the IMU's forces have the other sign: at rest the axis that points upwards reads +9.81 m/s²";
  }
}

}  // namespace

std::string imu_fault_text(const ImuEstimate& imu) {
  switch (imu.fault) {
    case ImuFault::none:
      return "";
    case ImuFault::other_time:
      return "none of the IMU's readings is of the time of the path (t_s)";
    case ImuFault::few:
      return "too few of the IMU's readings are of the time of the path, between gaps: a scale needs some three "
             "seconds";
    case ImuFault::rate_degrees:
    case ImuFault::rate_unit:
    case ImuFault::mirrored:
    case ImuFault::mounting:
    case ImuFault::unmounted:
    case ImuFault::other_motion:
      return rate_fault_text(imu);
    case ImuFault::force_g:
    case ImuFault::force_unit:
    case ImuFault::no_gravity:
    case ImuFault::reversed:
      return force_fault_text(imu);
    case ImuFault::still:
      return "the camera accelerates too little for the IMU to determine the scale";
    case ImuFault::misfit:
      return misfit_text(imu);
    case ImuFault::unsettled:
      return "the path could not be solved with the IMU's readings";
  }
  return "";
}

namespace {

/// Bias walks that exceed the given density, and a clock that runs fast.
void add_drifts(const ImuEstimate& imu, Verdict& verdict) {
  constexpr double any_clock_rate = 5e-4;
  const auto add = [&](const char* sensor, double factor, const Eigen::Vector3d& by, const char* unit) {
    if (!(factor > 1.0)) return;
    verdict.checks.push_back(
        {"IMU drift", State::care,
         fmt::format(
             "the bias of the IMU's {0} drifts, by {1:.2g}, {2:.2g}, {3:.2g} {4} over the path, {5:.2g} times as "
             "much as --{0}-walk says: estimated with the path; let it warm up, or give --{0}-walk",
             sensor, by.x(), by.y(), by.z(), unit, factor),
         factor, 1.0, "1", "path"});
  };
  add("gyro", imu.rate_walk_factor, imu.rate_drift, "rad/s");
  add("accelerometer", imu.force_walk_factor, imu.force_drift, "m/s²");
  if (std::abs(imu.clock_rate) > any_clock_rate)
    verdict.checks.push_back(
        {"IMU clock rate", State::care,
         fmt::format("the IMU's clock runs {:.2g} ± {:.1g} % {}: corrected", 100.0 * std::abs(imu.clock_rate),
                     100.0 * imu.sigma_clock_rate, imu.clock_rate > 0.0 ? "fast" : "slow"),
         std::abs(imu.clock_rate), any_clock_rate, "1", "path"});
}

}  // namespace

bool clocks_differ(const Localization& report) {
  constexpr double apart = 3.5, ordinary_s = 0.005;  // as for time stamps at the start of exposure
  const auto clock = std::ranges::find(report.given, "clock", &GivenNumber::name);
  if (!report.imu || clock == report.given.end() || clock->sigma == 0.0) return false;
  const double late = std::abs(report.imu->late_s),
               sigma = std::hypot(report.imu->sigma_late_s, clock->sigma.value_or(0.0));
  return late > ordinary_s && late > apart * sigma && late * clock->moves > 1.0;
}

/// Checks of readings that are used: deviations from what was given.
void add_imu(const Localization& report, Verdict& verdict) {
  if (!report.imu || report.imu->fault != ImuFault::none) return;
  const ImuEstimate& imu = *report.imu;
  constexpr double many = 0.05, much = 3.0, apart = 3.5, scales_apart = 3.0;
  if (imu.gravity_sigmas > scales_apart)
    verdict.checks.push_back(
        {"IMU scale factor", State::care,
         fmt::format(
             "by the IMU's forces gravity is {:.3f} m/s², not as given ({:.2g}σ): their scale factor is off by "
             "more than its σ, and the path's scale by as much; calibrate it, or give --sigma-accelerometer-scale",
             imu.gravity_in_world.norm(), imu.gravity_sigmas),
         imu.gravity_sigmas, scales_apart, "σ", "path"});
  if (imu.axes_sigmas > apart)
    verdict.checks.push_back(
        {"IMU axes", State::care,
         fmt::format("axes of the IMU differ in scale, or are not perpendicular, by {:.2g} % ({:.2g}σ): estimated with "
                     "the path; calibrate it, or give --sigma-imu-axes",
                     100.0 * imu.axes_differ, imu.axes_sigmas),
         imu.axes_sigmas, apart, "σ", "path"});
  const double late = std::abs(imu.late_s);
  if (late > imu.frame_period_s || clocks_differ(report))
    verdict.checks.push_back(
        {"IMU clock", State::care,
         fmt::format(
             "the IMU's clock is {:.3g} s {} the camera's, {:.2g} frames: corrected; or are the frames' times {}?",
             late, imu.late_s > 0.0 ? "after" : "before", late / imu.frame_period_s,
             imu.late_s > 0.0 ? "early" : "late"),
         late, std::min(late, imu.frame_period_s), "s", "path"});
  add_drifts(imu, verdict);
  const double num = static_cast<double>(imu.num_steps + imu.num_rejected + imu.num_missing);
  const double missing = static_cast<double>(imu.num_missing) / num,
               rejected = static_cast<double>(imu.num_rejected) / num;
  if (missing > many)
    verdict.checks.push_back({"IMU readings", State::care,
                              text_of(100.0 * missing, 2) + " % of the frames have no readings of the IMU around them",
                              missing, many, "1", "path"});
  if (rejected > many)
    verdict.checks.push_back({"IMU rejected", State::care,
                              text_of(100.0 * rejected, 2) + " % of the IMU's readings are rejected", rejected, many,
                              "1", "path"});
  const double noise = std::max(imu.rate_noise_factor, imu.force_noise_factor);
  if (noise > much)
    verdict.checks.push_back({"IMU noise", State::care,
                              "the noise of the IMU's " +
                                  std::string(imu.force_noise_factor > imu.rate_noise_factor ? "forces" : "rates") +
                                  " is " + text_of(noise, 2) + " times the given one; σ is enlarged for it",
                              noise, much, "1", "path"});
}

}  // namespace alidade
