#pragma once

#include <memory>
#include <string>

#include "alidade/description/field.h"
#include "alidade/target/target_detector.h"

namespace alidade {

/// What the target looks like, as a user says it: "colour:230,70,20", "bright", "dark", "pattern:FILE",
/// "marker:DICTIONARY:ID".
struct NamedLook {
  TargetLook look = {};
  std::string text = {};                       ///< As it was given; empty: nothing.
  std::string pattern_file = {};               ///< Of a pattern, else empty.
  std::shared_ptr<cv::Mat> pattern = nullptr;  ///< Of a pattern, once it is loaded.
};

/// One field of it: "--look".
[[nodiscard]] Field look_field(NamedLook& look);

/// Reads the pattern's file where there is one. Throws InputError about the file, ConfigError where nothing can look
/// so: a colour without hue, an unknown dictionary.
void load_look(NamedLook& look);

}  // namespace alidade
