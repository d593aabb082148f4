#include "alidade/localize/distortion.h"

#include <array>
#include <utility>

namespace alidade {
namespace {

constexpr std::array<std::pair<DistortionVariant, std::string_view>, 3> names{
    {{DistortionVariant::none, "none"}, {DistortionVariant::radial1, "radial1"}, {DistortionVariant::full, "full"}}};

}  // namespace

std::optional<Camera> with_distortion(const Camera& camera, DistortionVariant variant) {
  if (variant == DistortionVariant::full || std::holds_alternative<Calibrated<Pinhole>>(camera.lens)) return camera;
  Camera result = camera;
  auto* const lens = std::get_if<Calibrated<Brown>>(&result.lens);
  if (!lens) return std::nullopt;
  lens->params.tail(variant == DistortionVariant::none ? 5 : 4).setZero();  // k1 k2 p1 p2 k3 come last
  return result;
}

std::string_view variant_name(DistortionVariant variant) {
  for (const auto& [value, name] : names)
    if (value == variant) return name;
  return "";
}

std::optional<DistortionVariant> distortion_variant(std::string_view name) {
  for (const auto& [value, known] : names)
    if (known == name) return value;
  return std::nullopt;
}

}  // namespace alidade
