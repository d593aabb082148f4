#include "cli/app/terminal.h"

#include <fcntl.h>
#include <unistd.h>

#include <atomic>
#include <chrono>
#include <csignal>
#include <ctime>
#include <mutex>

#include "alidade/geometry/sanitizers.h"

namespace alidade::cli {
namespace {

std::atomic<int> stop_signal{0};         // a signal handler can reach nothing but a global
std::atomic<int> people{STDERR_FILENO};  // where lines for people go; a terminal's line is wiped before them
std::atomic<bool> is_on_terminal{false}, has_nothing_written{false}, has_patience{false};
static_assert(std::atomic<int>::is_always_lock_free && std::atomic<bool>::is_always_lock_free);
timer_t patience;

void write_text(int to, std::string_view text) {
  while (!text.empty()) {
    const ssize_t written = ::write(to, text.data(), text.size());
    if (written <= 0) return;  // no reader: nowhere to report it either
    text.remove_prefix(static_cast<std::size_t>(written));
  }
}

extern "C" void on_interrupt(int signal) {
  if (stop_signal.exchange(signal) != 0) ::_exit(128 + signal);  // the second one does not wait
  constexpr itimerspec once{{0, 0}, {0, 300'000'000}};
  if (has_patience) ::timer_settime(patience, 0, &once, nullptr);
}

/// A fit that has not come by where it asks: it is in memory alone. What has begun to be written is not disturbed.
extern "C" void on_patience_end(int) {
  if (stop_signal == 0 || !has_nothing_written) return;
  if (is_on_terminal) write_text(people, "\r\033[K");
  write_text(people, "alidade: error: interrupted; nothing written\n");
  ::_exit(128 + stop_signal);
}

/// Called instead of ending the process: the write that failed says so itself. Not ignored: a program that is started
/// from here gets the usual manner back.
extern "C" void on_failed_write(int) {}

/// A sanitizer reports on stderr, which must then stay open to it.
constexpr bool is_sanitized = ALIDADE_IS_SANITIZED != 0;

}  // namespace

struct Terminal::State {
  int people = ::dup(STDERR_FILENO);  // ours alone: image decoders write to STDERR_FILENO, one line is promised
  bool is_terminal = ::isatty(STDERR_FILENO) == 1;
  std::mutex mutex;
  bool has_progress_line = false;
  std::chrono::steady_clock::time_point shown_at;

  void wipe() {
    const std::scoped_lock lock(mutex);
    if (has_progress_line) write_text(people, "\r\033[K");
    has_progress_line = false;
  }

  void show(std::string_view what, std::size_t done, std::size_t total) {
    const std::unique_lock lock(mutex, std::try_to_lock);
    if (!lock) return;  // another thread is showing something newer
    const auto now = std::chrono::steady_clock::now();
    if (has_progress_line && now - shown_at < std::chrono::milliseconds(100)) return;
    shown_at = now;
    has_progress_line = true;
    std::string line = "\r\033[K" + one_line(what);
    if (total > 0) line += " " + std::to_string(done) + "/" + std::to_string(total);
    write_text(people, line);
  }
};

std::weak_ptr<Terminal::State>& Terminal::current() {
  static std::weak_ptr<State> state;
  return state;
}

Terminal::Terminal() : state_(std::make_shared<State>()) {
  current() = state_;
  people = state_->people;
  is_on_terminal = state_->is_terminal;
  if (is_sanitized) return;
  const int nowhere = ::open("/dev/null", O_WRONLY | O_CLOEXEC);
  if (nowhere < 0) return;
  ::dup2(nowhere, STDERR_FILENO);
  ::close(nowhere);
}

Terminal::~Terminal() {
  state_->wipe();
  ::dup2(state_->people, STDERR_FILENO);
  people = STDERR_FILENO;
  ::close(state_->people);
}

void Terminal::error(std::string_view message) {
  state_->wipe();
  write_text(state_->people, "alidade: error: " + one_line(message) + "\n");
}

Progress Terminal::progress(bool shown) {
  return [state = state_, shown = shown && state_->is_terminal](std::string_view what, std::size_t done,
                                                                std::size_t total) {
    if (interrupting_signal() != 0) return false;
    if (shown) state->show(what, done, total);
    return true;
  };
}

void Terminal::wipe_progress() { state_->wipe(); }

void wipe_progress_line() {
  const std::shared_ptr<Terminal::State> state = Terminal::current().lock();
  if (state) state->wipe();
}

void give_back_stderr() {
  const std::shared_ptr<Terminal::State> state = Terminal::current().lock();
  if (!state) return;
  state->wipe();
  ::dup2(state->people, STDERR_FILENO);
}

void tell_person(std::string_view line) {
  const std::shared_ptr<Terminal::State> state = Terminal::current().lock();
  if (state) state->wipe();
  write_text(state ? state->people : STDERR_FILENO, one_line(line) + "\n");
}

void tell_without_memory(std::string_view line) {
  if (is_on_terminal) write_text(people, "\r\033[K");
  write_text(people, line);
}

void catch_interrupts() {
  struct sigaction action {};
  action.sa_handler = on_interrupt;
  ::sigemptyset(&action.sa_mask);
  action.sa_flags = SA_RESTART;  // a write that is under way is finished
  ::sigaction(SIGINT, &action, nullptr);
  ::sigaction(SIGTERM, &action, nullptr);
  action.sa_handler = on_failed_write;
  ::sigaction(SIGPIPE, &action, nullptr);  // stdout has no reader any more
  ::sigaction(SIGXFSZ, &action, nullptr);  // a file beyond the size that this process may write
}

StopsAtOnce::StopsAtOnce() {
  struct sigaction action {};
  action.sa_handler = on_patience_end;
  ::sigemptyset(&action.sa_mask);
  action.sa_flags = SA_RESTART;
  ::sigaction(SIGALRM, &action, nullptr);
  sigevent event{};
  event.sigev_notify = SIGEV_SIGNAL;
  event.sigev_signo = SIGALRM;
  has_nothing_written = true;
  has_patience = ::timer_create(CLOCK_MONOTONIC, &event, &patience) == 0;
}

StopsAtOnce::~StopsAtOnce() {
  has_nothing_written = false;
  if (has_patience.exchange(false)) ::timer_delete(patience);
}

void begin_writing() { has_nothing_written = false; }

void hold_standard_streams() {
  for (const int stream : {STDIN_FILENO, STDOUT_FILENO, STDERR_FILENO}) {
    if (::fcntl(stream, F_GETFD) >= 0) continue;
    const bool is_stdout = stream == STDOUT_FILENO;  // what is written there is lost: it shall be noticed
    [[maybe_unused]] const int lowest = ::open("/dev/null", is_stdout ? O_RDONLY : O_RDWR);
  }
}

int interrupting_signal() { return stop_signal.load(); }

void forget_interrupt() { stop_signal = 0; }

std::string one_line(std::string_view text) {
  std::string line;
  for (const char c : text) {
    const bool is_space = static_cast<unsigned char>(c) <= 0x20U || c == 0x7f;
    if (is_space && (line.empty() || line.back() == ' ')) continue;
    line += is_space ? ' ' : c;
  }
  while (!line.empty() && line.back() == ' ') line.pop_back();
  return line;
}

}  // namespace alidade::cli
