#include "alidade/localize/localization.h"

namespace alidade {

std::string_view event_name(FrameEvent event) {
  switch (event) {
    case FrameEvent::waiting:
      return "waiting";
    case FrameEvent::started:
      return "started";
    case FrameEvent::tracked:
      return "tracked";
    case FrameEvent::predicted:
      return "predicted";
    case FrameEvent::restarted:
      return "restarted";
  }
  return "";
}

std::string_view source_name(SigmaPxFrom from) {
  switch (from) {
    case SigmaPxFrom::usual:
      return "default";
    case SigmaPxFrom::given:
      return "given";
    case SigmaPxFrom::rows:
      return "rows";
    case SigmaPxFrom::residuals:
      return "residuals";
  }
  return "";
}

}  // namespace alidade
