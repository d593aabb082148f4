#pragma once

#include <memory>
#include <string>

#include "alidade/description/field.h"
#include "alidade/target/target_detector.h"

namespace alidade {

/// The appearance of the target, as a user specifies it: "colour:230,70,20", "bright", "dark", "pattern:FILE",
/// "marker:DICTIONARY:ID".
struct NamedLook {
  TargetLook look = {};
  std::string text = {};                       ///< As given; empty: none.
  std::string pattern_file = {};               ///< For a pattern, else empty.
  std::shared_ptr<cv::Mat> pattern = nullptr;  ///< For a pattern, once it is loaded.
};

/// The field "--look" of a config.
[[nodiscard]] Field look_field(NamedLook& look);

/// Reads the pattern's file, if there is one. Throws InputError about the file, and ConfigError for an appearance that
/// is impossible: a colour without hue, an unknown dictionary.
void load_look(NamedLook& look);

}  // namespace alidade
