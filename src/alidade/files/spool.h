#pragma once

#include <cstdint>
#include <filesystem>
#include <string>
#include <string_view>

namespace alidade {

/// Bytes put aside on disk until they are wanted, in a file without a name: however the program ends, nothing of it
/// stays.
class Spool {
 public:
  /// Where something is in it.
  struct Place {
    std::uint64_t at = 0, size = 0;
  };

  /// On the disk of `folder`, or of the nearest one above it that exists. Throws InputError if that cannot be written.
  explicit Spool(std::filesystem::path folder);
  Spool(const Spool&) = delete;
  Spool& operator=(const Spool&) = delete;
  ~Spool();

  /// Throws InputError if the disk is full.
  [[nodiscard]] Place put(std::string_view bytes);
  [[nodiscard]] std::string get(Place place) const;

 private:
  [[noreturn]] void fail(const char* what) const;

  std::filesystem::path folder_;
  int descriptor_ = -1;
  std::uint64_t end_ = 0;
};

}  // namespace alidade
