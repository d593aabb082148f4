#pragma once

#include <filesystem>
#include <string>

#include "alidade/beam/beam.h"
#include "alidade/public.h"

namespace alidade {
ALIDADE_PUBLIC_BEGIN

/// What rangefinder.yaml holds.
struct BeamFile {
  Beam beam;
  /// The camera that it belongs to: a file, relative to the beam's; empty: not given.
  std::filesystem::path camera;
};

/// Text of rangefinder.yaml: origin_m, direction, theta_x_rad, theta_y_rad, scale, sigma_range_m (and what it grows
/// by), covariance of origin, direction and scale, and with the lens where it is known. `camera` is written as given.
[[nodiscard]] std::string beam_text(const Beam& beam, const Camera& camera, const std::string& camera_file);

/// Reads it. `file.camera` is made relative to the reader's folder. Throws InputError: a key that is missing,
/// unknown or no number, a direction that is no unit vector, something that is no covariance.
[[nodiscard]] BeamFile read_beam(const std::filesystem::path& file);

ALIDADE_PUBLIC_END
}  // namespace alidade
