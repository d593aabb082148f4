#include "cli/photo_shelf.h"

#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <opencv2/core.hpp>
#include <set>

#include "alidade/io/exif.h"
#include "alidade/io/photos.h"

namespace alidade::cli {
namespace {

/// How most photos are turned: 1 to 8.
int usual_orientation(const std::vector<int>& orientations) {
  std::array<int, 9> counts{};
  for (const int orientation : orientations) ++counts.at(static_cast<std::size_t>(orientation));
  return static_cast<int>(std::max_element(counts.begin() + 1, counts.end()) - counts.begin());
}

std::string as_taken(int orientation) {
  const std::string_view turned = how_turned(orientation);
  return turned.empty() ? "upright" : std::string(turned);
}

}  // namespace

/// By photo: its pixels while there is room, whether it is among the inputs, and its orientation by EXIF; 0: not read.
struct PhotoShelf::Held {
  std::vector<cv::Mat> photos;
  std::vector<bool> inputs;
  std::vector<int> orientations;
  std::size_t bytes = 0;

  explicit Held(std::size_t count) : photos(count), inputs(count), orientations(count, 0) {}
};

PhotoShelf::PhotoShelf(const std::vector<std::filesystem::path>& arguments, Run& run)
    : found_(find_photos(arguments)), run_(run), held_(std::make_unique<Held>(size())) {}

PhotoShelf::~PhotoShelf() = default;

std::vector<std::string> PhotoShelf::names() const {
  std::set<std::string> short_names;
  for (const auto& file : found_.photos) short_names.insert(file.filename().string());
  const bool unique = short_names.size() == size();
  std::vector<std::string> names;
  for (const auto& file : found_.photos) names.push_back(unique ? file.filename().string() : file.string());
  return names;
}

cv::Mat PhotoShelf::load(std::size_t i) {
  if (!held_->photos[i].empty()) return held_->photos[i];
  const std::string bytes = read_file(found_.photos[i]);
  {
    const std::scoped_lock lock(mutex_);
    if (!held_->inputs[i]) run_.add_input("photo", found_.photos[i].string(), bytes);
    held_->inputs[i] = true;
  }
  cv::Mat photo = decode_photo(bytes);
  const int orientation = std::max(1, exif_tags(bytes).orientation);
  const std::scoped_lock lock(mutex_);
  held_->orientations[i] = orientation;
  constexpr std::size_t most_bytes = 256u << 20;
  held_->bytes += photo.total() * photo.elemSize();
  if (held_->bytes < most_bytes) held_->photos[i] = photo;
  return photo;
}

PhotoLoader PhotoShelf::loader() {
  return [this](std::size_t i) { return load(i); };
}

void PhotoShelf::tell_skipped() const {
  if (found_.skipped.empty()) return;
  auto& skipped = run_.document.counts.skipped;
  skipped.insert(skipped.end(), found_.skipped.begin(), found_.skipped.end());
  const std::size_t count = found_.skipped.size();
  run_.say(fmt::format("{} file{} beside the photos not read, the first: {} {}", count, count > 1 ? "s" : "",
                       found_.skipped.front().file, found_.skipped.front().reason));
}

void PhotoShelf::tell_turned(Verdict& verdict) const {
  constexpr std::size_t most_named = 5;
  const std::vector<int>& orientations = held_->orientations;
  const int usual = usual_orientation(orientations);
  const std::vector<std::string> all = names();
  std::vector<std::string> turned;
  std::string list;
  for (std::size_t i = 0; i < size(); ++i) {
    if (orientations[i] == 0 || orientations[i] == usual) continue;
    turned.push_back(all[i]);
    if (turned.size() > most_named) continue;
    list += (list.empty() ? "" : ", ") + all[i] + " was taken " + as_taken(orientations[i]);
  }
  if (turned.empty()) return;
  if (turned.size() > most_named) list += fmt::format(" and {} more were turned", turned.size() - most_named);
  const std::string text =
      fmt::format("turned by EXIF: {}, most photos {}; all pixels are used as stored", list, as_taken(usual));
  run_.say(text);
  verdict.checks.push_back({.name = "orientation",
                            .state = State::good,
                            .text = text,
                            .value = static_cast<double>(turned.size()),
                            .limit = static_cast<double>(size()),
                            .unit = "photos",
                            .figure = "photos"});
}

PhotoCalibration calibrate_shelf(PhotoShelf& shelf, const Board& board, const CalibrateConfig& config,
                                 std::span<const Eigen::Vector3d> given, Run& run) {
  const std::vector<std::string> names = shelf.names();
  PhotoCalibration result = calibrate_photos(names, shelf.loader(), board, config, given, run.progress);
  if (result.num_unreadable == names.size()) {
    const std::string others = fmt::format("; nor can any of the other {} be read", names.size() - 1);
    throw InputError(shelf.first() + ": " + result.reasons.front() + (names.size() > 1 ? others : ""));
  }
  run.lap("detect_and_solve");
  return result;
}

}  // namespace alidade::cli
