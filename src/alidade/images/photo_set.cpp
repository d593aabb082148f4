#include "alidade/images/photo_set.h"

#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <mutex>
#include <opencv2/core.hpp>
#include <set>

#include "alidade/files/sha256.h"
#include "alidade/images/exif.h"
#include "alidade/images/photos.h"

namespace alidade {
namespace {

/// The orientation of most photos: 1 to 8.
int usual_orientation(const std::vector<int>& orientations) {
  std::array<int, 9> counts{};
  for (const int orientation : orientations) ++counts.at(static_cast<std::size_t>(orientation));
  return static_cast<int>(std::max_element(counts.begin() + 1, counts.end()) - counts.begin());
}

std::string as_taken(int orientation) {
  const std::string_view turned = how_turned(orientation);
  return turned.empty() ? "upright" : std::string(turned);
}

std::vector<std::string> short_names(const std::vector<std::filesystem::path>& files) {
  std::set<std::string> different;
  for (const auto& file : files) different.insert(file.filename().string());
  const bool unique = different.size() == files.size();
  std::vector<std::string> names;
  for (const auto& file : files) names.push_back(unique ? file.filename().string() : file.string());
  return names;
}

}  // namespace

/// By photo: its pixels while there is room, what was read, and its orientation by EXIF; 0: not read.
struct PhotoSet::Held {
  PhotoFiles found;
  std::vector<std::string> names;
  std::vector<cv::Mat> photos;
  std::vector<std::optional<InputFile>> inputs;
  std::vector<int> orientations;
  std::size_t bytes = 0;
  std::mutex mutex;

  explicit Held(const std::vector<std::filesystem::path>& paths)
      : found(find_photos(paths)),
        names(short_names(found.photos)),
        photos(names.size()),
        inputs(names.size()),
        orientations(names.size(), 0) {}

  cv::Mat load(std::size_t i) {
    if (!photos[i].empty()) return photos[i];
    const std::string content = read_file(found.photos[i]);
    {
      InputFile input{"photo", found.photos[i].string(), content.size(), sha256(content)};
      const std::scoped_lock lock(mutex);
      inputs[i] = std::move(input);
    }
    cv::Mat photo = decode_photo(content);
    const int orientation = std::max(1, exif_tags(content).orientation);
    const std::scoped_lock lock(mutex);
    orientations[i] = orientation;
    constexpr std::size_t max_bytes = 256u << 20;
    bytes += photo.total() * photo.elemSize();
    if (bytes < max_bytes) photos[i] = photo;
    return photo;
  }
};

PhotoSet::PhotoSet(const std::vector<std::filesystem::path>& paths) : state_(std::make_shared<Held>(paths)) {}

Photos PhotoSet::photos() const {
  return {state_->names, [state = state_](std::size_t i) { return state->load(i); }};
}

std::size_t PhotoSet::size() const { return state_->names.size(); }

std::vector<InputFile> PhotoSet::inputs() const {
  std::vector<InputFile> read;
  for (const auto& input : state_->inputs) {
    if (input) read.push_back(*input);
  }
  return read;
}

const std::vector<SkippedInput>& PhotoSet::skipped() const { return state_->found.skipped; }

std::string PhotoSet::skipped_line() const {
  if (skipped().empty()) return "";
  const std::size_t count = skipped().size();
  return fmt::format("{} file{} beside the photos not read, the first: {} {}", count, count > 1 ? "s" : "",
                     skipped().front().file, skipped().front().reason);
}

std::optional<Check> PhotoSet::turned() const {
  constexpr std::size_t max_named = 5;
  const std::vector<int>& orientations = state_->orientations;
  const int usual = usual_orientation(orientations);
  std::size_t count = 0;
  std::string list;
  for (std::size_t i = 0; i < size(); ++i) {
    if (orientations[i] == 0 || orientations[i] == usual || ++count > max_named) continue;
    list += (list.empty() ? "" : ", ") + state_->names[i] + " was taken " + as_taken(orientations[i]);
  }
  constexpr int upright = 1;
  if (count == 0 && (size() == 0 || usual == upright)) return std::nullopt;
  if (count > max_named) list += fmt::format(" and {} more were turned", count - max_named);
  return Check{
      .name = "orientation",
      .state = State::good,
      .text =
          count > 0
              ? fmt::format("turned by EXIF: {}, most photos {}; all pixels are used as stored", list, as_taken(usual))
              : fmt::format("turned by EXIF: every photo was taken {}; pixels are used as stored: programs that "
                            "turn photos as they read them see another camera",
                            as_taken(usual)),
      .value = static_cast<double>(count),
      .limit = static_cast<double>(size()),
      .unit = "photos",
      .figure = "photos"};
}

void PhotoSet::require_readable(std::size_t num_unreadable, const std::string& reason) const {
  if (num_unreadable < size()) return;
  const std::string others = size() < 2    ? ""
                             : size() == 2 ? "; nor can the other be read"
                                           : fmt::format("; nor can any of the other {} be read", size() - 1);
  throw InputError(state_->found.photos.front().string() + ": " + reason + others);
}

Photos photos_in(const std::filesystem::path& path) { return PhotoSet({path}).photos(); }

}  // namespace alidade
