#pragma once

#include <filesystem>
#include <string>
#include <string_view>

#include "alidade/camera/camera.h"
#include "alidade/io/files.h"

namespace alidade {

enum class CameraFormat { alidade, opencv, ros, kalibr, mrcal, colmap };

/// Reads a camera file of any known format, recognised by its content. Throws InputError.
[[nodiscard]] Camera read_camera(const std::filesystem::path& file);

/// A camera as text of a format. Throws InputError saying what would be lost, unless `lossy`.
[[nodiscard]] std::string camera_text(const Camera& camera, CameraFormat format, bool lossy = false);

/// The format of a name (`opencv`, `ros`, …). Throws InputError for an unknown one.
[[nodiscard]] CameraFormat camera_format(std::string_view name);

}  // namespace alidade
