#pragma once

#include <filesystem>
#include <stdexcept>
#include <string>
#include <string_view>

#include "alidade/public.h"

namespace alidade {
ALIDADE_PUBLIC_BEGIN

/// Invalid input: one line, "file:line: column: what; what to do". It leads to exit code 3.
struct InputError : std::runtime_error {
  using std::runtime_error::runtime_error;
};

/// Returns the whole content of a file. Throws InputError if it cannot be read or is larger than 1 GiB.
[[nodiscard]] std::string read_file(const std::filesystem::path& file);

/// Whether the file is a device, a pipe or a socket, or a link to one: bytes are written to it, it is not replaced.
[[nodiscard]] bool takes_bytes(const std::filesystem::path& file);
/// The path at which the file's content is stored: the target of a link, else the file itself.
[[nodiscard]] std::filesystem::path place_of(const std::filesystem::path& file);

/// Writes a whole file: to a temporary file in the same folder, which is then renamed; creates missing folders. There
/// is never a partly written file at `file`. A link is kept and its target replaced; devices and pipes are written to.
/// Throws InputError if the file cannot be written.
void write_file(const std::filesystem::path& file, std::string_view content);

ALIDADE_PUBLIC_END
}  // namespace alidade
