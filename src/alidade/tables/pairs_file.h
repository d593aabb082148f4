#pragma once

#include <filesystem>
#include <string>
#include <vector>

#include "alidade/estimation/counts.h"
#include "alidade/matching/matched_photos.h"

namespace alidade {

/// The photos have no size: it is not in the file.
struct PairsFile {
  MatchedPhotos photos;
  std::vector<SkippedInput> skipped;
};

/// Reads points matched between images: frame_a, frame_b, ua_px, va_px, ub_px, vb_px (or image_a, image_b, ua, va,
/// ub, vb), the frames in order of first appearance. Matches that share the very same pixel of a frame share a feature.
/// A match that stands twice is left out and listed. Throws InputError; wrong rows are listed instead with `skip_bad`.
[[nodiscard]] PairsFile read_pairs(const std::filesystem::path& file, bool skip_bad = false);

/// The same matches as such a file.
[[nodiscard]] std::string pairs_csv(const MatchedPhotos& photos);

}  // namespace alidade
