#pragma once

#include <filesystem>
#include <string>
#include <string_view>
#include <vector>

#include "alidade/estimation/counts.h"
#include "alidade/files/files.h"

namespace cv {
class Mat;
}

namespace alidade {

/// Photos from files and folders, and the other files in the folders.
struct PhotoFiles {
  std::vector<std::filesystem::path> photos;
  std::vector<SkippedInput> skipped;  ///< By name, with advice; without hidden files and alidade's own results.
};

/// Photo files for arguments that are files or folders: for a folder, its images (by ending) in natural order, 2 before
/// 10. Throws InputError for a path that does not exist, and for a folder without images.
[[nodiscard]] PhotoFiles find_photos(const std::vector<std::filesystem::path>& arguments);
/// Whether an argument is a photo (by its ending, even of a kind that is not read) or a folder, not a table.
[[nodiscard]] bool looks_like_photos(const std::filesystem::path& argument);
/// Sorts by name in natural order: a2 before a10.
void sort_naturally(std::vector<std::filesystem::path>& files);

/// The same without the other files.
[[nodiscard]] std::vector<std::filesystem::path> list_photos(const std::vector<std::filesystem::path>& arguments);

/// Decodes a photo as stored: 8 or 16 bit, grey or colour; any EXIF rotation is ignored, as the lens does not rotate.
/// Throws InputError for an empty file, not an image, a kind that is not read (with advice), or a truncated file.
[[nodiscard]] cv::Mat decode_photo(std::string_view bytes);
/// The same, with the file's name before the message.
[[nodiscard]] cv::Mat decode_photo(std::string_view bytes, const std::string& file);

/// JPEG bytes of a photo in 8-bit grey, at most `max_width_px` wide.
[[nodiscard]] std::string jpeg_preview(const cv::Mat& photo, int max_width_px, int quality = 80);

}  // namespace alidade
