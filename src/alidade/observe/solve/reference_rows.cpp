#include "alidade/observe/solve/reference_rows.h"

#include <algorithm>

#include "alidade/observe/solve/rotation_model.h"

namespace alidade {
namespace {

constexpr std::size_t max_turns = 240;  // the solve is cubic in the number of rotations or of points

/// Measured rotations are eliminated one by one if there are few points; the cost per rotation is quadratic in these.
std::size_t most_rows(std::span<const RotationFrame> frames, std::size_t num_points, EstimatedRotations rotations) {
  constexpr double most = 4e8;  // products: a second or less
  const auto segments = static_cast<std::size_t>(
      std::ranges::count_if(frames, [](const RotationFrame& frame) { return frame.starts_segment; }));
  const bool are_measured = rotations == EstimatedRotations::measured;
  if (!are_measured || num_points * (segments + 1) > max_turns) return max_turns;
  const double side = static_cast<double>(max_common + 3 * num_points);
  return std::max(static_cast<std::size_t>(most / (side * side)), max_turns);
}

}  // namespace

EstimatedRotations estimated_rotations(RotationKnowledge rotation, RotationSource source) {
  if (rotation == RotationKnowledge::known) return EstimatedRotations::none;
  const bool walk = source == RotationSource::rate;
  return walk || source == RotationSource::none ? EstimatedRotations::free : EstimatedRotations::measured;
}

std::vector<bool> reference_rows(std::span<const RotationFrame> frames, double from_s, double until_s,
                                 std::size_t num_points, EstimatedRotations rotations) {
  const bool are_known = rotations == EstimatedRotations::none;
  std::vector<bool> is_chosen;
  for (const RotationFrame& frame : frames) {
    const bool is_between = frame.t_s >= from_s - 1e-9 && frame.t_s <= until_s + 1e-9;
    is_chosen.push_back(is_between && (are_known || std::ranges::any_of(frame.px, is_seen)));
  }
  if (are_known) return is_chosen;
  const auto rows = static_cast<std::size_t>(std::ranges::count(is_chosen, true));
  const std::size_t most = most_rows(frames, num_points, rotations), stride = (rows + most - 1) / most;
  std::size_t at = 0;
  for (std::size_t k = 0; k < frames.size(); ++k) {
    if (is_chosen[k]) is_chosen[k] = at++ % stride == 0;
  }
  return is_chosen;
}

}  // namespace alidade
