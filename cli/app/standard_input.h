#pragma once

#include <istream>
#include <memory>

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

}  // namespace alidade::cli
