#pragma once

#include <unistd.h>

#include <filesystem>
#include <string_view>
#include <utility>

namespace alidade {

/// An open file that closes itself.
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
  /// Closes it now; false where the system only then finds that not all went in (network drives).
  [[nodiscard]] bool close() { return ::close(std::exchange(number_, -1)) == 0; }

 private:
  int number_;
};

/// Throws InputError: "FILE: WHAT: No space left on device", the last by its errno.
[[noreturn]] void fail_on(const std::filesystem::path& file, const char* what, int error);

/// All of it, however often the system must be asked. Throws InputError, about `file`, where it does not go in.
void write_all(const std::filesystem::path& file, const Descriptor& out, std::string_view content);

}  // namespace alidade
