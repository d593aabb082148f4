#pragma once

#include <filesystem>
#include <string_view>

namespace alidade::fuzz {

/// A file in memory, with a path: most readers take one.
class MemoryFile {
 public:
  explicit MemoryFile(std::string_view bytes);
  ~MemoryFile();
  MemoryFile(const MemoryFile&) = delete;
  MemoryFile& operator=(const MemoryFile&) = delete;

  [[nodiscard]] std::filesystem::path path() const;

 private:
  int descriptor_ = -1;
};

}  // namespace alidade::fuzz
