#include "cli/commands/capture_page.h"

#include <chrono>
#include <mutex>
#include <nlohmann/json.hpp>
#include <opencv2/core.hpp>

#include "alidade/images/photos.h"
#include "alidade/imaging/grey_photo.h"
#include "alidade/live/capture_server.h"
#include "alidade/live/growing_folder.h"
#include "alidade/live/newest_frame.h"
#include "alidade/report/page.h"
#include "cli/app/live.h"
#include "cli/app/terminal.h"
#include "cli/commands/calibrate_live.h"

namespace alidade::cli {
namespace {

using Json = nlohmann::ordered_json;
using Clock = std::chrono::steady_clock;
constexpr int preview_width_px = 640;
constexpr auto between_previews = std::chrono::milliseconds(150);

std::string dumped_json(const Json& json) { return json.dump(-1, ' ', false, Json::error_handler_t::replace); }

/// Pixels to a hundredth, u and v in turn.
Json flat_pixels(const std::vector<Eigen::Vector2d>& pixels) {
  Json list = Json::array();
  for (const Eigen::Vector2d& px : pixels) {
    list.push_back(std::round(100.0 * px.x()) / 100.0);
    list.push_back(std::round(100.0 * px.y()) / 100.0);
  }
  return list;
}

Json finite(double value) { return std::isfinite(value) ? Json(value) : Json(nullptr); }

Json state_json(const live::CaptureSession& session, double goal_px) {
  const CaptureState& state = session.state();
  Json json{{"op", "state"},
            {"photos", session.kept().photos().size()},
            {"last", session.kept().photos().empty() ? "" : session.kept().photos().back().file},
            {"paused", session.is_paused()},
            {"has_camera", state.has_camera},
            {"until", goal_px},
            {"worst", finite(state.worst_3sigma_px)},
            {"worst_px", flat_pixels({state.worst_px})},
            {"needed", state.photos_to_goal ? Json(*state.photos_to_goal) : Json(nullptr)},
            {"warnings", state.warnings},
            {"width", state.camera.width_px},
            {"height", state.camera.height_px},
            {"next", nullptr},
            {"sigma", nullptr}};
  if (state.next) {
    json["next"] = {{"outline", flat_pixels(state.next->outline_px)},
                    {"words", state.next->words},
                    {"words_mirrored", state.next->words_mirrored}};
  }
  if (state.has_camera) {
    Json values = Json::array();
    for (const double sigma_px : state.sigma.values) values.push_back(finite(std::round(30000.0 * sigma_px) / 10000.0));
    json["sigma"] = {{"cols", state.sigma.cols}, {"rows", state.sigma.rows}, {"three_sigma", std::move(values)}};
  }
  return json;
}

}  // namespace

struct CapturePage::State {
  State(const CaptureArgs& given, CaptureSource from, const Board& of, live::CaptureSession& of_session, Run& of_run)
      : args(given), source(std::move(from)), board(of), session(of_session), run(of_run) {}

  const CaptureArgs& args;
  CaptureSource source;
  const Board& board;
  live::CaptureSession& session;
  Run& run;
  std::mutex mutex;
  std::string result, report;  ///< Empty until there is one.
  Clock::time_point begin = Clock::now(), shown_at{};
  bool is_over = false, is_checking = false;
  cv::Mat newest;
  bool newest_is_exact = false;
  std::string last_words, told_warnings;
  std::unique_ptr<live::CaptureServer> server;  // last: its thread uses the others

  [[nodiscard]] double now_s() const {
    return session.begin_s() + std::chrono::duration<double>(Clock::now() - begin).count();
  }
  [[nodiscard]] live::HttpAnswer answer(std::string_view path);
  [[nodiscard]] std::string document_so_far() const;
  void tell_state() { server->tell(dumped_json(state_json(session, args.config.until_px)), "state"); }
  void tell_note(const std::string& line) { server->tell(dumped_json({{"op", "note"}, {"words", line}}), "note"); }
  void obey(const std::string& command);
  void see(const cv::Mat& grey, bool is_exact);
  void after_taking();
  void show(const cv::Mat& grey, bool also_control);
  void capture_folder();
  void capture_stream();
  void capture_browser();
};

live::HttpAnswer CapturePage::State::answer(std::string_view path) {
  const std::scoped_lock lock(mutex);
  if (path == "/") return {200, "text/html; charset=utf-8", report_page(document_so_far(), {})};
  if (path == "/result.json")
    return result.empty() ? live::HttpAnswer{} : live::HttpAnswer{200, "application/json", result};
  if (path == "/report.html" && !report.empty()) return {200, "text/html; charset=utf-8", report};
  if (path == "/favicon.ico") return {204, "image/x-icon", ""};
  return {};
}

std::string CapturePage::State::document_so_far() const {
  return dumped_json({{"schema", "alidade-result/1"},
                      {"command", run.document.command},
                      {"version", ALIDADE_VERSION},
                      {"argv", run.document.argv},
                      {"created_utc", run.document.created_utc},
                      {"live", true},
                      {"capture",
                       {{"source", args.from.empty() ? "browser" : "machine"},
                        {"board", {{"cols", board.cols}, {"rows", board.rows}}},
                        {"until", args.config.until_px}}},
                      {"verdict",
                       {{"state", "running"},
                        {"exit_code", nullptr},
                        {"sentence", "Photos are being taken"},
                        {"to_add", nullptr},
                        {"checks", Json::array()}}},
                      {"data", Json::object()}}) +
         "\n";
}

void CapturePage::State::obey(const std::string& command) {
  if (command == "end") is_over = true;
  if (command == "pause" || command == "resume") session.pause(command == "pause");
  if (command == "undo" && session.undo()) tell_note("the last photo is forgotten");
  if (command == "take") {
    const std::string reason =
        newest.empty() ? "there is no picture yet" : session.take(newest, now_s(), newest_is_exact);
    if (reason.empty()) return after_taking();
    tell_note("not taken: " + reason);
  }
  tell_state();
}

/// What the photo changed, and whether that is the end.
void CapturePage::State::after_taking() {
  server->tell(dumped_json({{"op", "took"}, {"file", session.kept().photos().back().file}}));
  tell_state();
  if (!session.reached_goal({})) return tell_state();  // its σ may now be that of the whole job
  is_over = true;
}

void CapturePage::State::show(const cv::Mat& grey, bool also_control) {
  const std::size_t num_watching = server->num_clients();
  if (num_watching < (also_control ? 1u : 2u) || Clock::now() - shown_at < between_previews) return;
  shown_at = Clock::now();
  server->show(jpeg_preview(grey, preview_width_px), also_control);
}

void CapturePage::State::see(const cv::Mat& grey, bool is_exact) {
  const auto before = Clock::now();
  newest = grey;
  newest_is_exact = is_exact;
  const live::CaptureSession::Seen seen = session.see(grey, now_s(), is_exact);
  if (seen.look.corners_px.empty()) last_words = seen.look.words;
  server->tell(dumped_json({{"op", "look"},
                            {"sight", sight_name(seen.look.sight)},
                            {"words", seen.look.words},
                            {"words_mirrored", seen.look.words_mirrored},
                            {"corners", flat_pixels(seen.look.corners_px)},
                            {"gain", finite(seen.look.gain)},
                            {"width", grey.cols},
                            {"height", grey.rows},
                            {"exact", is_exact},
                            {"ms", std::chrono::duration<double, std::milli>(Clock::now() - before).count()}}));
  if (!seen.file.empty()) after_taking();
}

void CapturePage::State::capture_browser() {
  while (!is_over && interrupting_signal() == 0) {
    const std::optional<live::SentPicture> sent = server->wait_for_picture(std::chrono::milliseconds(100));
    for (const std::string& command : server->commands()) obey(command);
    if (!sent || is_over) continue;
    const cv::Mat grey = cv::Mat(sent->height_px, sent->width_px, CV_8U, const_cast<char*>(sent->grey.data())).clone();
    see(grey, sent->is_exact);
    show(grey, false);
  }
}

void CapturePage::State::capture_folder() {
  live::GrowingFolder& folder = *source.folder;
  while (!is_over && interrupting_signal() == 0) {
    const std::vector<std::filesystem::path> files = folder.newcomers();
    for (const std::filesystem::path& file : files) {
      if (is_over || interrupting_signal() != 0) break;
      try {
        const cv::Mat photo = decode_photo(read_file(file));
        const cv::Mat grey = one_channel(photo);
        if (grey.depth() != CV_8U) throw InputError("only pictures of 8 bit are shown live");
        see(grey, true);
        show(grey, true);
      } catch (const InputError& error) {
        if (!folder.put_back(file)) tell_note(file.filename().string() + ": " + error.what());
      }
      for (const std::string& command : server->commands()) obey(command);
    }
    if (files.empty()) (void)server->wait_for_picture(std::chrono::milliseconds(50));
    for (const std::string& command : server->commands()) obey(command);
  }
}

void CapturePage::State::capture_stream() {
  live::NewestFrame& stream = *source.stream;
  while (!is_over && !stream.is_over() && interrupting_signal() == 0) {
    const std::optional<live::LiveFrame> frame = stream.fetch();
    for (const std::string& command : server->commands()) obey(command);
    if (!frame) {
      (void)server->wait_for_picture(std::chrono::milliseconds(5));
      continue;
    }
    const cv::Mat grey = grey_of(*frame);
    see(grey, false);
    show(grey, true);
  }
}

CapturePage::CapturePage(const CaptureArgs& args, const CaptureSource& source, const Board& board,
                         live::CaptureSession& session, Run& run)
    : state_(std::make_unique<State>(args, source, board, session, run)) {
  const live::ServerConfig wanted = server_config(args.live);
  State& state = *state_;
  state.server = std::make_unique<live::CaptureServer>(live::CaptureServerConfig{
      wanted.address, wanted.port, [&state](std::string_view path) { return state.answer(path); }});
  state.tell_state();
  tell_person("live: " + state.server->url());
}

CapturePage::~CapturePage() = default;

std::string CapturePage::capture() {
  State& state = *state_;
  if (state.args.from.empty()) {
    state.capture_browser();
  } else if (state.source.stream) {
    state.capture_stream();
  } else {
    state.capture_folder();
  }
  state.server->tell(dumped_json({{"op", "goal"}, {"holds", state.session.state().is_at(state.args.config.until_px)}}),
                     "goal");
  return state.last_words;
}

void CapturePage::note(const std::string& line) { state_->tell_note(line); }

void CapturePage::show_result(ExitCode code) {
  State& state = *state_;
  {
    const std::scoped_lock lock(state.mutex);
    state.result = state.run.result();
    const std::filesystem::path report = state.run.report();
    if (!report.empty()) state.report = read_file(report);
  }
  state.server->tell(
      dumped_json({{"op", "ended"}, {"exit_code", static_cast<int>(code)}, {"report", !state.report.empty()}}),
      "ended");
  constexpr double max_s = 8.0;  // for a browser on a busy machine to fetch the report
  state.server->finish(max_s);
}

}  // namespace alidade::cli
