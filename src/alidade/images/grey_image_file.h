#pragma once

#include <filesystem>
#include <string>
#include <string_view>

#include "alidade/imaging/grey_image.h"
#include "alidade/public.h"

namespace alidade {
ALIDADE_PUBLIC_BEGIN

/// Grey values of a photo, 0 to 255, whose size must be that of the camera. Throws InputError where it cannot be read,
/// or its size is another.
[[nodiscard]] GreyImage read_grey_image(const std::filesystem::path& file, int width_px, int height_px);
/// The same of the bytes of the file of that name.
[[nodiscard]] GreyImage grey_image(std::string_view bytes, const std::string& file, int width_px, int height_px);

ALIDADE_PUBLIC_END
}  // namespace alidade
