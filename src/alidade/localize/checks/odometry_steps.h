#pragma once

#include <Eigen/Core>
#include <cstddef>
#include <optional>
#include <span>
#include <vector>

// Length of a vehicle's path by odometry, relative to the camera's path: from steps between readings. White noise of
// the readings lengthens all distances between them, so no distances are used: steps are fitted to those of the path.

namespace alidade {

/// Positions of camera and vehicle at one time.
struct Place {
  Eigen::Vector3d of_path, of_vehicle;
  double way_m = 0.0;          ///< Length of the camera's path since the first.
  double path_variance = 0.0;  ///< Of the path's position, sum of the three axes.
  std::size_t reading = 0;     ///< Index of its reading.
};

struct StepScale {
  double log = 0.0, sigma = 0.0;  ///< ln of metres of the vehicle per unit of the path.
  std::size_t num_given = 0, num_used = 0;
};

/// Fits the steps of the vehicle to those of the path, with one rotation for each fifth of the way, by weighted least
/// squares: white noise of the positions and a random walk, both estimated from the residuals. Outlier steps (spinning
/// wheels) are rejected. σ is that of both errors, or from the scatter of the fifths. Empty: too few steps, or the
/// camera hardly moves.
[[nodiscard]] std::optional<StepScale> scale_by_steps(std::span<const Place> places);

/// A part of the way on which wheels slip: all its steps are longer, or shorter, by one factor.
struct Slip {
  std::size_t begin = 0, end = 0;       ///< Steps: the first is from place 0 to place 1.
  double ratio = 1.0;                   ///< Way of the vehicle there over that of the path.
  std::vector<Eigen::Vector3d> excess;  ///< Excess of each of these steps over the path's, in the vehicle's frame.
};
/// The part, of at most a quarter of the steps, whose scale differs most from the overall one, by a tenth or more and
/// significantly (5.5σ). Empty: there is none.
[[nodiscard]] std::optional<Slip> slip_of(std::span<const Place> places);

}  // namespace alidade
