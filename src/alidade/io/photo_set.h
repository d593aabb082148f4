#pragma once

#include <filesystem>
#include <memory>
#include <mutex>
#include <span>
#include <string>
#include <vector>

#include "alidade/calibrate/calibrate_photos.h"
#include "alidade/io/photos.h"
#include "cli/run.h"

namespace alidade::cli {

/// The photos of a command line's files and folders. Reads each once; the second look comes from memory while the set
/// is small. load() is called from many threads.
class PhotoShelf {
 public:
  /// Throws InputError where one of the arguments does not exist, or is a folder without photos.
  PhotoShelf(const std::vector<std::filesystem::path>& arguments, Run& run);
  ~PhotoShelf();
  PhotoShelf(const PhotoShelf&) = delete;
  PhotoShelf& operator=(const PhotoShelf&) = delete;

  [[nodiscard]] std::size_t size() const { return found_.photos.size(); }
  /// Path of the first.
  [[nodiscard]] std::string first() const { return found_.photos.front().string(); }
  /// File names, or paths where two files have the same name.
  [[nodiscard]] std::vector<std::string> names() const;
  [[nodiscard]] cv::Mat load(std::size_t i);
  [[nodiscard]] PhotoLoader loader();

  /// Names, in the document and in a line, what lay beside the photos and was none. At the end: the rows of photos that
  /// took no part come before.
  void tell_skipped() const;
  /// Names the photos that a viewer would turn otherwise than most of them, and says that they were not turned. Added
  /// to the verdict as a check.
  void tell_turned(Verdict& verdict) const;

 private:
  struct Held;
  PhotoFiles found_;
  Run& run_;
  std::mutex mutex_;
  std::unique_ptr<Held> held_;
};

/// calibrate_photos() of a shelf. Throws InputError where none of its photos can be read.
[[nodiscard]] PhotoCalibration calibrate_shelf(PhotoShelf& shelf, const Board& board, const CalibrateConfig& config,
                                               std::span<const Eigen::Vector3d> given, Run& run);

}  // namespace alidade::cli
