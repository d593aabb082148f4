#pragma once

#include <filesystem>
#include <stdexcept>
#include <string>
#include <string_view>

#include "alidade/public.h"

namespace alidade {
ALIDADE_PUBLIC_BEGIN

/// Wrong input: one line, "file:line: column: what; what to do". Becomes exit code 3.
struct InputError : std::runtime_error {
  using std::runtime_error::runtime_error;
};

/// Whole content of a file. Throws InputError if it cannot be read or is larger than 1 GiB.
[[nodiscard]] std::string read_file(const std::filesystem::path& file);

/// A device, a pipe or a socket, or a link to one: it takes bytes and is not replaced.
[[nodiscard]] bool takes_bytes(const std::filesystem::path& file);
/// Where the content of a file stands: what it links to, where it is a link.
[[nodiscard]] std::filesystem::path place_of(const std::filesystem::path& file);

/// Writes a file whole: temporary file in the same folder, then rename; makes missing folders. Nothing half-written
/// ever stands under `file`. A link stays, what it points to is replaced; devices and pipes are written to. Throws
/// InputError if it cannot be written.
void write_file(const std::filesystem::path& file, std::string_view content);

ALIDADE_PUBLIC_END
}  // namespace alidade
