#pragma once

#include <filesystem>
#include <string>
#include <vector>

#include "alidade/camera/camera.h"
#include "alidade/io/json_value.h"
#include "cli/run.h"

namespace alidade::cli {

/// Reads a camera file and records it among the inputs of the run. "FILE:NAME" chooses one of several.
[[nodiscard]] Camera read_camera_input(Run& run, const std::string& role, const std::filesystem::path& file);

/// The `camera` of `estimate`: {model, width, height, fx, …}.
[[nodiscard]] JsonValue camera_values(const Camera& camera);
/// The same names with their σ; an empty object without a covariance.
[[nodiscard]] JsonValue camera_stddev(const Camera& camera);

/// "fx 532.8 ± 1.3 px" each, ± 3σ where σ is known.
[[nodiscard]] std::vector<std::string> camera_lines(const Camera& camera);

/// True where the camera has a covariance of all its parameters.
[[nodiscard]] bool has_covariance(const Camera& camera);

}  // namespace alidade::cli
