#include "cli/commands/capture_page.h"

#include <chrono>
#include <cmath>
#include <nlohmann/json.hpp>
#include <opencv2/core.hpp>

namespace alidade::cli {
namespace {

using Json = nlohmann::ordered_json;
using Clock = std::chrono::steady_clock;

std::string dumped_json(const Json& json) { return json.dump(-1, ' ', false, Json::error_handler_t::replace); }

Json pixels_json(const std::vector<Eigen::Vector2d>& pixels) { return Json::parse(flat_pixels(pixels)); }

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
            {"worst_px", pixels_json({state.worst_px})},
            {"needed", state.photos_to_goal ? Json(*state.photos_to_goal) : Json(nullptr)},
            {"warnings", state.warnings},
            {"width", state.camera.width_px},
            {"height", state.camera.height_px},
            {"next", nullptr},
            {"sigma", nullptr}};
  if (state.next) {
    json["next"] = {{"outline", pixels_json(state.next->outline_px)},
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

std::string CaptureWork::about() const {
  return dumped_json({{"board", {{"cols", board_.cols}, {"rows", board_.rows}}}, {"until", goal_px_}});
}

void CaptureWork::tell_state(GuidePage& page) { page.tell(dumped_json(state_json(session_, goal_px_)), "state"); }

/// What the photo changed, and whether that is the end.
void CaptureWork::after_taking(GuidePage& page) {
  page.tell(dumped_json({{"op", "took"}, {"file", session_.kept().photos().back().file}}));
  tell_state(page);
  if (!session_.reached_goal({})) return tell_state(page);  // its σ may now be that of the whole job
  page.end();
}

void CaptureWork::obey(const live::PageCommand& command, const cv::Mat& newest, double t_s, bool is_exact,
                       GuidePage& page) {
  if (command.op == "pause" || command.op == "resume") session_.pause(command.op == "pause");
  if (command.op == "undo" && session_.undo()) page.note("the last photo is forgotten");
  if (command.op == "take") {
    const std::string reason = newest.empty() ? "there is no image yet" : session_.take(newest, t_s, is_exact);
    if (reason.empty()) return after_taking(page);
    page.note("not taken: " + reason);
  }
  tell_state(page);
}

void CaptureWork::wait(double t_s, GuidePage& page) {
  if (!session_.look_back(t_s).file.empty()) after_taking(page);
}

void CaptureWork::see(const cv::Mat& grey, double t_s, bool is_exact, GuidePage& page) {
  const auto before = Clock::now();
  const live::CaptureSession::Seen seen = session_.see(grey, t_s, is_exact);
  if (seen.look.corners_px.empty()) last_words_ = seen.look.words;
  page.tell(dumped_json({{"op", "look"},
                         {"sight", look_status_name(seen.look.status)},
                         {"words", seen.look.words},
                         {"words_mirrored", seen.look.words_mirrored},
                         {"corners", pixels_json(seen.look.corners_px)},
                         {"gain", finite(seen.look.gain)},
                         {"width", grey.cols},
                         {"height", grey.rows},
                         {"exact", is_exact},
                         {"ms", std::chrono::duration<double, std::milli>(Clock::now() - before).count()}}));
  if (!seen.file.empty()) after_taking(page);
}

}  // namespace alidade::cli
