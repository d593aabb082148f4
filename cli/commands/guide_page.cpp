#include "cli/commands/guide_page.h"

#include <fmt/format.h>

#include <CLI/CLI.hpp>
#include <chrono>
#include <cmath>
#include <csignal>
#include <mutex>
#include <nlohmann/json.hpp>
#include <opencv2/core.hpp>

#include "alidade/images/photos.h"
#include "alidade/images/video_process.h"
#include "alidade/imaging/grey_photo.h"
#include "alidade/live/capture/growing_folder.h"
#include "alidade/live/capture/newest_frame.h"
#include "alidade/report/page.h"
#include "cli/app/terminal.h"

namespace alidade::cli {
namespace {

using Json = nlohmann::ordered_json;
using Clock = std::chrono::steady_clock;
constexpr int preview_width_px = 640;
constexpr auto between_previews = std::chrono::milliseconds(150);

std::string dumped(const Json& json) { return json.dump(-1, ' ', false, Json::error_handler_t::replace); }

}  // namespace

ImageSource opened_source(const std::string& from) {
  if (from.empty()) return {};
  if (is_stream_address(from)) return {nullptr, std::make_shared<live::NewestFrame>(from)};
  return {std::make_shared<live::GrowingFolder>(from), nullptr};
}

cv::Mat grey_of(const live::LiveFrame& frame) {
  return cv::Mat(frame.height_px, frame.width_px, CV_8U, const_cast<unsigned char*>(frame.grey.data())).clone();
}

void require_no_guide(const LiveOptions& live, std::initializer_list<std::pair<const char*, bool>> given) {
  const auto refuse = [](const char* option) { throw UsageError(std::string(option) + ": only with --live"); };
  for (const auto& [option, is_given] : given)
    if (is_given) refuse(option);
  if (!live.address.empty()) refuse("--live-address");
}

void add_guide_options(CLI::App& command, LiveOptions& live, const std::string& help, const std::string& group) {
  command
      .add_option_function<std::string>(
          "--live",
          [&live](const std::string& port) {
            live.is_on = true;
            live.port = port;
          },
          help + "; web page with the live image on this port; 0: any free port (default: 8765)")
      ->type_name("[PORT]")
      ->expected(0, 1)
      ->group(group);
  command.add_option("--live-address", live.address, "Listen on this address instead of 127.0.0.1")
      ->type_name("IP")
      ->group(group);
}

std::string flat_pixels(const std::vector<Eigen::Vector2d>& pixels) {
  Json list = Json::array();
  for (const Eigen::Vector2d& px : pixels) {
    list.push_back(std::round(100.0 * px.x()) / 100.0);
    list.push_back(std::round(100.0 * px.y()) / 100.0);
  }
  return list.dump();
}

struct GuidePage::State {
  State(GuidePage& of_page, ImageSource from, GuidedWork& of_work, Run& of_run)
      : page(of_page), source(std::move(from)), work(of_work), run(of_run) {}

  GuidePage& page;
  ImageSource source;
  GuidedWork& work;
  Run& run;
  std::mutex mutex;
  std::string result, report;  ///< Empty until there is one.
  Clock::time_point begin = Clock::now(), shown_at{};
  bool is_over = false;
  const uchar* shown = nullptr;  ///< The image that the page shows.
  cv::Mat newest;
  bool newest_is_exact = false;
  std::unique_ptr<live::CaptureServer> server;  // last: its thread uses the others

  [[nodiscard]] double now_s() const {
    return work.begin_s() + std::chrono::duration<double>(Clock::now() - begin).count();
  }
  [[nodiscard]] bool goes_on() const { return !is_over && interrupting_signal() == 0; }
  [[nodiscard]] live::HttpAnswer answer(std::string_view path);
  [[nodiscard]] std::string document_so_far() const;
  void obey_all();
  void see(const cv::Mat& grey, bool is_exact);
  void see_file(const std::filesystem::path& file);
  void show(const cv::Mat& grey, bool also_control);
  void guide_by_folder();
  void guide_by_stream();
  void guide_by_browser();
};

live::HttpAnswer GuidePage::State::answer(std::string_view path) {
  const std::scoped_lock lock(mutex);
  if (path == "/") return {200, "text/html; charset=utf-8", report_page(document_so_far(), {})};
  if (path == "/result.json")
    return result.empty() ? live::HttpAnswer{} : live::HttpAnswer{200, "application/json", result};
  if (path == "/report.html" && !report.empty()) return {200, "text/html; charset=utf-8", report};
  if (path == "/favicon.ico") return {204, "image/x-icon", ""};
  return {};
}

std::string GuidePage::State::document_so_far() const {
  Json about = Json::parse(work.about());
  about["source"] = source.folder || source.stream ? "machine" : "browser";
  return dumped({{"schema", "alidade-result/1"},
                 {"command", run.document.command},
                 {"version", ALIDADE_VERSION},
                 {"argv", run.document.argv},
                 {"created_utc", run.document.created_utc},
                 {"live", true},
                 {"capture", std::move(about)},
                 {"verdict",
                  {{"state", "running"},
                   {"exit_code", nullptr},
                   {"sentence", "Photos are being taken"},
                   {"to_add", nullptr},
                   {"checks", Json::array()}}},
                 {"data", Json::object()}}) +
         "\n";
}

void GuidePage::State::obey_all() {
  for (const live::PageCommand& command : server->commands()) {
    if (command.op == "end") is_over = true;
    work.obey(command, newest, now_s(), newest_is_exact, page);
  }
}

void GuidePage::State::show(const cv::Mat& grey, bool also_control) {
  const std::size_t num_watching = server->num_clients();
  if (num_watching < (also_control ? 1u : 2u) || Clock::now() - shown_at < between_previews) return;
  shown_at = Clock::now();
  shown = grey.data;
  server->show(jpeg_preview(grey, preview_width_px), also_control);
}

void GuidePage::State::see(const cv::Mat& grey, bool is_exact) {
  newest = grey;
  newest_is_exact = is_exact;
  work.see(grey, now_s(), is_exact, page);
}

void GuidePage::State::guide_by_browser() {
  while (goes_on()) {
    const std::optional<live::SentImage> sent = server->wait_for_image(std::chrono::milliseconds(100));
    obey_all();
    if (!sent || is_over) continue;
    const cv::Mat grey = cv::Mat(sent->height_px, sent->width_px, CV_8U, const_cast<char*>(sent->grey.data())).clone();
    see(grey, sent->is_exact);
    show(grey, false);
  }
}

void GuidePage::State::see_file(const std::filesystem::path& file) {
  try {
    const cv::Mat grey = one_channel(decode_photo(read_file(file)));
    if (grey.depth() != CV_8U) throw InputError("only 8-bit images are shown live");
    see(grey, true);
    show(grey, true);
  } catch (const InputError& error) {
    if (!source.folder->put_back(file)) page.note(file.filename().string() + ": " + error.what());
  }
}

void GuidePage::State::guide_by_folder() {
  while (goes_on()) {
    const std::vector<std::filesystem::path> files = source.folder->newcomers();
    for (const std::filesystem::path& file : files) {
      if (!goes_on()) break;
      see_file(file);
      obey_all();
    }
    if (files.empty()) {
      (void)server->wait_for_image(std::chrono::milliseconds(50));
      work.wait(now_s(), page);
      if (!newest.empty() && shown != newest.data) show(newest, true);
    }
    obey_all();
  }
}

void GuidePage::State::guide_by_stream() {
  bool is_said = false;
  while (goes_on()) {
    const std::optional<live::LiveFrame> frame = source.stream->fetch();
    obey_all();
    if (!frame) {
      if (source.stream->is_over() && !std::exchange(is_said, true)) {
        page.note("the stream has ended");
        return;
      }
      (void)server->wait_for_image(std::chrono::milliseconds(5));
      continue;
    }
    const cv::Mat grey = grey_of(*frame);
    see(grey, false);
    show(grey, true);
  }
}

GuidePage::GuidePage(const LiveOptions& options, ImageSource source, GuidedWork& work, Run& run)
    : state_(std::make_unique<State>(*this, std::move(source), work, run)) {
  const live::ServerConfig wanted = server_config(options);
  State& state = *state_;
  state.server = std::make_unique<live::CaptureServer>(live::CaptureServerConfig{
      wanted.address, wanted.port, [&state](std::string_view path) { return state.answer(path); }});
  work.tell_state(*this);
  tell_person("live: " + state.server->url());
}

GuidePage::~GuidePage() = default;

void GuidePage::guide() {
  State& state = *state_;
  if (state.source.stream) {
    state.guide_by_stream();
  } else if (state.source.folder) {
    state.guide_by_folder();
  } else {
    state.guide_by_browser();
  }
  tell(dumped({{"op", "goal"}, {"holds", state.work.has_goal()}}), "goal");
}

void GuidePage::end() { state_->is_over = true; }

void GuidePage::tell(const std::string& json, const std::string& kind) { state_->server->tell(json, kind); }

void GuidePage::note(const std::string& line) { tell(dumped({{"op", "note"}, {"words", line}}), "note"); }

void GuidePage::show_result(ExitCode code) {
  State& state = *state_;
  {
    const std::scoped_lock lock(state.mutex);
    state.result = state.run.result();
    const std::filesystem::path report = state.run.report();
    if (!report.empty()) state.report = read_file(report);
  }
  tell(dumped({{"op", "ended"}, {"exit_code", static_cast<int>(code)}, {"report", !state.report.empty()}}), "ended");
  constexpr double max_s = 8.0;  // for a browser on a busy machine to fetch the report
  state.server->finish(max_s);
}

void throw_if_terminated(const live::KeptPhotos& kept) {
  if (interrupting_signal() != SIGTERM && interrupting_signal() != SIGHUP) return;
  if (kept.photos().empty()) throw Interrupted();
  const std::size_t num = kept.photos().size();
  throw Interrupted(fmt::format("interrupted; {} {} in {}: go on with --resume {}", num,
                                num == 1 ? "photo is" : "photos are", kept.folder().string(),
                                kept.folder().parent_path().string()));
}

}  // namespace alidade::cli
