#pragma once

#include <unistd.h>

#include <filesystem>
#include <string_view>
#include <utility>

namespace alidade {

/// An open file descriptor that is closed on destruction.
class Descriptor {
 public:
  explicit Descriptor(int number) : number_(number) {}
  Descriptor(Descriptor&& other) noexcept : number_(std::exchange(other.number_, -1)) {}
  Descriptor& operator=(Descriptor&&) = delete;
  ~Descriptor() {
    if (number_ >= 0) ::close(number_);
  }
  [[nodiscard]] int number() const { return number_; }
  [[nodiscard]] bool is_open() const { return number_ >= 0; }
  /// Closes it now; false if the system only then reports that not everything was written (network drives).
  [[nodiscard]] bool close() { return ::close(std::exchange(number_, -1)) == 0; }

 private:
  int number_;
};

/// Throws InputError: "FILE: WHAT: No space left on device", where the last part follows from errno.
[[noreturn]] void fail_on(const std::filesystem::path& file, const char* what, int error);

/// Writes all of `content`, in as many calls as needed. Throws InputError about `file` if it cannot be written.
void write_all(const std::filesystem::path& file, const Descriptor& out, std::string_view content);

}  // namespace alidade
