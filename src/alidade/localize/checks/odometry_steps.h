#pragma once

#include <Eigen/Core>
#include <cstddef>
#include <optional>
#include <span>
#include <vector>

// How long a vehicle's way is by its odometry, over the path's: from its steps between readings. White errors of the
// readings lengthen all distances between them, so none is measured: the steps are laid onto the path's.

namespace alidade {

/// Where the camera and the vehicle were at a time.
struct Place {
  Eigen::Vector3d of_path, of_vehicle;
  double way_m = 0.0;          ///< By the path, since the first.
  double path_variance = 0.0;  ///< Of the path's position, all three axes.
  std::size_t reading = 0;     ///< Index of its reading.
};

struct StepScale {
  double log = 0.0, sigma = 0.0;  ///< Of metres by the vehicle over the path's unit.
  std::size_t num_given = 0, num_used = 0;
};

/// Steps of the vehicle against those of the path, rotated for each fifth of the way, by least squares of their
/// covariance: white errors of the places, and errors of a random walk, both as large as what is left over shows.
/// Steps far from all others (wheels that spin) are rejected. σ is that of both errors, or as the fifths scatter.
/// None: too few, or the camera hardly moves.
[[nodiscard]] std::optional<StepScale> scale_by_steps(std::span<const Place> places);

/// A stretch of the way on which wheels slip: all its steps are longer, or shorter, by one factor.
struct Slip {
  std::size_t begin = 0, end = 0;       ///< Steps: the first is from place 0 to place 1.
  double ratio = 1.0;                   ///< Of the vehicle's way there over the path's.
  std::vector<Eigen::Vector3d> excess;  ///< Of each of these steps over the path's, in the vehicle's frame.
};
/// The stretch, of at most a quarter of the steps, whose scale differs most from that of all, by a tenth or more and
/// clearly (5.5σ). None: there is none.
[[nodiscard]] std::optional<Slip> slip_of(std::span<const Place> places);

}  // namespace alidade
