#pragma once

#include <optional>

#include "alidade/camera/camera.h"
#include "alidade/description/field.h"
#include "alidade/public.h"

namespace alidade {
ALIDADE_PUBLIC_BEGIN

/// Which part of a Brown lens's distortion a filter models: none (a pinhole), k1 only ("first order"), or all. These
/// are the three variants of Xu & Xu, "Underwater monocular localization with lens distortion".
enum class DistortionVariant { none, radial1, full };

/// The camera with that part of its distortion. None if the lens is not a Brown lens and a term would be dropped.
[[nodiscard]] std::optional<Camera> with_distortion(const Camera& camera, DistortionVariant variant);

/// The words for the variants: none, radial1, full.
[[nodiscard]] const WordList<DistortionVariant>& distortion_words();

ALIDADE_PUBLIC_END
}  // namespace alidade
