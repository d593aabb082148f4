#include "alidade/images/foreign_images.h"

#include <algorithm>
#include <array>
#include <cctype>
#include <nlohmann/json.hpp>
#include <utility>

#include "alidade/files/files.h"
#include "alidade/images/exif.h"

namespace alidade {
namespace {

/// Why a kind is not read, and what helps. Rotating an image on the way would move its centre.
std::string advice_for(const std::string& kind) {
  if (kind == "raw")
    return "is a camera's raw file: develop it to TIFF or PNG, without correcting the lens or turning it";
  if (kind == "video") return "is a video: take still frames out of it, as PNG";
  if (kind == "PDF") return "is a PDF, not a photo";
  if (kind == "table") return "is a table, not a photo: corners that were found elsewhere are given by --corners";
  return "is " + kind + ", which is not read: convert it to JPEG or PNG without turning it";
}

/// Brands of ISO base media files (ISO/IEC 14496-12): images among them, all others are videos.
std::string kind_of_brand(std::string_view brand) {
  for (const std::string_view heic : {"heic", "heix", "heim", "heis", "hevc", "hevx", "mif1", "msf1"}) {
    if (brand == heic) return "HEIC";
  }
  if (brand == "avif" || brand == "avis") return "AVIF";
  return brand == "crx " ? "raw" : "video";  // Canon's CR3
}

/// Text whose first two lines have equally many separators.
bool is_table(std::string_view bytes) {
  const std::string_view start = bytes.substr(0, 4096);
  const std::size_t first = start.find('\n'), second = first < start.size() ? start.find('\n', first + 1) : first;
  if (second >= start.size()) return false;
  const std::string_view lines = start.substr(0, second);
  if (std::ranges::any_of(lines, [](char c) { return static_cast<unsigned char>(c) < ' ' && !std::isspace(c); }))
    return false;
  return std::ranges::any_of(std::string_view(",;\t"), [&](char separator) {
    const auto num = std::ranges::count(lines.substr(0, first), separator);
    return num > 1 && num == std::ranges::count(lines.substr(first), separator);
  });
}

std::string kind_of(std::string_view bytes) {
  const auto at = [&](std::size_t from, std::string_view text) {
    return bytes.substr(0, 64).substr(from, text.size()) == text;
  };
  if (bytes.size() < 12) return "";
  if (at(4, "ftyp")) return kind_of_brand(bytes.substr(8, 4));
  if (at(0, "GIF8")) return "GIF";
  if (at(0, "%PDF")) return "PDF";
  if (at(0, std::string_view("\0\0\0\x0CJXL ", 8)) || at(0, "\xFF\x0A")) return "JPEG XL";
  if (at(0, "FUJIFILMCCD-RAW") || at(0, "IIRO") || at(0, "IIRS") || at(0, "IIU") || at(8, "CR\x02")) return "raw";
  if ((at(0, "II*") || at(0, "MM")) && exif_tags(bytes).is_raw) return "raw";
  if (at(0, "RIFF") && at(8, "AVI ")) return "video";
  return is_table(bytes) ? "table" : "";
}

std::string kind_of_ending(const std::string& ending) {
  constexpr std::array<std::pair<const char*, const char*>, 32> kinds{
      {{".heic", "HEIC"},  {".heif", "HEIC"},   {".hif", "HEIC"},      {".avif", "AVIF"}, {".gif", "GIF"},
       {".pdf", "PDF"},    {".jxl", "JPEG XL"}, {".jp2", "JPEG 2000"}, {".cr2", "raw"},   {".cr3", "raw"},
       {".nef", "raw"},    {".nrw", "raw"},     {".arw", "raw"},       {".srf", "raw"},   {".sr2", "raw"},
       {".dng", "raw"},    {".raf", "raw"},     {".rw2", "raw"},       {".orf", "raw"},   {".pef", "raw"},
       {".srw", "raw"},    {".x3f", "raw"},     {".iiq", "raw"},       {".raw", "raw"},   {".mp4", "video"},
       {".mov", "video"},  {".avi", "video"},   {".mkv", "video"},     {".m4v", "video"}, {".mts", "video"},
       {".webm", "video"}, {".3gp", "video"}}};
  for (const auto& [known, kind] : kinds) {
    if (ending == known) return kind;
  }
  return "";
}

bool is_ours(const nlohmann::json& result) {
  return result.is_object() && result.contains("schema") && result["schema"] == "alidade-result/1";
}

}  // namespace

std::string foreign_image(std::string_view bytes) {
  const std::string kind = kind_of(bytes);
  return kind.empty() ? "" : advice_for(kind);
}

std::string lower_ending(const std::filesystem::path& file) {
  std::string ending = file.extension().string();
  std::transform(ending.begin(), ending.end(), ending.begin(),
                 [](unsigned char c) { return static_cast<char>(std::tolower(c)); });
  return ending;
}

bool is_foreign_ending(const std::filesystem::path& file) { return !kind_of_ending(lower_ending(file)).empty(); }

std::string why_no_photo(const std::filesystem::path& file) {
  std::error_code ignored;
  if (std::filesystem::is_directory(file, ignored)) {
    const bool is_result = file.filename() == "alidade-out" || std::filesystem::exists(file / "result.json", ignored);
    return is_result ? "" : "is a folder within: give it by its name if its photos are meant";
  }
  const std::string name = file.filename().string();
  if (name == "Thumbs.db" || name == "desktop.ini") return "";  // hidden where they come from
  const std::string kind = kind_of_ending(lower_ending(file));
  return kind.empty() ? "has no ending of an image that is read" : advice_for(kind);
}

std::set<std::string> our_results(const std::filesystem::path& folder) {
  std::error_code ignored;
  if (!std::filesystem::exists(folder / "result.json", ignored)) return {};
  const auto result = nlohmann::json::parse(read_file(folder / "result.json"), nullptr, false);
  if (!is_ours(result)) return {};
  std::set<std::string> names{"result.json", "report.html"};
  for (const auto& name : result.value("files", nlohmann::json::array())) {
    if (name.is_string()) names.insert(name.get<std::string>());
  }
  return names;
}

}  // namespace alidade
