#pragma once

#include <optional>
#include <string_view>

#include "alidade/camera/camera.h"

namespace alidade {

/// How much of a Brown lens's distortion a filter is given: none (a pinhole), k1 alone ("first order"), or all. The
/// three variants of Xu & Xu, "Underwater monocular localization with lens distortion".
enum class DistortionVariant { none, radial1, full };

/// The camera with that much distortion. None where the lens is no Brown lens and something would have to be left out.
[[nodiscard]] std::optional<Camera> with_distortion(const Camera& camera, DistortionVariant variant);

[[nodiscard]] std::string_view variant_name(DistortionVariant variant);
/// None for an unknown name.
[[nodiscard]] std::optional<DistortionVariant> distortion_variant(std::string_view name);

}  // namespace alidade
