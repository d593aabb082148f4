#pragma once

#include <filesystem>

#include "alidade/io/rotation_log_file.h"

namespace alidade {

/// Reads points matched between pictures: frame_a, frame_b, ua_px, va_px, ub_px, vb_px (or image_a, image_b, ua, va,
/// ub, vb), as a log without rotation: a row a frame in order of first appearance, its time its number. Matches that
/// share the very same pixel of a frame are one point, as long as it is then seen at one place in every frame; a match
/// that contradicts stands as a point of two frames by itself. A match that stands twice is left out and listed.
/// Throws InputError; wrong rows are listed instead with `skip_bad`.
[[nodiscard]] RotationLogFile read_pairs(const std::filesystem::path& file, const RotationLogOptions& options = {});

}  // namespace alidade
