#pragma once

#include <filesystem>
#include <vector>

#include "alidade/files/descriptor.h"

namespace alidade {

/// On the disk when this returns: a power cut loses nothing of it. Throws InputError, about `file`, where the disk
/// fails. A file system that knows no such promise is left to itself.
void sync_file(const std::filesystem::path& file, const Descriptor& open);

/// The same for files and folders (their lists of names), several at a time: the disk takes what waits for it together.
void sync_all(const std::vector<std::filesystem::path>& paths);

}  // namespace alidade
