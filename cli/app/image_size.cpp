#include "cli/app/image_size.h"

#include <fmt/format.h>

#include <algorithm>
#include <charconv>

#include "cli/app/run.h"

namespace alidade::cli {

std::pair<int, int> image_size(const std::string& text) {
  const char *at = text.data(), *end = at + text.size();
  int width = 0, height = 0;
  const auto left = std::from_chars(at, end, width);
  const bool has_cross = left.ec == std::errc{} && left.ptr != end && *left.ptr == 'x';
  const auto right = has_cross ? std::from_chars(left.ptr + 1, end, height) : left;
  constexpr int least = 32, most = 20000;
  const bool is_size = has_cross && right.ec == std::errc{} && right.ptr == end && std::min(width, height) >= least &&
                       std::max(width, height) <= most;
  if (!is_size) {
    throw UsageError(
        fmt::format("--size: '{}' is not WIDTHxHEIGHT of {} to {} px, for example 800x600", text, least, most));
  }
  return {width, height};
}

}  // namespace alidade::cli
