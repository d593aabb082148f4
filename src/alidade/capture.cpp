#include "alidade/capture.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <cstring>
#include <opencv2/core.hpp>
#include <tuple>

#include "alidade/board/board_pose.h"
#include "alidade/board/dictionary.h"
#include "alidade/board_detector/find_board.h"
#include "alidade/board_detector/quick_look.h"
#include "alidade/calibrate/setup.h"
#include "alidade/capture/lens_so_far.h"
#include "alidade/capture/outline.h"
#include "alidade/capture/pose_plan.h"
#include "alidade/capture/pose_words.h"
#include "alidade/capture/shown_images.h"

namespace alidade {
namespace {

constexpr double still_s = 0.12;       // so long it has to stand still,
constexpr double still_share = 0.003;  // within so much of the image's width
constexpr double same_share = 0.04;    // of the board's size: a pose that is kept already
constexpr double max_blur = 1.8;       // of the sharpest
constexpr double sharp_px = 1.3;       // is never called blurred
constexpr double min_gain = 0.004;     // of σ
// Of the information of the outline an image must bring the share `choosy`. Who does not follow the outline shows what
// there is: the longer no photo was taken, the less will do, of all images that were shown; the newest is preferred
// where it brings `nearly` as much. Information, not gain: where little is known any photo brings most of the gain.
constexpr double choosy = 0.5, nearly = 0.85;
constexpr double patient_s = 5.0, impatient_s = 12.0;
// Of what an outline would bring, the part that a photo brings which a hand holds about there: by simulated sessions.
// Each photo that is taken moves it by this: who shows other poses than the outlines needs more of them.
constexpr double share_by_hand = 0.85, share_learnt = 0.2, min_share = 0.05, max_share = 1.5;
// By so much more than a plan foresees does a photo bring, by simulated sessions: the plan tries few poses, and what
// few photos say of the noise is too much.
constexpr double unforeseen = 1.25;

/// What a gain, ln of σ before over σ after, adds to the information that there is, as a multiple of it.
double information_of(double gain) { return std::expm1(2.0 * gain); }

std::uint64_t hash_of(const cv::Mat& image) {
  std::uint64_t hash = 1469598103934665603u;  // FNV-1a, eight bytes at a time
  const std::size_t row_bytes = static_cast<std::size_t>(image.cols) * image.elemSize();
  for (int row = 0; row < image.rows; ++row) {
    const uchar* bytes = image.ptr(row);
    for (std::size_t i = 0; i + 8 <= row_bytes; i += 8) {
      std::uint64_t word = 0;
      std::memcpy(&word, bytes + i, 8);
      hash = (hash ^ word) * 1099511628211u;
    }
  }
  return hash;
}

/// Mean distance of the corners that two views share; none where they share too few.
std::optional<double> distance_px(const BoardView& a, const BoardView& b) {
  double sum = 0.0;
  int count = 0;
  for (auto p = a.corners.begin(), q = b.corners.begin(); p != a.corners.end() && q != b.corners.end();) {
    if (p->index < q->index) {
      ++p;
    } else if (q->index < p->index) {
      ++q;
    } else {
      sum += (p++->px - q++->px).norm();
      ++count;
    }
  }
  if (count < 4) return std::nullopt;
  return sum / count;
}

std::vector<Eigen::Vector2d> pixels_of(const BoardView& view) {
  std::vector<Eigen::Vector2d> positions;
  for (const Corner& corner : view.corners) positions.push_back(corner.px);
  return positions;
}

}  // namespace

struct CaptureGuide::State {
  State(const Board& given, const CaptureConfig& asked) : board(given), config(asked), looker(given) {
    solve_config = resolved(asked.calibrate);
    if (solve_config.outliers == OutlierRule::automatic) solve_config.outliers = OutlierRule::drop;
  }

  Board board;
  CaptureConfig config;
  CalibrateConfig solve_config;
  QuickLooker looker;
  ImageSize size;
  std::vector<BoardView> views;  ///< Of the photos that are kept.
  std::optional<LensSoFar> lens;
  std::optional<PosePlan> plan;
  CaptureState out;
  double correction = 1.0;       ///< Worst σ of the whole job over ours.
  double share = share_by_hand;  ///< Of the outlines' gains that photos brought lately.
  bool takes_what_comes = false;

  // Of the images that came.
  std::optional<std::uint64_t> hash;
  QuickLook seen;        ///< In the newest.
  BoardView still_view;  ///< Where the board has been since …
  std::optional<double> still_since_s, took_s;
  double sharpest_px = 1e9;
  ShownImages shown;  ///< That could have been taken.

  void begin(const ImageSize& of_images);
  void look_closely(const cv::Mat& image);
  void keep(BoardView view);
  void solve();
  void fill_state();
  CaptureLook look_without_board();
  CaptureLook judge(const cv::Mat* image, double t_s);
  [[nodiscard]] double asked_gain(double t_s) const;
  [[nodiscard]] double gain_of(const BoardView& view) const;
  [[nodiscard]] bool is_held(const BoardView& view) const;
  bool recalls(double t_s, CaptureLook& look) const;
  [[nodiscard]] bool stands_still(double t_s);
  [[nodiscard]] std::optional<Rigid3> pose_of(const BoardView& view) const;
  void say_way(const BoardView& view, CaptureLook& look) const;
};

void CaptureGuide::State::begin(const ImageSize& of_images) {
  if (size.width_px > 0 || of_images.width_px < 1 || of_images.height_px < 1) return;
  size = of_images;
  solve();
}

/// Of a photo that does not come again, as find_board() does.
void CaptureGuide::State::look_closely(const cv::Mat& image) {
  BoardDetection found = find_board(image, board);
  if (found.found()) seen = {.view = std::move(found.view), .blur_px = 0.0, .reason = ""};
}

void CaptureGuide::State::keep(BoardView view) {
  if (lens->is_solved && plan->best_gain() > 0.0) {
    const double share_now = information_of(gain_of(view)) / information_of(plan->best_gain());
    const double brought = std::clamp(share_now, min_share, max_share);
    share += share_learnt * (brought - share);
  }
  view.photo = std::to_string(views.size() + 1);
  views.push_back(std::move(view));
  took_s.reset();
  solve();
}

std::optional<Rigid3> CaptureGuide::State::pose_of(const BoardView& view) const {
  const auto fit = fit_board_pose(lens->camera, view, lens->board_points, 1.0);
  if (!fit) return std::nullopt;
  return fit->pose.cam_from_board;
}

/// The lens of the photos so far, what the next may bring, and where to hold the board for it.
void CaptureGuide::State::solve() {
  lens = lens_so_far(board, views, size, solve_config);
  plan.emplace(lens->camera, lens->board_points, lens->noise_px);
  plan->look_for_best(views);
  shown.value([this](const BoardView& view) { return gain_of(view); },
              [this](const BoardView& view) { return is_held(view); });
  fill_state();
}

void CaptureGuide::State::fill_state() {
  out = {};
  out.photos = static_cast<int>(views.size());
  out.has_camera = lens->is_solved;
  out.camera = lens->camera;
  if (lens->is_solved) {
    out.worst_3sigma_px = correction * plan->worst_3sigma_px();
    out.worst_px = plan->worst_px();
    out.sigma = projection_sigma(lens->camera, 32, 24, std::numeric_limits<double>::infinity());
    for (double& sigma_px : out.sigma.values) sigma_px *= correction;
  }
  if (lens->is_solved) out.photos_to_goal = plan->photos_until(config.until_px / correction, unforeseen * share);
  if (plan->best()) {
    const BoardInImage held = board_in_image(lens->camera, lens->board_points, *plan->best());
    out.next = NextPose{*plan->best(), outline_of(lens->camera, lens->board_points, *plan->best()),
                        words_of(held, false), words_of(held, true)};
  }
  if (std::string walk = focal_walk(*lens, views); !walk.empty()) out.warnings.push_back(std::move(walk));
}

bool CaptureGuide::State::stands_still(double t_s) {
  if (!config.is_video) return true;
  const auto moved = distance_px(still_view, seen.view);
  if (!still_since_s || !moved || *moved > still_share * size.width_px) {
    still_view = seen.view;
    still_since_s = t_s;
    return false;
  }
  return t_s - *still_since_s >= still_s;
}

/// How to come to the next pose from where the board is.
void CaptureGuide::State::say_way(const BoardView& view, CaptureLook& look) const {
  const auto pose = plan->best() ? pose_of(view) : std::nullopt;
  if (!pose) return;
  const BoardInImage now = board_in_image(lens->camera, lens->board_points, *pose);
  const BoardInImage wanted = board_in_image(lens->camera, lens->board_points, *plan->best());
  look.words += (look.words.empty() ? "" : ": ") + words_to(wanted, now, false);
  look.words_mirrored += (look.words_mirrored.empty() ? "" : ": ") + words_to(wanted, now, true);
}

/// What an image must bring now.
double CaptureGuide::State::asked_gain(double t_s) const {
  if (takes_what_comes) return min_gain;
  const double late = std::clamp((t_s - *took_s - patient_s) / (impatient_s - patient_s), 0.0, 1.0);
  const double asked = choosy * (1.0 - late) * information_of(plan->best_gain());
  return std::max(min_gain, 0.5 * std::log1p(asked));
}

double CaptureGuide::State::gain_of(const BoardView& view) const {
  const auto pose = pose_of(view);
  return pose ? plan->gain_of(view, *pose) : 0.0;
}

bool CaptureGuide::State::is_held(const BoardView& view) const {
  return std::ranges::any_of(views, [&](const BoardView& kept) { return is_same_pose(view, kept, same_share); });
}

/// Whether one of the images that were shown is to be taken now.
bool CaptureGuide::State::recalls(double t_s, CaptureLook& look) const {
  const ShownImage* best = shown.best();
  if (best == nullptr || best->gain < asked_gain(t_s)) return false;
  look.status = LookStatus::useful;
  look.words = look.words_mirrored = fmt::format("taken, as shown {:.0f} s ago", t_s - best->t_s);
  look.earlier = EarlierImage{best->image, best->view, best->t_s};
  return true;
}

/// No board, or another one.
CaptureLook CaptureGuide::State::look_without_board() {
  still_since_s.reset();
  CaptureLook look;
  std::tie(look.other_cols, look.other_rows) = seen.other_grid;
  const bool is_other = seen.other_grid.first > 0;
  look.status = is_other ? LookStatus::other_board : LookStatus::nothing;
  look.words = look.words_mirrored =
      is_other ? fmt::format("a board of {}×{} corners is in view, not of {}×{}", seen.other_grid.first,
                             seen.other_grid.second, board.cols, board.rows)
               : "no board in view";
  return look;
}

CaptureLook CaptureGuide::State::judge(const cv::Mat* image, double t_s) {
  if (!seen.found()) return look_without_board();
  CaptureLook look;
  const auto say = [&](LookStatus status, const std::string& words) {
    look.status = status;
    look.words = look.words_mirrored = words;
  };
  look.corners_px = pixels_of(seen.view);
  if (!took_s) took_s = t_s;
  const bool is_still = stands_still(t_s);
  if (seen.blur_px > 0.0 && is_still) sharpest_px = std::min(sharpest_px, seen.blur_px);
  if (is_held(seen.view)) {
    say(LookStatus::same_pose, "same pose again");
    say_way(seen.view, look);
    return look;
  }
  look.gain = gain_of(seen.view);
  if (!is_still) {
    say(LookStatus::moving, "");
    say_way(seen.view, look);
    return look;
  }
  if (seen.blur_px > std::max(sharp_px, max_blur * sharpest_px)) {
    say(LookStatus::blurred, fmt::format("blurred: σ {:.1f} px, the sharpest {:.1f} px", seen.blur_px, sharpest_px));
    return look;
  }
  const double asked = asked_gain(t_s);
  const ShownImage* best = shown.best();
  if (look.gain >= asked && (takes_what_comes || best == nullptr || look.gain >= nearly * best->gain)) {
    say(LookStatus::useful, "taken");
    return look;
  }
  if (look.gain >= min_gain) shown.offer(seen.view, image, t_s, look.gain);
  if (recalls(t_s, look)) return look;
  say(LookStatus::little, "");
  say_way(seen.view, look);
  return look;
}

CaptureGuide::CaptureGuide(const Board& board, const CaptureConfig& config) {
  CaptureConfig copy = config;
  std::vector<std::string> found = faults_of(alidade::fields_of(copy.calibrate));
  if (const std::string of_board = fault(board); !of_board.empty()) found.push_back(of_board);
  if (!(config.until_px > 0.0)) found.push_back("until_px must be positive");
  if (found.empty()) found = faults(resolved(config.calibrate));
  if (!found.empty()) throw ConfigError(fmt::format("{}", fmt::join(found, "; ")));
  state_ = std::make_unique<State>(board, config);
}

CaptureGuide::~CaptureGuide() = default;
CaptureGuide::CaptureGuide(CaptureGuide&&) noexcept = default;
CaptureGuide& CaptureGuide::operator=(CaptureGuide&&) noexcept = default;

CaptureLook CaptureGuide::look(const cv::Mat& image, double t_s) {
  State& state = *state_;
  CaptureLook look;
  if (image.empty() || image.dims != 2) {
    look.words = look.words_mirrored = "there is no image";
    return look;
  }
  state.begin({image.cols, image.rows});
  if (image.cols != state.size.width_px || image.rows != state.size.height_px) {
    look.words = look.words_mirrored = fmt::format("the image is {}x{}, but the first was {}x{}", image.cols,
                                                   image.rows, state.size.width_px, state.size.height_px);
    return look;
  }
  const std::uint64_t hash = hash_of(image);
  const bool is_repeated = state.hash == hash;
  state.hash = hash;
  if (!is_repeated) {
    state.seen = state.looker.look(image);
    if (!state.seen.found() && !state.config.is_video) state.look_closely(image);
  }
  look = state.judge(&image, t_s);
  if (is_repeated && !state.config.is_video) look.status = LookStatus::repeated;
  return look;
}

CaptureLook CaptureGuide::look_back(double t_s) {
  CaptureLook look;
  State& state = *state_;
  if (!state.lens) return look;
  if (!state.took_s) state.took_s = t_s;  // a photo was taken since: the wait begins again
  state.recalls(t_s, look);
  return look;
}

std::string CaptureGuide::take(const cv::Mat& image) {
  State& state = *state_;
  state.begin({image.cols, image.rows});
  if (image.cols != state.size.width_px || image.rows != state.size.height_px)
    return fmt::format("the image is {}x{}, but the first was {}x{}", image.cols, image.rows, state.size.width_px,
                       state.size.height_px);
  BoardDetection found = find_board(image, state.board);
  if (!found.found()) {
    state.shown.drop(image);
    return found.reason;
  }
  state.keep(std::move(found.view));
  return "";
}

CaptureLook CaptureGuide::push(const cv::Mat& image, double t_s) {
  CaptureLook seen = look(image, t_s);
  if (!seen.take()) return seen;
  if (const std::string reason = take(seen.earlier ? *seen.earlier->image : image); !reason.empty()) {
    seen.status = LookStatus::little;
    seen.words = seen.words_mirrored = reason;
  }
  return seen;
}

CaptureLook CaptureGuide::push(const BoardView& view, const ImageSize& size, double t_s) {
  State& state = *state_;
  state.begin(size);
  state.seen = {.view = view, .blur_px = 0.0, .reason = view.corners.empty() ? "no corners" : ""};
  CaptureLook seen = state.judge(nullptr, t_s);
  if (seen.take()) state.keep(seen.earlier ? seen.earlier->view : view);
  return seen;
}

void CaptureGuide::forget(std::size_t photo) {
  State& state = *state_;
  if (photo >= state.views.size()) return;
  state.views.erase(state.views.begin() + static_cast<std::ptrdiff_t>(photo));
  state.solve();
}

const CaptureState& CaptureGuide::state() const { return state_->out; }

void CaptureGuide::correct(double worst_3sigma_px) {
  State& state = *state_;
  if (!state.lens || !state.lens->is_solved || !(worst_3sigma_px > 0.0) || !std::isfinite(worst_3sigma_px)) return;
  state.correction = worst_3sigma_px / state.plan->worst_3sigma_px();
  state.fill_state();
}

void CaptureGuide::accept_any_useful(bool is_so) { state_->takes_what_comes = is_so; }

}  // namespace alidade
