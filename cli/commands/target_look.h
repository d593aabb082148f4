#pragma once

#include <memory>
#include <string>

#include "alidade/target/target_detector.h"
#include "cli/app/run.h"

namespace alidade::cli {

/// What --target says: "colour:230,70,20", "bright", "dark", "pattern:FILE", "marker:DICTIONARY:ID".
struct TargetOption {
  TargetLook look;
  std::shared_ptr<cv::Mat> pattern;  ///< None but for a pattern.
};

inline constexpr const char* target_help =
    "What the target looks like: colour:R,G,B (0 to 255), bright, dark, pattern:FILE (a picture of it alone) or "
    "marker:DICTIONARY:ID, such as marker:DICT_4X4_50:7";

/// Reads it, and the pattern's file as one of the run's inputs. Throws UsageError, InputError.
[[nodiscard]] TargetOption read_target_option(const std::string& text, Run& run);

}  // namespace alidade::cli
