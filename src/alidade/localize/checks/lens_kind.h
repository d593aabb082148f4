#pragma once

#include <optional>
#include <span>

#include "alidade/localize/config.h"
#include "alidade/localize/localization.h"

namespace alidade {

/// A lens of another kind than the given one that explains the observations far better.
struct OtherLensKind {
  Camera camera;                                     ///< A rough estimate.
  double explained = 0.0, explained_by_given = 0.0;  ///< Share within the gate; for the given kind the best.
  double rms_px = 0.0, rms_by_given_px = 0.0;        ///< RMS of these, per point.
};

/// If the deficiencies in `result.verdict` may be due to the lens, solves the path again for each kind of lens, with
/// the lens estimated, from at most 300 frames, the target and some twenty other points at a time. Skipped if the path
/// uses all that was seen and its residuals do not depend on the position in the image, or if a fifth of the
/// observations are mismatches, so that no kind explains enough. `frames`: as observed, or as matched in images;
/// `target`: with the ids used there.
[[nodiscard]] std::optional<OtherLensKind> other_lens_kind(std::span<const ObservationFrame> frames,
                                                           std::span<const KnownPoint> target,
                                                           const LocalizeConfig& config, const Localization& result);

/// Adds it to the verdict: a path with the wrong kind of lens is not to be trusted.
void add_lens_kind(const OtherLensKind& other, Localization& result);

}  // namespace alidade
