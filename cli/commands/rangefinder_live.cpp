#include "cli/commands/rangefinder_live.h"

#include <fmt/format.h>

#include <CLI/CLI.hpp>
#include <cmath>
#include <nlohmann/json.hpp>
#include <opencv2/core.hpp>

#include "alidade/live/capture/shot_session.h"
#include "cli/app/terminal.h"
#include "cli/commands/guide_page.h"

namespace alidade::cli {
namespace {

using Json = nlohmann::ordered_json;

std::string json_text(const Json& json) { return json.dump(-1, ' ', false, Json::error_handler_t::replace); }

double three_sigma_mm(double sigma_m) { return 3e3 * sigma_m; }

/// A figure for the page; null where there is none yet.
Json figure(double value) { return std::isfinite(value) ? Json(value) : Json(nullptr); }

/// Shots of a rangefinder as a page guides to them.
class ShotsWork : public GuidedWork {
 public:
  ShotsWork(const Camera& camera, const Board& board, live::ShotSession& session, double until_mm)
      : camera_(camera), board_(board), session_(session), until_mm_(until_mm) {}

  [[nodiscard]] std::string about() const override {
    return json_text(
        {{"kind", "shots"}, {"board", {{"cols", board_.cols}, {"rows", board_.rows}}}, {"until", until_mm_}});
  }
  [[nodiscard]] double begin_s() const override { return session_.begin_s(); }
  [[nodiscard]] bool has_goal() const override {
    return until_mm_ > 0.0 && session_.state().has_beam && session_.state().verdict.ok() &&
           three_sigma_mm(session_.state().sigma_origin_m) <= until_mm_;
  }

  void see(const cv::Mat& grey, double, bool is_exact, GuidePage& page) override {
    const QuickLook seen = session_.look(grey);
    std::vector<Eigen::Vector2d> corners;
    for (const Corner& corner : seen.view.corners) corners.push_back(corner.px);
    const std::string words = seen.found() ? "hold it still, and enter the reading"
                              : seen.other_grid.first > 0
                                  ? fmt::format("a board of {}×{} corners is in view, not of {}×{}",
                                                seen.other_grid.first, seen.other_grid.second, board_.cols, board_.rows)
                                  : "no board in view";
    page.tell(json_text({{"op", "look"},
                         {"sight", seen.found() ? "board" : "nothing"},
                         {"words", words},
                         {"words_mirrored", words},
                         {"corners", Json::parse(flat_pixels(corners))},
                         {"width", grey.cols},
                         {"height", grey.rows},
                         {"exact", is_exact}}));
  }

  void obey(const live::PageCommand& command, const cv::Mat& newest, double t_s, bool is_exact,
            GuidePage& page) override {
    if (command.op == "undo" && session_.undo()) page.note("the last shot is forgotten");
    if (command.op == "take") {
      const std::string reason = !command.value   ? "enter the rangefinder's reading first"
                                 : newest.empty() ? "there is no image yet"
                                                  : session_.take(newest, t_s, is_exact, *command.value);
      if (!reason.empty()) {
        page.note("not taken: " + reason);
      } else {
        page.tell(json_text({{"op", "took"}, {"file", session_.kept().photos().back().file}}));
        tell_person(fmt::format("shot {}: {:.4g} m, {}", session_.state().shots, *command.value, words_so_far()));
      }
    }
    tell_state(page);
    if (has_goal()) page.end();
  }

  void tell_state(GuidePage& page) override {
    const ShotGuideState& state = session_.state();
    Json history = Json::array();
    for (const double sigma_m : session_.history_m()) history.push_back(figure(three_sigma_mm(sigma_m)));
    Json json{{"op", "state"},
              {"photos", state.shots},
              {"last", session_.kept().photos().empty() ? "" : session_.kept().photos().back().file},
              {"paused", false},
              {"has_camera", state.has_beam},
              {"until", until_mm_},
              {"worst", state.has_beam ? figure(three_sigma_mm(state.sigma_origin_m)) : Json(nullptr)},
              {"worst_px", Json::array()},
              {"needed", nullptr},
              {"warnings", Json::array()},
              {"sentence", state.shots > 0 ? state.verdict.sentence : ""},
              {"width", camera_.width_px},
              {"height", camera_.height_px},
              {"sigma", nullptr},
              {"history", std::move(history)}};
    json["next"] = {{"outline", Json::parse(flat_pixels(state.outline_px))},
                    {"words", state.words},
                    {"words_mirrored", mirrored(state.words)}};
    page.tell(json_text(json), "state");
  }

 private:
  [[nodiscard]] std::string words_so_far() const {
    const ShotGuideState& state = session_.state();
    return state.has_beam
               ? fmt::format("3σ of the origin {:.2g} mm; next: {}", three_sigma_mm(state.sigma_origin_m), state.words)
               : "no beam yet; next: " + state.words;
  }
  /// Where the image is shown mirrored, left and right are exchanged.
  static std::string mirrored(std::string words) {
    const std::size_t left = words.find("left"), right = words.find("right");
    if (left != std::string::npos) words.replace(left, 4, "right");
    if (right != std::string::npos) words.replace(right, 5, "left");
    return words;
  }

  const Camera& camera_;
  const Board& board_;
  live::ShotSession& session_;
  double until_mm_;
};

}  // namespace

void add_guided_shots_options(CLI::App& command, GuidedShotsArgs& args) {
  add_guide_options(command, args.live,
                    "Take the shots now, with guidance: hold the board as outlined and enter each reading",
                    "Guided shots");
}

FieldList fields_of(GuidedShotsArgs& args) {
  FieldList fields{
      {.name = "from",
       .value = &args.from,
       .help = "Images for --live from a folder that another program writes to, or from v4l2:/dev/video0, rtsp://… or "
               "http://…, instead of the browser's camera",
       .form = "DIR|ADDRESS"},
      {.name = "until_mm",
       .value = &args.until_mm,
       .help = "Goal of --live: 3σ of the beam's origin [mm]; capture stops when it is reached (0: stop by hand)",
       .limits = {0.0, 1e4},
       .option = "--until-mm"},
      {.name = "resume", .value = &args.resume, .help = "Continue with the shots of an earlier --live", .form = "DIR"}};
  for (Field& field : alidade::fields_of(args.where)) {
    if (field.name == "shots") continue;
    field.help += ", in guided shots";
    fields.push_back(std::move(field));
  }
  for (Field& field : fields) field.group = "Guided shots";
  return fields;
}

void require_no_guided_shots(const GuidedShotsArgs& args) {
  require_no_guide(
      args.live,
      {{"--from", !args.from.empty()}, {"--resume", !args.resume.empty()}, {"--until-mm", args.until_mm > 0.0}});
}

ExitCode rangefinder_live(const Camera& camera, const RangefinderConfig& config, GuidedShotsArgs args, Run& run,
                          const std::function<ExitCode(const std::filesystem::path& shots)>& finish) {
  if (!config.board) throw UsageError("--live needs --board and --square");
  if (config.method == RangefinderMethod::spot) throw UsageError("--live looks for a board: --method joint or plane");
  (void)server_config(args.live);  // its faults before any work
  if (!args.resume.empty() && !run.options.out_is_given) run.options.out = args.resume;
  std::error_code ignored;
  if (!args.resume.empty() && !std::filesystem::equivalent(args.resume, run.options.out, ignored))
    throw UsageError("--resume continues in its own folder: omit --out");
  ImageSource source = opened_source(args.from);
  RangefinderConfig quick = config;
  quick.rates_next_shots = false;  // a map for the report
  live::ShotSession session(camera, quick, args.where, live::KeptPhotos(run.options.out, !args.resume.empty()));
  ShotsWork work(camera, *config.board, session, args.until_mm);
  GuidePage page(args.live, std::move(source), work, run);
  page.guide();
  throw_if_terminated(session.kept());
  forget_interrupt();
  run.lap("shots");
  if (session.state().shots == 0) throw InputError("no shot was taken: there is nothing to calibrate");
  const ExitCode code = finish(session.table());
  page.show_result(code);
  return code;
}

}  // namespace alidade::cli
