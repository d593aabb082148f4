#include <fmt/format.h>

#include <array>
#include <cmath>
#include <numbers>

#include "alidade/capture.h"
#include "alidade/capture/outline.h"
#include "alidade/geometry/degree.h"
#include "alidade/rangefinder.h"

namespace alidade {
namespace {

std::string farther_side(double azimuth_rad) {
  constexpr std::array<const char*, 4> sides{"right", "lower", "left", "upper"};
  const double quarter = azimuth_rad / (0.5 * std::numbers::pi);
  return sides[static_cast<std::size_t>(static_cast<long>(std::lround(quarter)) % 4 + 4) % 4];
}

std::string words_of_shot(double distance_m, double tilt_rad, double azimuth_rad) {
  const double tilt_deg = tilt_rad / degree;
  if (tilt_deg < 5.0) return fmt::format("{:.1f} m away, facing the camera", distance_m);
  return fmt::format("{:.1f} m away, tilted by {:.0f}°, the {} side farther", distance_m, tilt_deg,
                     farther_side(azimuth_rad));
}

/// Near and far, tilted to each side in turn: what no shots determine together is where all are alike.
std::string words_of_start(std::size_t shot, const ShotConfig& where) {
  const double far_share = shot % 3 == 0 ? 0.1 : shot % 3 == 1 ? 0.8 : 0.4;
  const double tilt_rad = std::min(30.0, where.max_tilt_deg) * degree;
  return words_of_shot(where.min_range_m + far_share * (where.max_range_m - where.min_range_m), tilt_rad,
                       0.5 * std::numbers::pi * static_cast<double>(shot % 4));
}

}  // namespace

ShotGuide::ShotGuide(Camera camera, RangefinderConfig config, ShotConfig where)
    : camera_(std::move(camera)), config_(std::move(config)), where_(where) {
  where_.shots = 1;
  ShotConfig copy = where_;
  const std::vector<std::string> faults = faults_of(fields_of(copy));
  if (!faults.empty()) throw ConfigError(fmt::format("{}", fmt::join(faults, "; ")));
  (void)rangefinder({}, camera_, config_);  // its faults, before the first shot
  state_.words = words_of_start(0, where_);
}

const ShotGuideState& ShotGuide::push(const Shot& shot) {
  if (!std::isfinite(shot.range_m)) throw ConfigError("range_m is not finite");
  std::vector<Shot> with = shots_;
  with.push_back(shot);
  std::swap(with, shots_);
  try {
    solve();
  } catch (...) {
    std::swap(with, shots_);
    throw;
  }
  return state_;
}

void ShotGuide::undo() {
  if (shots_.empty()) return;
  shots_.pop_back();
  solve();
}

void ShotGuide::solve() {
  const RangefinderCalibration result = rangefinder(shots_, camera_, config_);
  ShotGuideState state;
  state.shots = static_cast<int>(shots_.size());
  state.verdict = result.verdict;
  state.has_beam = result.status == RangefinderReport::Status::converged;
  state.words = words_of_start(shots_.size(), where_);
  if (state.has_beam) {
    state.beam = result.beam;
    state.sigma_origin_m = std::sqrt(result.beam.cov.topLeftCorner<3, 3>().trace());
    const ShotPlan plan = plan_shots(beam_now(result, result.config), where_);
    if (!plan.shots.empty()) {
      state.next = plan.shots.front();
      state.outline_px =
          outline_of(camera_, beam_now(result, result.config).points_in_board, state.next->cam_from_board);
      state.words = words_of_shot(state.next->distance_m, state.next->tilt_rad, state.next->azimuth_rad);
    }
  }
  state_ = std::move(state);
}

}  // namespace alidade
