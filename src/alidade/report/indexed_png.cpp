#include "alidade/report/indexed_png.h"

#include <algorithm>
#include <array>
#include <string_view>

namespace alidade::report {
namespace {

void append_big_endian(std::string& out, std::uint32_t value) {
  for (const unsigned shift : {24U, 16U, 8U, 0U}) out += static_cast<char>((value >> shift) & 0xFFU);
}

std::uint32_t crc32(std::string_view bytes) {
  static const auto table = [] {
    std::array<std::uint32_t, 256> entries{};
    for (std::uint32_t n = 0; n < 256; ++n) {
      std::uint32_t c = n;
      for (int k = 0; k < 8; ++k) c = (c & 1U) != 0U ? 0xEDB88320U ^ (c >> 1U) : c >> 1U;
      entries[n] = c;
    }
    return entries;
  }();
  std::uint32_t crc = 0xFFFFFFFFU;
  for (const char byte : bytes) crc = table[(crc ^ static_cast<unsigned char>(byte)) & 0xFFU] ^ (crc >> 8U);
  return crc ^ 0xFFFFFFFFU;
}

std::uint32_t adler32(std::string_view bytes) {
  std::uint32_t a = 1, b = 0;
  for (const char byte : bytes) {
    a = (a + static_cast<unsigned char>(byte)) % 65521U;
    b = (b + a) % 65521U;
  }
  return (b << 16U) | a;
}

void append_chunk(std::string& out, std::string_view type, std::string_view content) {
  append_big_endian(out, static_cast<std::uint32_t>(content.size()));
  const std::string body = std::string(type) + std::string(content);
  out += body;
  append_big_endian(out, crc32(body));
}

std::string stored_zlib(std::string_view bytes) {
  std::string out = "\x78\x01";
  constexpr std::size_t block = 65535;
  for (std::size_t at = 0; at < bytes.size(); at += block) {
    const auto size = static_cast<std::uint16_t>(std::min(block, bytes.size() - at));
    out += static_cast<char>(at + block >= bytes.size() ? 1 : 0);
    for (const unsigned value : {static_cast<unsigned>(size), ~static_cast<unsigned>(size) & 0xFFFFU}) {
      out += static_cast<char>(value & 0xFFU);
      out += static_cast<char>(value >> 8U);
    }
    out += bytes.substr(at, size);
  }
  append_big_endian(out, adler32(bytes));
  return out;
}

}  // namespace

std::string indexed_png(int cols, int rows, const std::vector<std::uint8_t>& indices, const std::vector<Rgb>& palette) {
  std::string header, colours, scanlines;
  append_big_endian(header, static_cast<std::uint32_t>(cols));
  append_big_endian(header, static_cast<std::uint32_t>(rows));
  header += std::string("\x08\x03\x00\x00\x00", 5);  // 8 bits, palette
  for (std::size_t i = 0; i < 256; ++i) {
    const Rgb colour = i < palette.size() ? palette[i] : Rgb{};
    for (const int part : {colour.red, colour.green, colour.blue}) colours += static_cast<char>(part);
  }
  for (int row = 0; row < rows; ++row) {
    scanlines += '\0';  // no filter
    for (int col = 0; col < cols; ++col)
      scanlines += static_cast<char>(
          indices[static_cast<std::size_t>(row) * static_cast<std::size_t>(cols) + static_cast<std::size_t>(col)]);
  }
  std::string png = "\x89PNG\r\n\x1a\n";
  append_chunk(png, "IHDR", header);
  append_chunk(png, "PLTE", colours);
  append_chunk(png, "tRNS", std::string(255, '\xFF') + std::string(1, '\0'));
  append_chunk(png, "IDAT", stored_zlib(scanlines));
  append_chunk(png, "IEND", "");
  return png;
}

}  // namespace alidade::report
