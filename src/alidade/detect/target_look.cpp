#include "alidade/detect/target_look.h"

#include <charconv>
#include <opencv2/core.hpp>
#include <stdexcept>
#include <vector>

#include "alidade/estimation/config_error.h"
#include "alidade/files/files.h"
#include "alidade/images/photos.h"

namespace alidade {
namespace {

std::vector<std::string> split_at(const std::string& text, char by) {
  std::vector<std::string> parts(1);
  for (const char c : text) c == by ? (void)parts.emplace_back() : parts.back().push_back(c);
  return parts;
}

bool is_whole(const std::string& text, int& value) {
  const auto [end, error] = std::from_chars(text.data(), text.data() + text.size(), value);
  return error == std::errc{} && end == text.data() + text.size();
}

std::string read_colour(const std::string& rest, TargetLook& look) {
  const auto values = split_at(rest, ',');
  if (values.size() != 3) return "a colour is colour:R,G,B, each 0 to 255";
  look.kind = TargetKind::colour;
  for (std::size_t i = 0; i < 3; ++i) {
    int value = 0;
    if (!is_whole(values[i], value)) return "'" + values[i] + "' is not a whole number";
    look.rgb[static_cast<Eigen::Index>(i)] = value;
  }
  return "";
}

std::string read_marker(const std::string& rest, TargetLook& look) {
  const auto parts = split_at(rest, ':');
  if (parts.size() != 2) return "a marker is marker:DICTIONARY:ID";
  look.kind = TargetKind::marker;
  look.dictionary = parts[0];
  return is_whole(parts[1], look.marker_id) ? "" : "'" + parts[1] + "' is not a whole number";
}

std::string read_look(const std::string& text, NamedLook& named) {
  const std::size_t colon = text.find(':');
  const std::string kind = text.substr(0, colon), rest = colon == std::string::npos ? "" : text.substr(colon + 1);
  named = {.text = text};
  if (kind == "colour" || kind == "color") return read_colour(rest, named.look);
  if (kind == "marker") return read_marker(rest, named.look);
  if (kind == "pattern" && !rest.empty()) {
    named.look.kind = TargetKind::pattern;
    named.pattern_file = rest;
    return "";
  }
  named.look.kind = text == "bright" ? TargetKind::bright : TargetKind::dark;
  if (text == "bright" || text == "dark") return "";
  return "'" + text + "' is not colour:R,G,B, bright, dark, pattern:FILE or marker:DICTIONARY:ID";
}

}  // namespace

Field look_field(NamedLook& look) {
  TextCode code;
  code.read = [&look](const std::string& text) { return read_look(text, look); };
  code.write = [&look] { return look.text; };
  return {.name = "look",
          .value = code,
          .help =
              "Appearance of the target: colour:R,G,B (0 to 255), bright, dark, pattern:FILE (an image of the target "
              "only) or marker:DICTIONARY:ID, for example marker:DICT_4X4_50:7",
          .form = "LOOK",
          .old_options = {"--target"}};
}

void load_look(NamedLook& look) {
  if (look.look.kind == TargetKind::pattern) {
    look.pattern = std::make_shared<cv::Mat>(decode_photo(read_file(look.pattern_file), look.pattern_file));
    if (look.pattern->depth() != CV_8U) throw InputError(look.pattern_file + ": has more than 8 bits; a pattern has 8");
  }
  try {
    const TargetDetector detector(look.look, look.pattern.get());  // says what is wrong with it
  } catch (const std::invalid_argument& fault) {
    throw ConfigError("--look " + look.text + ": " + fault.what());
  }
}

}  // namespace alidade
