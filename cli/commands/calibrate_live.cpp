#include "cli/commands/calibrate_live.h"

#include <fmt/format.h>

#include <CLI/CLI.hpp>
#include <algorithm>
#include <chrono>
#include <opencv2/core.hpp>
#include <thread>
#include <utility>

#include "alidade/calibrate.h"
#include "alidade/images/photos.h"
#include "alidade/images/video_process.h"
#include "alidade/imaging/grey_photo.h"
#include "alidade/live/capture/capture_session.h"
#include "alidade/live/capture/growing_folder.h"
#include "alidade/live/capture/newest_frame.h"
#include "alidade/results/calibration_outcome.h"
#include "cli/app/terminal.h"
#include "cli/commands/capture_page.h"

namespace alidade::cli {
namespace {

using Clock = std::chrono::steady_clock;

constexpr double looks_a_second = 5.0;  // of a folder that is full already: time as a camera's would pass

double passed_s(Clock::time_point begin) { return std::chrono::duration<double>(Clock::now() - begin).count(); }

/// A photo as a capture keeps it, 8-bit grey; `is_exact`: nothing of what calibrate reads of it is lost.
cv::Mat kept_grey(const cv::Mat& photo, bool& is_exact) {
  const cv::Mat grey = one_channel(photo);
  is_exact = grey.depth() == CV_8U;
  if (is_exact) return grey;
  std::string reason;
  cv::Mat values = to_grey_photo(grey, reason), bytes;
  if (!reason.empty()) throw InputError(reason);
  values.convertTo(bytes, CV_8U);
  return bytes;
}

std::string progress_line(const live::CaptureSession& session, double goal_px) {
  const CaptureState& state = session.state();
  const std::string& file = session.kept().photos().back().file;
  std::string line = fmt::format("photo {}: {}", state.photos, file);
  if (state.has_camera)
    line += fmt::format(", 3σ {:.2g} px at the worst pixel, goal {:.2g}", state.worst_3sigma_px, goal_px);
  if (state.is_at(goal_px)) return line;
  if (state.photos_to_goal) {
    constexpr int countable = 200;
    line +=
        *state.photos_to_goal > countable ? ", hundreds more" : fmt::format(", about {} more", *state.photos_to_goal);
  }
  if (state.next) line += "; next: " + state.next->words;
  return line;
}

/// A capture from a folder that another program fills, without a page.
class FolderCapture {
 public:
  FolderCapture(live::CaptureSession& session, live::GrowingFolder& folder, const CaptureArgs& args, Run& run)
      : session_(session), folder_(folder), goal_px_(args.config.until_px), wait_s_(args.wait_s), run_(run) {}

  /// Until the goal is reached, the user ends it, or nothing new has come for too long: then of what came the photos
  /// are taken that still bring something.
  void run() {
    came_at_ = Clock::now();
    while (!is_over()) {
      const std::vector<std::filesystem::path> files = folder_.newcomers();
      for (const std::filesystem::path& file : files) {
        see(file);
        if (is_over()) return;
      }
      if (passed_s(came_at_) > wait_s_) return take_the_rest();
      std::this_thread::sleep_for(std::chrono::milliseconds(50));
    }
  }
  [[nodiscard]] const std::string& last_words() const { return last_words_; }

 private:
  [[nodiscard]] bool is_over() const { return has_goal_ || interrupting_signal() != 0; }

  void see(const std::filesystem::path& file, bool is_again = false) {
    cv::Mat grey;
    bool is_exact = false;
    try {
      grey = kept_grey(decode_photo(read_file(file)), is_exact);
    } catch (const InputError& error) {
      if (!folder_.put_back(file)) tell_person("alidade: " + file.filename().string() + ": " + error.what());
      return;
    }
    came_at_ = Clock::now();
    const double t_s = std::max(session_.begin_s() + static_cast<double>(++num_seen_) / looks_a_second,
                                session_.begin_s() + passed_s(begin_));
    const live::CaptureSession::Seen seen = session_.see(grey, t_s, is_exact, is_again);
    const bool is_taken = !seen.file.empty() && !seen.look.earlier;
    if (!seen.look.corners_px.empty() && !is_taken) left_.push_back({file, seen.look.gain});
    if (seen.look.corners_px.empty()) last_words_ = seen.look.words;
    after(seen.file, is_taken ? " (" + file.filename().string() + ")" : "");
  }

  void after(const std::string& kept, const std::string& from) {
    if (kept.empty()) return;
    if (!run_.options.quiet && !run_.options.json) tell_person(progress_line(session_, goal_px_) + from);
    has_goal_ = session_.reached_goal({});
  }

  /// The remaining ones, the most informative first; repeated as long as a round gains something.
  void take_the_rest() {
    session_.guide().accept_any_useful(true);
    for (bool has_kept = true; has_kept && !is_over();) {
      std::vector<Left> round = std::exchange(left_, {});
      std::ranges::stable_sort(round, std::ranges::greater{}, &Left::gain);
      const std::size_t num_kept = session_.kept().photos().size();
      for (const Left& each : round) {
        if (!is_over()) see(each.file, true);
      }
      has_kept = session_.kept().photos().size() > num_kept;
    }
  }

  struct Left {
    std::filesystem::path file;
    double gain = 0.0;
  };
  live::CaptureSession& session_;
  live::GrowingFolder& folder_;
  double goal_px_, wait_s_;
  Run& run_;
  Clock::time_point begin_ = Clock::now(), came_at_ = begin_;
  std::vector<Left> left_;  ///< With a board, and not kept.
  int num_seen_ = 0;
  bool has_goal_ = false;
  std::string last_words_;
};

/// What was shown and not taken while better might come, the most informative first: nothing comes any more.
void take_what_was_shown(live::CaptureSession& session, double t_s) {
  session.guide().accept_any_useful(true);
  while (interrupting_signal() == 0 && !session.look_back(t_s).file.empty())
    if (session.reached_goal({})) return;
}

/// A capture from a camera of the machine or the network, without a page.
void capture_stream(live::CaptureSession& session, live::NewestFrame& stream, const CaptureArgs& args, Run& run) {
  const Clock::time_point begin = Clock::now();
  while (!stream.is_over() && interrupting_signal() == 0) {
    const std::optional<live::LiveFrame> frame = stream.fetch();
    if (!frame) {
      std::this_thread::sleep_for(std::chrono::milliseconds(5));
      continue;
    }
    const cv::Mat grey = grey_of(*frame);
    if (session.see(grey, session.begin_s() + passed_s(begin), false).file.empty()) continue;
    if (!run.options.quiet && !run.options.json) tell_person(progress_line(session, args.config.until_px));
    if (session.reached_goal({})) return;
  }
  if (!stream.is_over()) return;
  tell_person("alidade: the stream has ended");
  take_what_was_shown(session, session.begin_s() + passed_s(begin));
}

/// Where the photos stand, those of an earlier capture included.
live::KeptPhotos opened_photos(const CaptureArgs& args, Run& run) {
  const bool goes_on = !args.resume.empty();
  std::error_code ignored;
  const std::filesystem::path& out = run.options.out;
  if (goes_on && !std::filesystem::equivalent(args.resume, out, ignored)) {
    const live::KeptPhotos earlier(args.resume, true);
    if (std::filesystem::exists(out / "photos", ignored))
      throw InputError(out.string() + ": has photos already; --resume takes those of " + args.resume);
    for (const live::KeptPhoto& photo : earlier.photos())
      write_file(out / "photos" / photo.file, read_file(earlier.path_of(photo)));
    write_file(out / "photos.csv", read_file(std::filesystem::path(args.resume) / "photos.csv"));
  }
  return live::KeptPhotos(out, goes_on);
}

/// The result of a capture that kept nothing: as calibrate has it of no photos, with what was seen instead.
ExitCode finish_empty(const Board& board, const CaptureArgs& args, const std::string& seen, Run& run) {
  Calibration none = alidade::calibrate(Photos{}, board, args.config.calibrate);
  if (!seen.empty()) none.verdict.sentence = "no photo was kept: " + seen;
  return run.finish(outcome_of(none));
}

/// A camera may be good and yet short of the requested goal.
void tell_missed_goal(const live::CaptureSession& session, double goal_px, const Run& run) {
  const CaptureState& state = session.state();
  if (session.kept().photos().empty() || state.is_at(goal_px)) return;
  const std::string now = state.has_camera ? fmt::format("3σ is {:.2g} px at the worst pixel", state.worst_3sigma_px)
                                           : "there is no camera yet";
  tell_person(fmt::format("alidade: the goal of {:.2g} px is not reached, {}; go on with --resume {}", goal_px, now,
                          run.options.out.string()));
}

}  // namespace

void add_capture_options(CLI::App& command, CaptureArgs& args) {
  add_guide_options(command, args.live, "Capture the photos now, with guidance", "Guided capture");
}

FieldList fields_of(CaptureArgs& args) {
  FieldList fields{{.name = "from",
                    .value = &args.from,
                    .help = "Images for --live from a folder that another program writes to, or from v4l2:/dev/video0, "
                            "rtsp://… or http://…, instead of the browser's camera",
                    .form = "DIR|ADDRESS"},
                   {.name = "no_page", .value = &args.no_page, .help = "With --live --from: no web page, for scripts"},
                   {.name = "wait_s",
                    .value = &args.wait_s,
                    .help = "With --no-page: stop when no new image has arrived for this long [s]",
                    .limits = {0.1, 1e6}},
                   {.name = "resume",
                    .value = &args.resume,
                    .help = "Continue with the photos of an earlier --live",
                    .form = "DIR"}};
  for (Field& field : alidade::fields_of(args.config)) {
    auto& code = std::get<TextCode>(field.value);
    code.read = [&args, read = code.read](const std::string& text) {
      args.until_is_given = true;
      return read(text);
    };
    fields.push_back(std::move(field));
  }
  for (Field& field : fields) field.group = "Guided capture";
  return fields;
}

void require_no_capture(const CaptureArgs& args) {
  require_no_guide(args.live, {{"--from", !args.from.empty()},
                               {"--no-page", args.no_page},
                               {"--resume", !args.resume.empty()},
                               {"--until", args.until_is_given}});
}

/// Faults of what was asked for, before any work; the photos' folder.
void prepare(CaptureArgs& args, Run& run) {
  if (args.no_page && args.from.empty())
    throw UsageError("--no-page: only with --from, as there is no camera without a page");
  (void)server_config(args.live);
  if (!args.resume.empty() && !run.options.out_is_given) run.options.out = args.resume;
  args.config.is_video = args.from.empty() || is_stream_address(args.from);
}

ExitCode calibrate_live(
    const Board& board, CaptureArgs args, Run& run,
    const std::function<ExitCode(const std::filesystem::path& photos, std::size_t num_inexact)>& finish) {
  prepare(args, run);
  const ImageSource source = opened_source(args.from);  // an address may be wrong: before anything is written
  std::optional<CaptureWork> work;
  std::optional<GuidePage> page;
  live::CaptureSession session(board, args.config, opened_photos(args, run), [&page](const std::string& line) {
    tell_person("alidade: " + line);
    if (page) page->note(line);
  });
  std::string seen;
  if (args.no_page) {
    if (source.stream) {
      capture_stream(session, *source.stream, args, run);
    } else {
      FolderCapture capture(session, *source.folder, args, run);
      capture.run();
      seen = capture.last_words();
    }
  } else {
    work.emplace(board, session, args.config.until_px);
    page.emplace(args.live, source, *work, run);
    page->guide();
    seen = work->last_words();
  }
  const std::filesystem::path photos = session.kept().folder();
  const std::vector<live::KeptPhoto>& kept = session.kept().photos();
  throw_if_terminated(session.kept());
  forget_interrupt();
  run.lap("capture");
  const auto num_inexact = static_cast<std::size_t>(std::ranges::count(kept, false, &live::KeptPhoto::is_exact));
  const ExitCode code = kept.empty() ? finish_empty(board, args, seen, run) : finish(photos, num_inexact);
  if (page) page->show_result(code);
  tell_missed_goal(session, args.config.until_px, run);
  return code;
}

}  // namespace alidade::cli
