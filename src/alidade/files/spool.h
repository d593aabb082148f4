#pragma once

#include <cstdint>
#include <filesystem>
#include <string>
#include <string_view>

namespace alidade {

/// Bytes stored on disk until they are needed, in a file without a name: nothing of it remains, however the program
/// ends.
class Spool {
 public:
  /// Position and size of an item.
  struct Place {
    std::uint64_t at = 0, size = 0;
  };

  /// Uses the disk of `folder`, or of its nearest existing parent. Throws InputError if that cannot be written to.
  explicit Spool(std::filesystem::path folder);
  Spool(const Spool&) = delete;
  Spool& operator=(const Spool&) = delete;
  ~Spool();

  /// Appends bytes. Throws InputError if the disk is full.
  [[nodiscard]] Place put(std::string_view bytes);
  [[nodiscard]] std::string get(Place place) const;

 private:
  [[noreturn]] void fail(const char* what) const;

  std::filesystem::path folder_;
  int descriptor_ = -1;
  std::uint64_t end_ = 0;
};

}  // namespace alidade
