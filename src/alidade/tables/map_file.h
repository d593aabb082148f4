#pragma once

#include <filesystem>
#include <string>

#include "alidade/localize/saved_map.h"
#include "alidade/public.h"

namespace alidade {
ALIDADE_PUBLIC_BEGIN

/// Text of map.yaml: `in_metres`; `frame: {centre, covariance}` (errors that all points share: translation, rotation,
/// size; upper triangle); `points: [{id, position, covariance, look}]` (upper triangle; `look`, for maps of images, is
/// a 25 × 25 patch as hexadecimal bytes, with the pose from which it was seen); and `keyframes: [{position,
/// quaternion_wxyz, grey}]`.
[[nodiscard]] std::string map_text(const SavedMap& map);
/// Reads map.yaml. Throws InputError.
[[nodiscard]] SavedMap read_map(const std::filesystem::path& file);

ALIDADE_PUBLIC_END
}  // namespace alidade
