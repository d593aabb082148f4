#include "cli/commands/localize_live.h"

#include <chrono>
#include <iostream>
#include <opencv2/core.hpp>
#include <set>
#include <thread>

#include "alidade/detect/image_sequence.h"
#include "alidade/live/foxglove.h"
#include "alidade/results/localize_outcome.h"
#include "alidade/tables/logs/observations_stream.h"
#include "cli/app/standard_input.h"
#include "cli/app/terminal.h"

namespace alidade::cli {
namespace {

/// What there is to say of rows that a user has already read: on stderr, and to those who watch.
class RowsVerdict {
 public:
  explicit RowsVerdict(const FrameByFrame& given) : server_(given.server), is_up_to_scale_(given.is_up_to_scale) {}

  /// Of how many frames this is, or all: an input that cannot be read has one line, which says why.
  void say_scale(std::size_t count, bool is_all = false) {
    constexpr std::size_t readable = 100;
    if (!is_up_to_scale_ || count == 0 || (count < readable && !is_all)) return;
    is_up_to_scale_ = false;  // said
    say(0.0, "rows are up to scale, in the first camera's frame: metres, if any, at the end");
  }

  /// Each kind of thing once: rows of a wrong lens stay off where they fit each other again.
  void take(const Verdict& recent, const ObservationFrame& last) {
    std::string texts;
    const auto add = [&](const std::string& name, const std::string& text) {
      if (said_.insert(name).second) texts += (texts.empty() ? "" : "; ") + text;
    };
    if (recent.checks.empty()) add("none", recent.sentence);
    for (const Check& check : recent.checks)
      if (check.state != State::good) add(check.name, check.text);
    if (!texts.empty())
      say(last.t_s, "rows to frame " + std::to_string(last.frame) + ", by the filter alone: " + texts);
  }

 private:
  void say(double t_s, const std::string& line) const {
    tell_person("alidade: " + line);
    const auto t_ns = static_cast<std::int64_t>(t_s * 1e9);
    if (server_ != nullptr)
      server_->send("/log", t_ns,
                    [t_ns, line] { return live::log_text(t_ns, live::LogLevel::warning, "localize", line); });
  }

  live::Server* server_;
  bool is_up_to_scale_;
  std::set<std::string> said_;  ///< Names of checks.
};

/// Prints poses as they come, as poses.csv has them.
class PoseRows {
 public:
  explicit PoseRows(const Run& run) : shows_(!run.options.json && !run.options.quiet) {
    if (shows_) std::cout << header_ << std::flush;
  }
  void print(const PathStep& step) const {
    if (shows_) std::cout << poses_csv({&step, 1}).substr(header_.size()) << std::flush;
  }

 private:
  bool shows_;
  std::string header_ = poses_csv({});
};

/// Until when more images of a folder are waited for: so long after the last one.
class FolderWait {
 public:
  FolderWait(double wait_s, const Progress& progress) : wait_s_(wait_s), progress_(progress) {}

  void came() {
    ++count_;
    came_at_ = Clock::now();
    report();
  }
  /// Waits a little. False: it has been long enough. Throws Interrupted after Ctrl-C.
  [[nodiscard]] bool more() const {
    report();
    if (std::chrono::duration<double>(Clock::now() - came_at_).count() > wait_s_) return false;
    std::this_thread::sleep_for(std::chrono::milliseconds(20));
    return true;
  }

 private:
  using Clock = std::chrono::steady_clock;
  void report() const { report_progress(progress_, "images", count_, 0); }

  double wait_s_;
  const Progress& progress_;
  std::size_t count_ = 0;
  Clock::time_point came_at_ = Clock::now();
};

}  // namespace

Localization localize_input(const ObservationsOptions& reading, const FrameByFrame& given) {
  constexpr std::size_t vague = 100, judged_every = 300;  // frames; depths are while they are few
  StandardInput input;                                    // Ctrl-C ends waiting for a row
  ObservationsStream frames(input, "-", reading);
  Localizer localizer(given.camera, given.config);
  const PoseRows rows(given.run);
  RowsVerdict said(given);
  std::size_t count = 0;
  while (const std::optional<ObservationFrame> frame = frames.next()) {
    report_progress(given.progress, "frames", ++count, 0);
    rows.print(localizer.push(*frame));
    said.say_scale(count);
    if (count == vague) static_cast<void>(localizer.recent());
    if (count % judged_every == 0) said.take(localizer.recent(), *frame);
  }
  report_progress(given.progress, "frames", count, 0);  // the input may have ended by Ctrl-C
  said.say_scale(count, true);
  given.run.lap("read");
  Localization result = localizer.finish(given.truth);
  result.counts.given += frames.skipped().size();
  result.counts.skipped = frames.skipped();
  return result;
}

Localization localize_growing(const std::filesystem::path& folder, double rate_hz, double wait_s,
                              const FrameByFrame& given) {
  FolderWait wait(wait_s, given.progress);
  const ImageStream images = images_in(folder, given.camera, rate_hz, [&wait] { return wait.more(); });
  Localizer localizer(given.camera, given.config);
  const PoseRows rows(given.run);
  RowsVerdict said(given);  // of images no more than whether rows are up to scale
  std::size_t count = 0;
  cv::Mat grey;
  long frame = 0;
  double t_s = 0.0;
  while (images.next(grey, frame, t_s)) {
    wait.came();
    rows.print(localizer.push(grey, frame, t_s));
    said.say_scale(++count);
  }
  said.say_scale(count, true);
  given.run.lap("read");
  return localizer.finish(given.truth);
}

}  // namespace alidade::cli
