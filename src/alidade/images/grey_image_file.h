#pragma once

#include <filesystem>
#include <string>
#include <string_view>

#include "alidade/imaging/grey_image.h"
#include "alidade/public.h"

namespace alidade {
ALIDADE_PUBLIC_BEGIN

/// Grey values of a photo, 0 to 255. Its size must be that of the camera. Throws InputError if the photo cannot be read
/// or has another size.
[[nodiscard]] GreyImage read_grey_image(const std::filesystem::path& file, int width_px, int height_px);
/// The same for the bytes of a file; `file` is its name in messages.
[[nodiscard]] GreyImage grey_image(std::string_view bytes, const std::string& file, int width_px, int height_px);

ALIDADE_PUBLIC_END
}  // namespace alidade
