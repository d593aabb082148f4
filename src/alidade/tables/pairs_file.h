#pragma once

#include <filesystem>
#include <string>
#include <vector>

#include "alidade/estimation/counts.h"
#include "alidade/matching/matched_photos.h"
#include "alidade/public.h"

namespace alidade {
ALIDADE_PUBLIC_BEGIN

/// The image size of the photos is not set, because the file does not contain it.
struct PairsFile {
  MatchedPhotos photos;
  std::vector<SkippedInput> skipped;
};

/// Reads points matched between images: frame_a, frame_b, ua_px, va_px, ub_px, vb_px (or image_a, image_b, ua, va, ub,
/// vb); frames are in order of first appearance. Matches with exactly the same pixel in a frame share a feature. A
/// duplicate match is rejected and listed. Throws InputError for wrong rows; with `skip_bad` these are listed instead.
[[nodiscard]] PairsFile read_pairs(const std::filesystem::path& file, bool skip_bad = false);

/// Throws InputError about `file` if more than one point in twenty lies outside the photos' image size, because the
/// file then belongs to other images; a few may be wrong. Without a size nothing is checked.
void require_features_inside(const MatchedPhotos& photos, const std::filesystem::path& file);

/// Text of such a file with these matches.
[[nodiscard]] std::string pairs_csv(const MatchedPhotos& photos);

ALIDADE_PUBLIC_END
}  // namespace alidade
