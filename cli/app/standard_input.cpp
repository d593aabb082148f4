#include "cli/app/standard_input.h"

#include <fcntl.h>
#include <poll.h>
#include <sys/mman.h>
#include <sys/stat.h>
#include <unistd.h>

#include <array>
#include <cerrno>
#include <charconv>
#include <optional>
#include <string>

#include "alidade/estimation/progress.h"
#include "alidade/files/descriptor.h"
#include "alidade/files/files.h"
#include "cli/app/terminal.h"

namespace alidade::cli {
namespace {

using Chunk = std::array<char, 64 * 1024>;

/// How many bytes have come; 0 at the end, after an error, and after Ctrl-C.
std::size_t read_some(int number, Chunk& bytes) {
  constexpr int look_ms = 100;  // for Ctrl-C
  pollfd input{number, POLLIN, 0};
  while (interrupting_signal() == 0) {
    if (::poll(&input, 1, look_ms) == 0) continue;
    const ssize_t count = ::read(number, bytes.data(), bytes.size());
    if (count < 0 && errno == EINTR) continue;
    return count > 0 ? static_cast<std::size_t>(count) : 0;
  }
  return 0;
}

/// The descriptor that a name stands for, where something is to be read from a pipe.
std::optional<int> pipe_of(std::string_view name) {
  if (name.starts_with('-') && name.find('=') != std::string_view::npos) name.remove_prefix(name.find('=') + 1);
  int number = name == "/dev/stdin" ? STDIN_FILENO : -1;
  for (const std::string_view folder : {"/dev/fd/", "/proc/self/fd/"}) {
    if (!name.starts_with(folder)) continue;
    const std::string_view digits = name.substr(folder.size());
    const auto [end, error] = std::from_chars(digits.data(), digits.data() + digits.size(), number);
    if (error != std::errc() || end != digits.data() + digits.size()) return std::nullopt;
  }
  struct stat status {};
  if (number < 0 || ::fstat(number, &status) != 0 || !S_ISFIFO(status.st_mode)) return std::nullopt;
  const bool is_read = (::fcntl(number, F_GETFL) & O_ACCMODE) != O_WRONLY;
  return is_read ? std::optional(number) : std::nullopt;
}

}  // namespace

class StandardInput::Buffer : public std::streambuf {
 protected:
  int_type underflow() override {
    const std::size_t count = read_some(STDIN_FILENO, bytes_);
    if (count == 0) return traits_type::eof();
    setg(bytes_.data(), bytes_.data(), bytes_.data() + count);
    return traits_type::to_int_type(bytes_.front());
  }

 private:
  Chunk bytes_{};
};

StandardInput::StandardInput() : std::istream(nullptr), buffer_(std::make_unique<Buffer>()) { rdbuf(buffer_.get()); }
StandardInput::~StandardInput() = default;

void keep_piped_files(const std::vector<std::string_view>& words) {
  constexpr std::size_t max_bytes = std::size_t{1} << 30U;  // as of any file that is read
  Chunk bytes{};
  for (const std::string_view word : words) {
    const std::optional<int> pipe = pipe_of(word);
    if (!pipe) continue;
    const Descriptor kept(::memfd_create("piped", MFD_CLOEXEC));
    if (!kept.is_open()) fail_on(std::string(word), "cannot be kept", errno);
    std::size_t total = 0;
    while (const std::size_t count = read_some(*pipe, bytes)) {
      write_all(std::string(word), kept, {bytes.data(), count});
      if ((total += count) > max_bytes)
        throw InputError(std::string(word) + ": comes by a pipe and is larger than 1 GiB");
    }
    if (interrupting_signal() != 0) throw Interrupted();
    if (::dup2(kept.number(), *pipe) < 0) fail_on(std::string(word), "cannot be kept", errno);
  }
}

}  // namespace alidade::cli
