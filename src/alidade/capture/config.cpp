#include <fmt/format.h>

#include "alidade/capture.h"

namespace alidade {

FieldList fields_of(CaptureConfig& config) {
  TextCode code;
  code.read = [&config](std::string text) -> std::string {
    if (text.ends_with("px")) text.resize(text.size() - 2);
    double value = 0.0;
    Field number{.name = "until_px", .value = &value, .help = ""};
    if (const std::string fault = set_field(number, text); !fault.empty()) return fault;
    if (!(value >= 0.001 && value <= 100.0)) return "'" + text + "' is not within 0.001 to 100 px";
    config.until_px = value;
    return "";
  };
  code.write = [&config] { return fmt::format("{}px", config.until_px); };
  return {{.name = "until_px",
           .value = code,
           .help = "Goal of --live: 3σ at the worst pixel; capture stops when it is reached",
           .form = "PIXELS",
           .option = "--until"}};
}

std::string_view look_status_name(LookStatus status) {
  switch (status) {
    case LookStatus::nothing:
      return "nothing";
    case LookStatus::other_board:
      return "other_board";
    case LookStatus::moving:
      return "moving";
    case LookStatus::blurred:
      return "blurred";
    case LookStatus::same_pose:
      return "same_pose";
    case LookStatus::little:
      return "little";
    case LookStatus::repeated:
      return "repeated";
    case LookStatus::useful:
      return "useful";
  }
  return "nothing";
}

}  // namespace alidade
