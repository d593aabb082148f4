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

/// Photos among files and folders, and what lies beside them in the folders and is none.
struct PhotoFiles {
  std::vector<std::filesystem::path> photos;
  std::vector<SkippedInput> skipped;  ///< By name, with what to do; hidden files and our own results aside.
};

/// Photo files for arguments that are files or folders: of a folder, its images (by ending) in natural order, 2
/// before 10. Throws InputError for a path that does not exist and for a folder without images.
[[nodiscard]] PhotoFiles find_photos(const std::vector<std::filesystem::path>& arguments);
/// Whether an argument is a photo (by its ending, be it of a kind that is not read) or a folder, rather than a table.
[[nodiscard]] bool looks_like_photos(const std::filesystem::path& argument);
/// By name, as people count: a2 before a10.
void sort_naturally(std::vector<std::filesystem::path>& files);

/// The photos alone.
[[nodiscard]] std::vector<std::filesystem::path> list_photos(const std::vector<std::filesystem::path>& arguments);

/// Decodes a photo as it is: 8 or 16 bit, grey or colour; any EXIF rotation is ignored, as the lens does not rotate.
/// Throws InputError: empty, not an image, of a kind that is not read (what to do is said), cut off.
[[nodiscard]] cv::Mat decode_photo(std::string_view bytes);
/// The same, with the file's name before the fault.
[[nodiscard]] cv::Mat decode_photo(std::string_view bytes, const std::string& file);

/// JPEG bytes of a photo in 8-bit grey, at most `max_width_px` wide.
[[nodiscard]] std::string jpeg_preview(const cv::Mat& photo, int max_width_px, int quality = 80);

}  // namespace alidade
