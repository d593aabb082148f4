#include "alidade/report/markup.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <cstdint>

namespace alidade::report {
namespace {

bool is_continuation(char byte) { return (static_cast<unsigned char>(byte) & 0xC0U) == 0x80U; }

// Length of the well-formed UTF-8 character at `at`, or 0.
std::size_t character_length(std::string_view text, std::size_t at) {
  const auto lead = static_cast<unsigned char>(text[at]);
  const std::size_t length = lead < 0x80   ? 1
                             : lead < 0xC2 ? 0
                             : lead < 0xE0 ? 2
                             : lead < 0xF0 ? 3
                             : lead < 0xF5 ? 4
                                           : 0;
  if (length == 0 || at + length > text.size()) return 0;
  for (std::size_t i = 1; i < length; ++i)
    if (!is_continuation(text[at + i])) return 0;
  return length;
}

std::string_view entity(char character) {
  switch (character) {
    case '&':
      return "&amp;";
    case '<':
      return "&lt;";
    case '>':
      return "&gt;";
    case '"':
      return "&quot;";
    case '\'':
      return "&#39;";
    default:
      return {};
  }
}

}  // namespace

std::string escaped(std::string_view text) {
  std::string out;
  out.reserve(text.size() + 16);
  for (std::size_t i = 0; i < text.size();) {
    const std::size_t length = character_length(text, i);
    const bool is_control = length == 1 && static_cast<unsigned char>(text[i]) < 0x20 && text[i] != '\n';
    if (length == 0 || is_control) {
      out += "\xEF\xBF\xBD";  // U+FFFD
      ++i;
      continue;
    }
    const std::string_view replacement = length == 1 ? entity(text[i]) : std::string_view{};
    if (replacement.empty())
      out += text.substr(i, length);
    else
      out += replacement;
    i += length;
  }
  return out;
}

std::string base64(std::string_view bytes) {
  static constexpr std::string_view digits = "ABCDEFGHIJKLMNOPQRSTUVWXYZabcdefghijklmnopqrstuvwxyz0123456789+/";
  std::string out((bytes.size() + 2) / 3 * 4, '=');
  std::size_t at = 0;
  for (std::size_t i = 0; i < bytes.size(); i += 3) {
    const std::size_t rest = std::min<std::size_t>(3, bytes.size() - i);
    std::uint32_t word = 0;
    for (std::size_t k = 0; k < 3; ++k)
      word = (word << 8U) | (k < rest ? static_cast<unsigned char>(bytes[i + k]) : 0U);
    for (std::size_t k = 0; k < 4; ++k, ++at)
      if (k <= rest) out[at] = digits[(word >> (18U - 6U * k)) & 63U];
  }
  return out;
}

std::string json_in_script(std::string_view json) {
  std::string out;
  out.reserve(json.size() + 64);
  for (const char character : json) {
    if (character == '<')
      out += "\\u003c";
    else
      out += character;
  }
  return out;
}

std::string rounded_text(double value, int digits) {
  if (std::isnan(value)) return "–";
  if (std::isinf(value)) return value > 0.0 ? "∞" : "−∞";
  const double size = std::abs(value);
  if (size != 0.0 && (size >= 1e7 || size < 1e-5)) return fmt::format("{:.{}e}", value, std::max(0, digits - 1));
  const int before = size > 0.0 ? static_cast<int>(std::floor(std::log10(size))) + 1 : 1;
  return fmt::format("{:.{}f}", value, std::clamp(digits - before, 0, 12));
}

std::string number_text(double value, int digits) {
  std::string text = rounded_text(value, digits);
  if (text.find('.') == std::string::npos || text.find('e') != std::string::npos) return text;
  text.erase(text.find_last_not_of('0') + 1);
  if (text.back() == '.') text.pop_back();
  return text == "-0" ? "0" : text;
}

ValueText value_text(double value, double sigma) {
  const double three_sigma = 3.0 * sigma;
  if (!std::isfinite(value)) return {"–", ""};
  if (!(three_sigma > 0.0) || !std::isfinite(three_sigma)) return {number_text(value, 4), ""};
  int exponent = static_cast<int>(std::floor(std::log10(three_sigma)));
  if (std::round(three_sigma / std::pow(10.0, exponent - 1)) >= 100.0) ++exponent;  // 0.0996 shows as 0.10
  if (exponent < -7) return {fmt::format("{:.8g}", value), fmt::format("{:.1e}", three_sigma)};
  const int decimals = std::max(0, 1 - exponent);
  return {fmt::format("{:.{}f}", value, decimals), fmt::format("{:.{}f}", three_sigma, decimals)};
}

}  // namespace alidade::report
