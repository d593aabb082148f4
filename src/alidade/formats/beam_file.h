#pragma once

#include <filesystem>
#include <string>

#include "alidade/beam/beam.h"
#include "alidade/public.h"

namespace alidade {
ALIDADE_PUBLIC_BEGIN

/// The content of rangefinder.yaml.
struct BeamFile {
  Beam beam;
  /// The camera's file, relative to the beam's file; empty: not given.
  std::filesystem::path camera;
};

/// Text of rangefinder.yaml: origin_m, direction, theta_x_rad, theta_y_rad, scale, sigma_range_m (and its growth),
/// covariance of origin, direction and scale, and with the lens if it is known. `camera_file` is written as given.
[[nodiscard]] std::string beam_text(const Beam& beam, const Camera& camera, const std::string& camera_file);

/// Reads rangefinder.yaml. `file.camera` is made relative to the reader's folder. Throws InputError for a missing or
/// unknown key, a value that is not a number, a direction that is not a unit vector, or an invalid covariance.
[[nodiscard]] BeamFile read_beam(const std::filesystem::path& file);

ALIDADE_PUBLIC_END
}  // namespace alidade
