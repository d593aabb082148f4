#pragma once

#include <span>
#include <vector>

#include "alidade/beam/beam.h"
#include "alidade/rangefinder/checks/shot_residual.h"

namespace alidade {

/// Beam from the spots' rays and readings: null vector of −L A + ray-direction …, two rows per spot, scaled,
/// then |A| = 1 and the spots in front of the camera. At least three spots. Wang & Li 2020, eq. (5)–(6).
[[nodiscard]] std::optional<Beam> spot_start(std::span<const PreparedShot* const> shots);

/// Beams that fit the planes best, min Σ (nᵢ·B + Lᵢ nᵢ·A + dᵢ)² with |A| = 1: every stationary point in front of the
/// camera, best first; with five planes the two exact fits. The solution of Wang & Li 2020, eq. (12), by unconstrained
/// least squares needs six planes and is less accurate.
[[nodiscard]] std::vector<Beam> plane_starts(std::span<const PreparedShot* const> shots);

/// Both kinds of equations together, each divided by its σ, with |A| = 1 imposed only at the end: linear from two shots
/// that have both. `focal_px`: of the lens, for the weight of a spot. With a scale to estimate, |A| is that scale.
[[nodiscard]] std::optional<Beam> joint_start(std::span<const PreparedShot* const> shots, const ShotModel& model,
                                              double focal_px, bool estimate_scale);

}  // namespace alidade
