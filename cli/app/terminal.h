#pragma once

#include <memory>
#include <string>
#include <string_view>

#include "alidade/estimation/progress.h"

namespace alidade::cli {

/// The user in front of the command: error lines, the progress line, Ctrl-C. One for a process.
class Terminal {
 public:
  Terminal();
  ~Terminal();
  Terminal(const Terminal&) = delete;
  Terminal& operator=(const Terminal&) = delete;

  /// `alidade: error: MESSAGE`, one line for any message, after wiping the progress line.
  void error(std::string_view message);
  /// Called by long work: shows a line on a terminal (not with `--quiet` or `--json`), and stops after Ctrl-C.
  [[nodiscard]] Progress progress(bool shown);
  void wipe_progress();

  struct State;
  /// That of the newest one.
  [[nodiscard]] static std::weak_ptr<State>& current();

 private:
  std::shared_ptr<State> state_;  // the Progress handed out shares it, so that it may outlive this
};

/// Wipes the progress line of the newest one, before something is printed on stdout.
void wipe_progress_line();

/// stderr as it was before the newest one, for a program that takes over this process.
void give_back_stderr();

/// A printed line, on stderr, after wiping the progress line: what they need while the command runs.
void tell_person(std::string_view line);

/// A line on stderr, as it is, without an allocation: where no memory is left.
void tell_without_memory(std::string_view line);

/// Where stdin, stdout or stderr is closed, something stands in its place: no file of ours takes its number. Writing to
/// such a stdout fails.
void hold_standard_streams();

/// From now on the first SIGINT or SIGTERM asks the work to stop, and the second ends the process at once. A write to
/// a closed pipe, or beyond the largest size of a file, fails instead of ending the process.
void catch_interrupts();
/// While it exists, work that has not stopped 0.3 s after it was asked to is ended as Interrupted ends it, with its
/// line and its exit code: work that writes nothing until begin_writing(), and has no other program to stop first.
class StopsAtOnce {
 public:
  StopsAtOnce();
  ~StopsAtOnce();
  StopsAtOnce(const StopsAtOnce&) = delete;
  StopsAtOnce& operator=(const StopsAtOnce&) = delete;
};
/// From here on it ends by itself: look once more at interrupting_signal(), then write.
void begin_writing();
/// The signal that asked to stop; 0 if none did.
[[nodiscard]] int interrupting_signal();
/// The signal has been handled without ending the work: the next one asks again.
void forget_interrupt();

/// Text in one line: control characters and line ends become spaces, runs of spaces become one.
[[nodiscard]] std::string one_line(std::string_view text);

}  // namespace alidade::cli
