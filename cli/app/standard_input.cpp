#include "cli/app/standard_input.h"

#include <poll.h>
#include <unistd.h>

#include <array>
#include <cerrno>

#include "cli/app/terminal.h"

namespace alidade::cli {

class StandardInput::Buffer : public std::streambuf {
 protected:
  int_type underflow() override {
    constexpr int look_ms = 100;  // for Ctrl-C
    pollfd input{STDIN_FILENO, POLLIN, 0};
    while (interrupting_signal() == 0) {
      if (::poll(&input, 1, look_ms) == 0) continue;
      const ssize_t count = ::read(STDIN_FILENO, bytes_.data(), bytes_.size());
      if (count < 0 && errno == EINTR) continue;
      if (count <= 0) break;
      setg(bytes_.data(), bytes_.data(), bytes_.data() + count);
      return traits_type::to_int_type(bytes_.front());
    }
    return traits_type::eof();
  }

 private:
  std::array<char, 64 * 1024> bytes_{};
};

StandardInput::StandardInput() : std::istream(nullptr), buffer_(std::make_unique<Buffer>()) { rdbuf(buffer_.get()); }
StandardInput::~StandardInput() = default;

}  // namespace alidade::cli
