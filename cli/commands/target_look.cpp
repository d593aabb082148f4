#include "cli/commands/target_look.h"

#include <fmt/format.h>

#include <charconv>
#include <opencv2/core.hpp>
#include <stdexcept>
#include <vector>

#include "alidade/files/files.h"
#include "alidade/images/photos.h"

namespace alidade::cli {
namespace {

std::vector<std::string> split(const std::string& text, char by) {
  std::vector<std::string> parts(1);
  for (const char c : text) c == by ? (void)parts.emplace_back() : parts.back().push_back(c);
  return parts;
}

double whole_number(const std::string& text, const std::string& option) {
  int value = 0;
  const auto [end, error] = std::from_chars(text.data(), text.data() + text.size(), value);
  if (error != std::errc{} || end != text.data() + text.size())
    throw UsageError(fmt::format("--target {}: '{}' is not a whole number", option, text));
  return value;
}

TargetLook look_of(const std::string& text) {
  const std::size_t colon = text.find(':');
  const std::string kind = text.substr(0, colon), rest = colon == std::string::npos ? "" : text.substr(colon + 1);
  TargetLook look;
  if (kind == "colour" || kind == "color") {
    const auto values = split(rest, ',');
    if (values.size() != 3) throw UsageError("--target " + text + ": a colour is colour:R,G,B, each 0 to 255");
    look.kind = TargetKind::colour;
    for (int i = 0; i < 3; ++i) look.rgb[i] = whole_number(values[static_cast<std::size_t>(i)], text);
  } else if (kind == "marker") {
    const auto parts = split(rest, ':');
    if (parts.size() != 2) throw UsageError("--target " + text + ": a marker is marker:DICTIONARY:ID");
    look.kind = TargetKind::marker;
    look.dictionary = parts[0];
    look.marker_id = static_cast<int>(whole_number(parts[1], text));
  } else if (kind == "pattern" && !rest.empty()) {
    look.kind = TargetKind::pattern;
  } else if (text == "bright" || text == "dark") {
    look.kind = text == "bright" ? TargetKind::bright : TargetKind::dark;
  } else {
    throw UsageError("--target: '" + text +
                     "' is not colour:R,G,B, bright, dark, pattern:FILE or marker:DICTIONARY:ID");
  }
  return look;
}

}  // namespace

TargetOption read_target_option(const std::string& text, Run& run) {
  TargetOption option{look_of(text), nullptr};
  if (option.look.kind == TargetKind::pattern) {
    const std::string file = text.substr(std::string("pattern:").size());
    const std::string bytes = read_file(file);
    run.add_input("pattern", file, bytes);
    option.pattern = std::make_shared<cv::Mat>(decode_photo(bytes, file));
    if (option.pattern->depth() != CV_8U) throw InputError(file + ": has more than 8 bits; a pattern has 8");
  }
  try {
    const TargetDetector detector(option.look, option.pattern.get());  // says what is wrong with it
  } catch (const std::invalid_argument& fault) {
    throw UsageError("--target " + text + ": " + fault.what());
  }
  return option;
}

}  // namespace alidade::cli
