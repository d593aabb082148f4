#include "alidade/live/capture/growing_folder.h"

#include <algorithm>

#include "alidade/files/files.h"
#include "alidade/images/photos.h"

namespace alidade::live {

GrowingFolder::GrowingFolder(std::filesystem::path folder) : folder_(std::move(folder)) {
  std::error_code ignored;
  if (std::filesystem::is_directory(folder_, ignored)) return;
  const bool is_file = std::filesystem::exists(folder_, ignored);
  throw InputError(folder_.string() + (is_file ? ": is a file; images come from a folder" : ": no such folder"));
}

std::vector<std::filesystem::path> GrowingFolder::newcomers() {
  std::vector<std::filesystem::path> found;
  std::error_code error;
  for (const auto& entry : std::filesystem::directory_iterator(folder_, error)) {
    const std::filesystem::path& file = entry.path();
    if (file.filename().string().starts_with(".") || !entry.is_regular_file(error)) continue;
    if (!looks_like_photos(file)) continue;
    const std::uintmax_t bytes = entry.file_size(error);
    const auto changed = entry.last_write_time(error);
    auto [at, is_new] = known_.try_emplace(file, Known{bytes, changed});
    Known& known = at->second;
    const bool is_settled = !is_new && known.bytes == bytes && known.changed == changed;
    if (known.is_given && is_settled) continue;
    if (is_settled && bytes > 0) {
      known.is_given = true;
      found.push_back(file);
    } else {
      known = {bytes, changed};
    }
  }
  sort_naturally(found);
  return found;
}

bool GrowingFolder::put_back(const std::filesystem::path& file) {
  constexpr int enough = 20;  // a second, as it is asked
  const auto at = known_.find(file);
  if (at == known_.end() || ++at->second.num_tries >= enough) return false;
  at->second.is_given = false;
  return true;
}

}  // namespace alidade::live
