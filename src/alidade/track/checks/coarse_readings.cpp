#include <algorithm>
#include <cmath>
#include <vector>

#include "alidade/geometry/degree.h"
#include "alidade/track/checks/explanation.h"

namespace alidade {
namespace {

/// The step of which all readings of an axis are multiples; 0: none, or too few readings.
double reading_step_rad(std::span<const TargetObservation> observations, std::size_t head, int axis) {
  constexpr std::size_t least = 5;
  constexpr double same_rad = 1e-6, whole = 0.02;
  std::vector<double> readings;
  for (const TargetObservation& one : observations)
    if (one.head == head) readings.push_back(one.pan_tilt_rad[axis]);
  std::ranges::sort(readings);
  const auto is_same = [](double a, double b) { return std::abs(a - b) < same_rad; };
  readings.erase(std::unique(readings.begin(), readings.end(), is_same), readings.end());
  if (readings.size() < least) return 0.0;
  double step_rad = readings.back() - readings.front();
  for (std::size_t i = 1; i < readings.size(); ++i) step_rad = std::min(step_rad, readings[i] - readings[i - 1]);
  const bool is_multiple = std::ranges::all_of(readings, [&](double reading) {
    const double steps = (reading - readings.front()) / step_rad;
    return std::abs(steps - std::round(steps)) < whole;
  });
  return is_multiple && step_rad > 100.0 * same_rad ? step_rad : 0.0;
}

}  // namespace

std::optional<Check> coarse_readings(std::span<const TargetObservation> observations, std::span<const RigHead> heads,
                                     const FollowConfig& config) {
  constexpr double more = 1.5;  // times the stated σ
  std::optional<Check> coarsest;
  for (std::size_t head = 0; head < heads.size(); ++head) {
    const double own = heads[head].head.encoder.sigma_rad;
    const double stated_rad = own > 0.0 ? own : config.tracker.sigma_encoder_rad;
    for (const int axis : {0, 1}) {
      const double step_rad = reading_step_rad(observations, head, axis), sigma_rad = step_rad / std::sqrt(12.0);
      if (!(sigma_rad > more * stated_rad) || (coarsest && sigma_rad <= coarsest->value)) continue;
      coarsest = Check{"encoder",
                       State::care,
                       "head " + std::to_string(heads[head].head.id) + " reads its " + (axis == 0 ? "pan" : "tilt") +
                           " in steps of " + text_of(step_rad / degree, 2) + "°, which errs by " +
                           text_of(sigma_rad / degree, 2) + "° (σ), for " + text_of(stated_rad / degree, 2) +
                           "° stated: what else does not fit may come from that",
                       sigma_rad,
                       stated_rad,
                       "rad",
                       "track"};
    }
  }
  return coarsest;
}

std::string coarse_readings_remedy(const Check& coarse) {
  return "state sigma_rad: " + text_of(coarse.value, 2) +
         " for the encoder in the rig file (or --sigma-angle), or read " + "it more finely";
}

}  // namespace alidade
