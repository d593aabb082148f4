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

}  // namespace alidade
