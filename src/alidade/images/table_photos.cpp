#include "alidade/images/table_photos.h"

#include <mutex>
#include <opencv2/core.hpp>
#include <utility>

#include "alidade/files/files.h"
#include "alidade/files/sha256.h"
#include "alidade/images/photos.h"

namespace alidade {

struct TablePhotos::Held {
  std::filesystem::path folder;
  std::map<std::string, std::string> roles;
  std::mutex mutex;
  std::map<std::string, InputFile> inputs;  ///< By the name in the table.

  cv::Mat load(const std::string& name) {
    const std::filesystem::path file = folder / name;
    const std::string bytes = read_file(file);
    {
      const std::scoped_lock lock(mutex);
      if (!inputs.contains(name)) {
        const auto role = roles.find(name);
        inputs[name] = {role == roles.end() ? "photo" : role->second, file.string(), bytes.size(), sha256(bytes)};
      }
    }
    return decode_photo(bytes);
  }
};

TablePhotos::TablePhotos(const std::filesystem::path& table, std::map<std::string, std::string> roles)
    : state_(std::make_shared<Held>()) {
  state_->folder = table.parent_path();
  state_->roles = std::move(roles);
}

PhotoByName TablePhotos::loader() const {
  return [state = state_](const std::string& name) { return state->load(name); };
}

std::vector<InputFile> TablePhotos::inputs() const {
  std::vector<InputFile> read;
  for (const auto& [name, input] : state_->inputs) read.push_back(input);
  return read;
}

}  // namespace alidade
