#pragma once

#include <optional>

#include "alidade/camera/camera.h"
#include "alidade/description/field.h"
#include "alidade/public.h"

namespace alidade {
ALIDADE_PUBLIC_BEGIN

/// How much of a Brown lens's distortion a filter is given: none (a pinhole), k1 alone ("first order"), or all. The
/// three variants of Xu & Xu, "Underwater monocular localization with lens distortion".
enum class DistortionVariant { none, radial1, full };

/// The camera with that much distortion. None where the lens is no Brown lens and something would have to be dropped.
[[nodiscard]] std::optional<Camera> with_distortion(const Camera& camera, DistortionVariant variant);

/// Their words: none, radial1, full.
[[nodiscard]] const WordList<DistortionVariant>& distortion_words();

ALIDADE_PUBLIC_END
}  // namespace alidade
