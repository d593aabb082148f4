#pragma once

#include <filesystem>
#include <vector>

#include "alidade/files/descriptor.h"

namespace alidade {

/// Flushes a file to the disk, so that a power cut loses nothing of it. Throws InputError about `file` if the disk
/// fails. File systems without such a guarantee are accepted.
void sync_file(const std::filesystem::path& file, const Descriptor& open);

/// The same for files and folders (their lists of names), several at a time, so that the disk writes them together.
void sync_all(const std::vector<std::filesystem::path>& paths);

}  // namespace alidade
