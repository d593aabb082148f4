#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <string>
#include <utility>

#include "alidade/capture.h"
#include "alidade/capture/outline.h"
#include "alidade/capture/pose_words.h"
#include "alidade/geometry/degree.h"
#include "alidade/rig.h"

namespace alidade {
namespace {

std::string words_of_view(const NextView& next, const Camera& camera, const std::vector<Eigen::Vector3d>& points) {
  const std::string look = fmt::format("head {} to pan {:.1f}°, tilt {:.1f}°", next.head,
                                       next.pan_tilt_rad.x() / degree, next.pan_tilt_rad.y() / degree);
  const BoardInImage held = board_in_image(camera, points, next.cam_from_board);
  if (!next.is_new_position)
    return fmt::format("{}: board {} {} of its image", look, next.board, position_words(held.centre));
  return fmt::format("{}, and the board to a new position ({}), {:.1f} m away: {}", look, next.board,
                     next.cam_from_board.translation.norm(), words_of(held, false));
}

/// Each head looks at each position of the board from four sides: fewer do not determine both axes.
std::string words_of_first_views(std::size_t num_views, const std::vector<int>& heads) {
  constexpr std::array<const char*, 4> positions{"in the centre", "in the upper left corner",
                                                 "in the lower right corner", "in the lower left corner"};
  const std::size_t turn = num_views / positions.size();
  const std::size_t board = turn / heads.size() + 1;
  const int head = heads[turn % heads.size()];
  const std::string look = fmt::format("turn head {} until the board is seen {} of its image", head,
                                       positions[num_views % positions.size()]);
  if (num_views % (positions.size() * heads.size()) != 0) return look;
  return fmt::format("put the board {} (position {}); {}",
                     board == 1 ? "before the camera, as near as it is seen whole" : "elsewhere", board, look);
}

}  // namespace

ViewGuide::ViewGuide(std::map<int, Camera> cameras, RigConfig config, ViewConfig where)
    : cameras_(std::move(cameras)), config_(std::move(config)), where_(where) {
  if (cameras_.empty()) throw ConfigError("there is no camera");
  require_none(faults(where_));
  solve();  // the config's faults, before the first view
}

const ViewGuideState& ViewGuide::push(const HeadView& view) {
  if (!cameras_.contains(view.head)) throw ConfigError(fmt::format("head {} has no camera", view.head));
  views_.push_back(view);
  try {
    solve();
  } catch (...) {
    views_.pop_back();
    throw;
  }
  return state_;
}

void ViewGuide::undo() {
  if (views_.empty()) return;
  views_.pop_back();
  solve();
}

void ViewGuide::solve() {
  const RigCalibration result = alidade::rig(views_, cameras_, config_);
  ViewGuideState state;
  state.views = static_cast<int>(views_.size());
  state.verdict = result.verdict;
  state.has_rig = result.status == RigReport::Status::converged && result.rig.heads.size() == cameras_.size();
  if (state.has_rig) {
    const ViewPlan plan = plan_view(result, where_);
    state.rig = result.rig;
    state.sigma = plan.now;
    state.next = plan.next;
    if (state.next)
      state.outline_px =
          outline_of(cameras_.at(state.next->head), points_in_board(*config_.board), state.next->cam_from_board);
  }
  std::vector<int> heads;
  for (const auto& [id, camera] : cameras_) heads.push_back(id);
  state.words = state.next ? words_of_view(*state.next, cameras_.at(state.next->head), points_in_board(*config_.board))
                           : words_of_first_views(views_.size(), heads);
  state_ = std::move(state);
}

}  // namespace alidade
