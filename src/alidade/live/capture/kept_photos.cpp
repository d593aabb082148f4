#include "alidade/live/capture/kept_photos.h"

#include <fmt/format.h>

#include <algorithm>
#include <fstream>
#include <opencv2/core/mat.hpp>

#include "alidade/files/csv.h"
#include "alidade/files/files.h"
#include "alidade/imaging/image_codecs.h"

namespace alidade::live {
namespace {

/// 7 of "000007.png"; 0 of any other name.
int number_of(const std::string& file) {
  constexpr std::size_t digits = 6;
  if (file.size() < digits + 4 || !file.ends_with(".png")) return 0;
  const std::string number = file.substr(0, file.size() - 4);
  const bool is_number = std::ranges::all_of(number, [](char c) { return c >= '0' && c <= '9'; });
  return is_number && number.size() <= 9 ? std::stoi(number) : 0;
}

std::vector<std::string> files_in(const std::filesystem::path& folder) {
  std::vector<std::string> files;
  std::error_code ignored;
  for (const auto& entry : std::filesystem::directory_iterator(folder, ignored)) {
    std::string name = entry.path().filename().string();
    if (number_of(name) > 0) files.push_back(std::move(name));
  }
  std::ranges::sort(files, {}, number_of);
  return files;
}

/// The last number that was given in a folder, where its photo was forgotten since; else 0.
int last_forgotten(const std::filesystem::path& file) {
  std::ifstream stream(file);
  int number = 0;
  return stream >> number && number > 0 ? number : 0;
}

}  // namespace

KeptPhotos::KeptPhotos(std::filesystem::path folder, bool goes_on) : folder_(std::move(folder)) {
  const std::vector<std::string> files = files_in(this->folder());
  if (!files.empty() && !goes_on)
    throw InputError(folder_.string() + ": has photos of an earlier capture; go on with --resume " + folder_.string() +
                     ", or give another --out");
  if (files.empty() && goes_on) throw InputError(folder_.string() + ": has no photos of a capture to go on with");
  std::error_code ignored;
  const std::filesystem::path table = folder_ / "photos.csv";
  if (goes_on && std::filesystem::exists(table, ignored)) {
    const Csv csv = Csv::read(table);
    csv.require(std::vector<std::string>{"file", "t_s", "exact"});
    for (std::size_t row = 0; row < csv.num_rows(); ++row) {
      const std::string& file = csv.text(row, "file");
      last_number_ = std::max(last_number_, number_of(file));
      if (std::ranges::find(files, file) == files.end()) continue;
      photos_.push_back({file, csv.number(row, "t_s"), csv.text(row, "exact") == "1"});
    }
  }
  last_number_ = std::max(last_number_, last_forgotten(forgotten_file()));
  // Killed between a photo and its row: the photo counts.
  for (const std::string& file : files) {
    last_number_ = std::max(last_number_, number_of(file));
    if (std::ranges::find(photos_, file, &KeptPhoto::file) != photos_.end()) continue;
    photos_.push_back({file, photos_.empty() ? 0.0 : photos_.back().t_s, false});
  }
  write_table();
}

const KeptPhoto& KeptPhotos::add(const cv::Mat& grey, double t_s, bool is_exact) {
  KeptPhoto photo{fmt::format("{:06}.png", ++last_number_), t_s, is_exact};
  write_file(path_of(photo), png_bytes(grey));
  photos_.push_back(std::move(photo));
  write_table();
  return photos_.back();
}

bool KeptPhotos::undo() {
  if (photos_.empty()) return false;
  write_file(forgotten_file(), fmt::format("{}\n", last_number_));  // so that --resume does not give it again
  std::error_code ignored;
  std::filesystem::remove(path_of(photos_.back()), ignored);
  photos_.pop_back();
  write_table();
  return true;
}

void KeptPhotos::write_table() const {
  std::string text = "file,t_s,exact\n";
  for (const KeptPhoto& photo : photos_)
    text += fmt::format("{},{:.6f},{}\n", photo.file, photo.t_s, photo.is_exact ? 1 : 0);
  write_file(folder_ / "photos.csv", text);
}

}  // namespace alidade::live
