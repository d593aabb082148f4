#pragma once

#include <filesystem>
#include <string>
#include <vector>

#include "alidade/estimation/counts.h"
#include "alidade/matching/matched_photos.h"
#include "alidade/public.h"

namespace alidade {
ALIDADE_PUBLIC_BEGIN

/// The photos have no size: it is not in the file.
struct PairsFile {
  MatchedPhotos photos;
  std::vector<SkippedInput> skipped;
};

/// Reads points matched between images: frame_a, frame_b, ua_px, va_px, ub_px, vb_px (or image_a, image_b, ua, va,
/// ub, vb), the frames in order of first appearance. Matches that share the very same pixel of a frame share a feature.
/// A duplicate match is rejected and listed. Throws InputError; wrong rows are listed instead with `skip_bad`.
[[nodiscard]] PairsFile read_pairs(const std::filesystem::path& file, bool skip_bad = false);

/// Throws InputError about `file` where more than one point in twenty lies outside the images of the photos' size: they
/// are of other images. A few may be wrong. Without a size nothing is asked.
void require_features_inside(const MatchedPhotos& photos, const std::filesystem::path& file);

/// The same matches as such a file.
[[nodiscard]] std::string pairs_csv(const MatchedPhotos& photos);

ALIDADE_PUBLIC_END
}  // namespace alidade
