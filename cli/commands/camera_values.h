#pragma once

#include <filesystem>
#include <string>
#include <vector>

#include "alidade/camera/camera.h"
#include "alidade/formats/camera_json.h"
#include "alidade/pantilt/rig.h"
#include "cli/app/run.h"

namespace alidade::cli {

/// Records a camera file among the inputs of the run, FILE:NAME too, and that its lens is in doubt where it is.
void add_camera_input(Run& run, const std::filesystem::path& file);
/// The same of rig.yaml, which read_rig() has read, and of the camera files that it names.
void add_rig_input(Run& run, const std::filesystem::path& file);
/// For an answer that does not heed a rig's doubts itself.
void add_rig_doubts(Run& run, const Rig& rig);
/// Reads a camera file and records it among the inputs of the run. "FILE:NAME" chooses one of several.
[[nodiscard]] Camera read_camera_input(Run& run, const std::filesystem::path& file);

/// "fx 532.8 ± 1.3 px" each, ± 3σ where σ is known.
[[nodiscard]] std::vector<std::string> camera_lines(const Camera& camera);

}  // namespace alidade::cli
