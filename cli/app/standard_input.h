#pragma once

#include <istream>
#include <memory>
#include <string_view>
#include <vector>

namespace alidade::cli {

/// Standard input that Ctrl-C ends, also while it waits: a program that sends rows may be silent for hours.
class StandardInput : public std::istream {
 public:
  StandardInput();
  ~StandardInput() override;

 private:
  class Buffer;
  std::unique_ptr<Buffer> buffer_;
};

/// Files among the words of a command line that come by a pipe, as <(…) of a shell names them (/dev/fd/63), and
/// /dev/stdin: kept in memory under the same name, since inputs are read more than once. Throws Interrupted, and
/// InputError beyond 1 GiB.
void keep_piped_files(const std::vector<std::string_view>& words);

}  // namespace alidade::cli
