#pragma once

#include <cstdint>
#include <filesystem>
#include <map>
#include <optional>
#include <string>
#include <vector>

namespace alidade::live {

/// A folder that another program fills with photos. A file counts when it has stopped growing; hidden ones never do.
class GrowingFolder {
 public:
  /// Throws InputError where there is no such folder.
  explicit GrowingFolder(std::filesystem::path folder);

  /// Photos that have come since the last call, in natural order of their names (a2 before a10).
  [[nodiscard]] std::vector<std::filesystem::path> newcomers();
  /// A newcomer that could not be read: it may still be written, and is offered again, a few times. False: it was
  /// offered often enough, and will be only if it changes.
  bool put_back(const std::filesystem::path& file);

 private:
  struct Known {
    std::uintmax_t bytes = 0;
    std::filesystem::file_time_type changed;
    bool is_given = false;
    int num_tries = 0;
  };
  std::filesystem::path folder_;
  std::map<std::filesystem::path, Known> known_;
};

}  // namespace alidade::live
