#pragma once

#include <filesystem>
#include <memory>
#include <optional>
#include <string>
#include <vector>

#include "alidade/estimation/counts.h"
#include "alidade/estimation/verdict.h"
#include "alidade/imaging/photos.h"
#include "alidade/public.h"

namespace alidade {
ALIDADE_PUBLIC_BEGIN

/// The photos of files and folders. Each is read once; while the set is small, later loads come from memory. Photos may
/// be loaded from many threads; copies share what was read.
class PhotoSet {
 public:
  /// Throws InputError if one of the paths does not exist, or is a folder without photos.
  explicit PhotoSet(const std::vector<std::filesystem::path>& paths);

  /// The input of a job: photos by file name, or by path if two files have the same name.
  [[nodiscard]] Photos photos() const;
  [[nodiscard]] std::size_t size() const;
  /// The photos that were read, in order: name, size, checksum.
  [[nodiscard]] std::vector<InputFile> inputs() const;
  /// Files beside the photos that are not photos.
  [[nodiscard]] const std::vector<SkippedInput>& skipped() const;
  /// The skipped files in one line for the user; "" if there are none.
  [[nodiscard]] std::string skipped_line() const;
  /// Lists photos whose EXIF orientation differs from that of most, or states one that all share if it is not upright;
  /// pixels are used as stored. None if all are upright.
  [[nodiscard]] std::optional<Check> turned() const;
  /// Throws InputError about the first photo if no photo could be read; `reason` says why that one could not.
  void require_readable(std::size_t num_unreadable, const std::string& reason) const;

 private:
  struct Held;
  std::shared_ptr<Held> state_;
};

/// The photos of a file or a folder: `calibrate(photos_in("photos"), board)`. Throws as PhotoSet does.
[[nodiscard]] Photos photos_in(const std::filesystem::path& path);

ALIDADE_PUBLIC_END
}  // namespace alidade
