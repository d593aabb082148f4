#pragma once

#include <optional>
#include <span>

#include "alidade/localize/config.h"
#include "alidade/localize/localization.h"

namespace alidade {

/// Another kind of lens than the given one, which explains the observations far better.
struct OtherLensKind {
  Camera camera;                                     ///< As they ask for it, roughly.
  double explained = 0.0, explained_by_given = 0.0;  ///< Share of them within the gate; at best by the given kind.
  double rms_px = 0.0, rms_by_given_px = 0.0;        ///< Of these, per point.
};

/// Where what `result.verdict` is not content with may be due to the lens, the path is solved again from at most 300
/// frames of the target and some twenty other points at a time for each kind of lens, which is estimated; not where the
/// path is of all that was seen and leaves residuals that do not depend on the position in the image, nor where a fifth
/// of the observations are mismatches, so that no kind explains enough. `frames`: as seen, or as matched in images;
/// `target`: by the numbers there.
[[nodiscard]] std::optional<OtherLensKind> other_lens_kind(std::span<const ObservationFrame> frames,
                                                           std::span<const KnownPoint> target,
                                                           const LocalizeConfig& config, const Localization& result);

/// The verdict says so: a path by the wrong kind of lens is not to be trusted.
void add_lens_kind(const OtherLensKind& other, Localization& result);

}  // namespace alidade
