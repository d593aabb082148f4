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

/// The photos of files and folders. Each is read once; the second look comes from memory while the set is small. They
/// may be loaded from many threads; copies share what was read.
class PhotoSet {
 public:
  /// Throws InputError where one of the paths does not exist, or is a folder without photos.
  explicit PhotoSet(const std::vector<std::filesystem::path>& paths);

  /// As input of a job: by file name, or by path where two files have the same name.
  [[nodiscard]] Photos photos() const;
  [[nodiscard]] std::size_t size() const;
  /// Those that were read, in their order: name, size, checksum.
  [[nodiscard]] std::vector<InputFile> inputs() const;
  /// Files beside the photos that are no photos.
  [[nodiscard]] const std::vector<SkippedInput>& skipped() const;
  /// The same in a line for a user; "" for none.
  [[nodiscard]] std::string skipped_line() const;
  /// Names the photos that a viewer would rotate differently from most of them, and says that they were not rotated.
  /// None where all stand alike.
  [[nodiscard]] std::optional<Check> turned() const;
  /// Throws InputError, about the first, where none of them could be read; `reason`: why that one.
  void require_readable(std::size_t num_unreadable, const std::string& reason) const;

 private:
  struct Held;
  std::shared_ptr<Held> state_;
};

/// The photos of a file or a folder: `calibrate(photos_in("photos"), board)`. Throws as PhotoSet does.
[[nodiscard]] Photos photos_in(const std::filesystem::path& path);

ALIDADE_PUBLIC_END
}  // namespace alidade
