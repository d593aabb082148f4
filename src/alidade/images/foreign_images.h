#pragma once

#include <filesystem>
#include <set>
#include <string>
#include <string_view>

namespace alidade {

/// Advice about a file of a kind that is not read (HEIC, AVIF, raw files, GIF, PDF, a video, a table), recognised by
/// its bytes: "is HEIC, which is not read: convert it to JPEG or PNG without turning it". Empty for all others.
[[nodiscard]] std::string foreign_image(std::string_view bytes);

/// Whether a file name's ending is of such a kind.
[[nodiscard]] bool is_foreign_ending(const std::filesystem::path& file);

/// The ending of a file name in lower case, ".jpg".
[[nodiscard]] std::string lower_ending(const std::filesystem::path& file);

/// Why a file in a folder of photos, or a folder in it, is not read as a photo, by its extension. Empty if nothing need
/// be said, as for a folder of results.
[[nodiscard]] std::string why_no_photo(const std::filesystem::path& file);

/// Names of the files in a folder that an earlier run of alidade left there.
[[nodiscard]] std::set<std::string> our_results(const std::filesystem::path& folder);

}  // namespace alidade
