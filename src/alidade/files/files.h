#pragma once

#include <filesystem>
#include <stdexcept>
#include <string>
#include <string_view>

#include "alidade/public.h"

namespace alidade {
ALIDADE_PUBLIC_BEGIN

/// Invalid input: one line, "file:line: column: what; what to do". Leads to exit code 3.
struct InputError : std::runtime_error {
  using std::runtime_error::runtime_error;
};

/// Entire content of a file. Throws InputError if it cannot be read or is larger than 1 GiB.
[[nodiscard]] std::string read_file(const std::filesystem::path& file);

/// Whether it is a device, a pipe or a socket, or a link to one: such a file is written to, not replaced.
[[nodiscard]] bool takes_bytes(const std::filesystem::path& file);
/// Path of the file that holds the content: the target of a link, otherwise the file itself.
[[nodiscard]] std::filesystem::path place_of(const std::filesystem::path& file);

/// Writes a file atomically: to a temporary file in the same folder, then renamed; creates missing folders. A partly
/// written file never exists under that name. A link is kept and its target replaced; devices and pipes are written to.
/// Throws InputError if it cannot be written.
void write_file(const std::filesystem::path& file, std::string_view content);

ALIDADE_PUBLIC_END
}  // namespace alidade
