#include "alidade/localize/distortion.h"

namespace alidade {
std::optional<Camera> with_distortion(const Camera& camera, DistortionVariant variant) {
  if (variant == DistortionVariant::full || std::holds_alternative<Calibrated<Pinhole>>(camera.lens)) return camera;
  Camera result = camera;
  auto* const lens = std::get_if<Calibrated<Brown>>(&result.lens);
  if (!lens) return std::nullopt;
  lens->params.tail(variant == DistortionVariant::none ? 5 : 4).setZero();  // k1 k2 p1 p2 k3 come last
  return result;
}

const WordList<DistortionVariant>& distortion_words() {
  static const WordList<DistortionVariant> words = {
      {DistortionVariant::none, "none"}, {DistortionVariant::radial1, "radial1"}, {DistortionVariant::full, "full"}};
  return words;
}

}  // namespace alidade
