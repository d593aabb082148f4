#include "alidade/heads/streams/fits_image.h"

#include <algorithm>
#include <array>
#include <bit>
#include <cmath>
#include <cstdint>
#include <cstring>
#include <limits>
#include <map>
#include <opencv2/core.hpp>

#include "alidade/files/files.h"
#include "alidade/heads/protocols/soap.h"

namespace alidade {
namespace {

constexpr std::size_t block_bytes = 2880, card_bytes = 80;

std::string trimmed(std::string_view text) {
  const std::size_t first = text.find_first_not_of(" '"), last = text.find_last_not_of(" '");
  return first == std::string_view::npos ? "" : std::string(text.substr(first, last - first + 1));
}

/// Value of each keyword; the size of the header, in whole blocks.
std::map<std::string, std::string> read_cards(std::string_view bytes, const std::string& where, std::size_t& size) {
  std::map<std::string, std::string> cards;
  for (std::size_t at = 0; at + card_bytes <= bytes.size(); at += card_bytes) {
    const std::string_view card = bytes.substr(at, card_bytes);
    const std::string key = trimmed(card.substr(0, 8));
    if (at == 0 && key != "SIMPLE") break;
    if (key == "END") {
      size = (at / block_bytes + 1) * block_bytes;
      return cards;
    }
    if (card.substr(8, 2) != "= ") continue;
    std::string_view value = card.substr(10);
    const std::size_t quote = value.find('\'');
    const std::size_t end = quote != std::string_view::npos && trimmed(value.substr(0, quote)).empty()
                                ? value.find('\'', quote + 1)
                                : value.find('/');
    cards[key] = trimmed(value.substr(0, end));
  }
  throw InputError(where + ": an image that is no FITS");
}

double number_of(const std::map<std::string, std::string>& cards, const std::string& key, double otherwise) {
  const auto found = cards.find(key);
  if (found == cards.end()) return otherwise;
  char* end = nullptr;
  const double value = std::strtod(found->second.c_str(), &end);
  return end == found->second.c_str() ? otherwise : value;
}

/// Numbers are stored with their highest byte first.
template <typename Stored>
double stored_at(const char* bytes) {
  std::array<char, sizeof(Stored)> turned;
  std::reverse_copy(bytes, bytes + sizeof(Stored), turned.begin());
  return static_cast<double>(std::bit_cast<Stored>(turned));
}

using Reader = double (*)(const char*);
Reader reader_of(int bits) {
  switch (bits) {
    case 8:
      return stored_at<std::uint8_t>;
    case 16:
      return stored_at<std::int16_t>;
    case 32:
      return stored_at<std::int32_t>;
    case -32:
      return stored_at<float>;
    case -64:
      return stored_at<double>;
    default:
      return nullptr;
  }
}

}  // namespace

FitsImage read_fits(std::string_view bytes, const std::string& where) {
  constexpr double largest = 30000.0;
  std::size_t header = 0;
  const auto cards = read_cards(bytes, where, header);
  const double width = number_of(cards, "NAXIS1", 0.0), height = number_of(cards, "NAXIS2", 0.0);
  const int bits = static_cast<int>(number_of(cards, "BITPIX", 0.0));
  const Reader read = reader_of(bits);
  if (!(width >= 1.0 && height >= 1.0 && width <= largest && height <= largest) || read == nullptr)
    throw InputError(where + ": a FITS file without an image");
  const std::size_t a_pixel = static_cast<std::size_t>(std::abs(bits)) / 8;
  FitsImage image{.width_px = static_cast<int>(width), .height_px = static_cast<int>(height), .values = {}};
  const std::size_t total = static_cast<std::size_t>(image.width_px) * static_cast<std::size_t>(image.height_px);
  if (bytes.size() < header + total * a_pixel)
    throw InputError(where + ": a FITS file that ends before its image does");
  const double scale = number_of(cards, "BSCALE", 1.0), zero = number_of(cards, "BZERO", 0.0);
  const char* at = bytes.data() + header;
  image.values.resize(total);
  for (double& value : image.values) {
    value = scale * read(at) + zero;
    at += a_pixel;
  }
  const auto date = cards.find("DATE-OBS");
  image.begin_s = utc_seconds(date == cards.end() ? "" : date->second);
  image.exposure_s = number_of(cards, "EXPTIME", std::numeric_limits<double>::quiet_NaN());
  return image;
}

cv::Mat stretched_to_grey(const FitsImage& image) {
  constexpr double few = 3e-5, below = 0.05;
  std::vector<double> sorted = image.values;
  const auto middle = sorted.begin() + static_cast<std::ptrdiff_t>(sorted.size() / 2);
  std::nth_element(sorted.begin(), middle, sorted.end());
  const double sky = *middle;
  const auto bright = sorted.end() - 1 - static_cast<std::ptrdiff_t>(few * static_cast<double>(sorted.size()));
  std::nth_element(sorted.begin(), bright, sorted.end());
  const double span = std::max(1.0, *bright - sky), low = sky - below * span;
  cv::Mat grey;
  cv::Mat(image.height_px, image.width_px, CV_64F, const_cast<double*>(image.values.data()))
      .convertTo(grey, CV_8U, 255.0 / (1.0 + below) / span, -low * 255.0 / (1.0 + below) / span);
  return grey;
}

}  // namespace alidade
