#include <algorithm>
#include <numbers>

#include "alidade/simulate/draws.h"
#include "alidade/simulate/rotation.h"

namespace alidade {
namespace {

void wrong_angles(const RotationFaults& faults, Draws& draws, RotationLog& log) {
  std::array<double, 2> once{}, twice{}, camera{};
  for (std::size_t axis = 0; axis < 2; ++axis) {
    once[axis] = draws.uniform(0.0, 2.0 * std::numbers::pi);
    twice[axis] = draws.uniform(0.0, 2.0 * std::numbers::pi);
    camera[axis] = log.rows.front().pan_tilt_roll_rad[static_cast<Eigen::Index>(axis)];
  }
  for (RotationRow& row : log.rows) {
    for (std::size_t i = 0; i < 2; ++i) {
      const auto axis = static_cast<Eigen::Index>(i);
      double& angle = row.pan_tilt_roll_rad[axis];
      const double truth = angle, half = 0.5 * faults.backlash_rad;
      camera[i] = std::clamp(camera[i], truth - half, truth + half);
      angle += truth - camera[i];  // the encoder is ahead of the camera by what the play leaves
      angle += faults.once_a_turn_rad * std::sin(truth + once[i]);
      angle += faults.twice_a_turn_rad * std::sin(2.0 * truth + twice[i]);
      angle = faults.signs[axis] * (faults.angle_scale * angle + faults.zero_drift_rad_per_s[axis] * row.t_s);
    }
    if (faults.swaps_axes) std::swap(row.pan_tilt_roll_rad.x(), row.pan_tilt_roll_rad.y());
  }
}

void move_points(const RotationFaults& faults, Draws& draws, RotationLog& log) {
  const auto count = static_cast<std::size_t>(faults.moving_share * static_cast<double>(log.num_points) + 0.5);
  constexpr double fastest_px_per_s = 20.0;
  for (std::size_t i = 0; i < std::min(count, log.num_points); ++i) {
    const Eigen::Vector2d speed = draws.uniform(0.2, 1.0) * fastest_px_per_s * draws.normal2().normalized();
    for (RotationRow& row : log.rows) row.px[i] += speed * row.t_s;
  }
}

void add_lasting_noise(const RotationFaults& faults, Draws& draws, RotationLog& log) {
  std::vector<Eigen::Vector2d> state;
  for (std::size_t i = 0; i < log.num_points; ++i) state.push_back(faults.noise_px * draws.normal2());
  for (std::size_t k = 0; k < log.rows.size(); ++k) {
    const double elapsed_s = k > 0 ? log.rows[k].t_s - log.rows[k - 1].t_s : 0.0;
    const double keep = faults.noise_lasts_s > 0.0 ? std::exp(-elapsed_s / faults.noise_lasts_s) : 0.0;
    for (std::size_t i = 0; i < log.num_points; ++i) {
      state[i] = keep * state[i] + std::sqrt(1.0 - keep * keep) * faults.noise_px * draws.normal2();
      log.rows[k].px[i] += state[i];
    }
  }
}

void mix_up(const RotationFaults& faults, int width_px, int height_px, Draws& draws, RotationLog& log) {
  for (RotationRow& row : log.rows) {
    for (std::size_t i = 0; i < log.num_points; ++i) {
      if (is_seen(row.px[i]) && draws.uniform() < faults.wrong_share) {
        row.px[i] = {draws.uniform(0.0, width_px), draws.uniform(0.0, height_px)};
      }
      // Two pixels a swap.
      if (draws.uniform() < 0.5 * faults.swapped_share) {
        const auto other = static_cast<std::size_t>(draws.uniform(0.0, static_cast<double>(log.num_points)));
        std::swap(row.px[i], row.px[std::min(other, log.num_points - 1)]);
      }
    }
  }
}

/// Rows that have no image any more are left out.
void drop_images(int every, RotationLog& log) {
  const auto kept = static_cast<std::size_t>(every - 1);
  std::size_t num = 0;
  for (; num + num / kept < log.rows.size(); ++num) log.rows[num].px = log.rows[num + num / kept].px;
  log.rows.resize(num);
  if (!log.truth.empty()) log.truth.resize(num);
}

void repeat_images(int every, RotationLog& log) {
  for (std::size_t k = 1; k < log.rows.size(); ++k)
    if ((k + 1) % static_cast<std::size_t>(every) == 0) log.rows[k].px = log.rows[k - 1].px;
}

}  // namespace

bool RotationFaults::are_of_rotation() const {
  return angle_scale != 1.0 || backlash_rad != 0.0 || once_a_turn_rad != 0.0 || twice_a_turn_rad != 0.0 ||
         !zero_drift_rad_per_s.isZero(0.0) || swaps_axes || signs != Eigen::Vector2d::Ones();
}

void add_faults(const RotationFaults& faults, int width_px, int height_px, std::uint64_t seed, RotationLog& log) {
  Draws draws(seed + 77);
  if (log.rows.empty()) return;
  if (log.source == RotationSource::head && faults.are_of_rotation()) {
    wrong_angles(faults, draws, log);
    log.sigma_scale = log.sigma_parallax = std::nullopt;
  }
  if (faults.moving_share > 0.0) move_points(faults, draws, log);
  if (faults.noise_px > 0.0) add_lasting_noise(faults, draws, log);
  if (faults.wrong_share > 0.0 || faults.swapped_share > 0.0) mix_up(faults, width_px, height_px, draws, log);
  if (faults.repeated_every > 1) repeat_images(faults.repeated_every, log);
  if (faults.missing_every > 1) drop_images(faults.missing_every, log);
}

}  // namespace alidade
