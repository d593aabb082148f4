#pragma once

#include <memory>
#include <string>

#include "alidade/live/capture_session.h"
#include "cli/app/run.h"

namespace alidade::cli {

struct CaptureArgs;
struct CaptureSource;

/// A capture with its page: the browser's camera or a folder, watched and steered in a browser.
class CapturePage {
 public:
  /// Listens, and tells the person where. Throws InputError where it cannot.
  CapturePage(const CaptureArgs& args, const CaptureSource& source, const Board& board, live::CaptureSession& session,
              Run& run);
  ~CapturePage();
  CapturePage(const CapturePage&) = delete;
  CapturePage& operator=(const CapturePage&) = delete;

  /// Until the goal holds or the person ends it. Returns what was seen last where no board was.
  [[nodiscard]] std::string capture();
  /// A line for whoever looks at the page.
  void note(const std::string& line);
  /// The page becomes the report.
  void show_result(ExitCode code);

 private:
  struct State;
  std::unique_ptr<State> state_;
};

}  // namespace alidade::cli
