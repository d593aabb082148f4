// A film of somebody who waves a board about and looks at no outline: rendered, with known truth.
#include <gtest/gtest.h>

#include <algorithm>
#include <cstdio>
#include <cstdlib>
#include <map>
#include <opencv2/core.hpp>
#include <random>
#include <string>

#include "alidade/board/board_pose.h"
#include "alidade/board_detector/find_board.h"
#include "alidade/calibrate.h"
#include "alidade/camera/camera_diff.h"
#include "alidade/capture.h"
#include "alidade/capture/lens_so_far.h"
#include "alidade/capture/pose_plan.h"
#include "alidade/simulate/boards/board_photos.h"
#include "alidade/simulate/boards/board_placing.h"

namespace alidade {
namespace {

const Board film_board{.cols = 9, .rows = 6, .square_m = 0.025}, strange_board{.cols = 7, .rows = 6, .square_m = 0.025};
constexpr double film_goal_px = 0.5, frames_per_s = 15.0;
constexpr std::size_t num_frames = 600, frames_a_key = 15, frames_moving = 3;

/// 600 images: forty times the board goes somewhere, smeared while it moves, and stays for a moment; now and then a
/// hand or another board is there instead.
class Film {
 public:
  explicit Film(std::uint64_t seed) : draw_(seed) {
    Calibrated<Brown> lens;
    std::uniform_real_distribution<double> unit(-1.0, 1.0);
    const double f = 620.0 + 100.0 * unit(draw_);
    lens.params << f, 1.002 * f, 319.5 + 8.0 * unit(draw_), 239.5 + 8.0 * unit(draw_), 0.0, -0.2, 0.05, 5e-4, -5e-4, 0;
    camera = {.width_px = 640, .height_px = 480, .lens = lens, .cov = {}, .source = ""};
    const BoardSceneConfig held{.num_photos = num_frames / frames_a_key + 1, .min_fill = 0.4, .max_fill = 1.0};
    scene_ = draw_board_scene(camera, film_board, held, seed);
    strange_ = draw_board_scene(camera, strange_board, held, seed + 100);
    for (std::size_t key = 0; key + 1 < scene_.cam_from_board.size(); ++key) add_key(key);
  }

  Camera camera;
  std::vector<cv::Mat> frames;

 private:
  void add_key(std::size_t key) {
    const bool is_hidden = key % 8 == 5, is_strange = key % 8 == 2;
    const cv::Mat still = is_hidden    ? cv::Mat(480, 640, CV_8U, cv::Scalar(120)).clone()
                          : is_strange ? rendered(strange_, strange_.cam_from_board[key])
                                       : rendered(scene_, scene_.cam_from_board[key]);
    for (std::size_t i = 0; i < frames_moving; ++i) frames.push_back(with_noise(smeared(key, i)));
    for (std::size_t i = frames_moving; i < frames_a_key; ++i) frames.push_back(with_noise(still));
  }
  /// On the way to a key, over an exposure of half a frame.
  [[nodiscard]] cv::Mat smeared(std::size_t key, std::size_t i) const {
    const Rigid3 &a = scene_.cam_from_board[key == 0 ? 0 : key - 1], &b = scene_.cam_from_board[key];
    cv::Mat sum(480, 640, CV_32F, cv::Scalar(0));
    constexpr int parts = 3;
    for (int part = 0; part < parts; ++part) {
      const double way = (static_cast<double>(i) + 0.5 * part / parts) / frames_moving;
      cv::Mat one;
      rendered(scene_, {a.rotation.slerp(way, b.rotation), (1.0 - way) * a.translation + way * b.translation})
          .convertTo(one, CV_32F, 1.0 / parts);
      sum += one;
    }
    cv::Mat grey;
    sum.convertTo(grey, CV_8U);
    return grey;
  }
  static cv::Mat rendered(BoardScene scene, const Rigid3& pose) {
    scene.cam_from_board = {pose};
    return render_board_photo(scene, 0, {.noise = 0.0}, 1);
  }
  /// Noise of its own for each frame: another part of what was drawn once.
  cv::Mat with_noise(const cv::Mat& grey) {
    if (noise_.empty()) {
      noise_.create(2 * grey.rows, 2 * grey.cols, CV_32F);
      std::normal_distribution<float> normal(0.0F, 2.0F);
      std::generate(noise_.begin<float>(), noise_.end<float>(), [&] { return normal(draw_); });
    }
    const int left = std::uniform_int_distribution(0, grey.cols)(draw_);
    const int top = std::uniform_int_distribution(0, grey.rows)(draw_);
    cv::Mat sum, noisy;
    grey.convertTo(sum, CV_32F);
    sum += noise_(cv::Rect(left, top, grey.cols, grey.rows));
    sum.convertTo(noisy, CV_8U);
    return noisy;
  }

  std::mt19937_64 draw_;
  BoardScene scene_, strange_;
  cv::Mat noise_;
};

/// How many photos, taken in even steps through the film, it takes until the goal holds; those that show no board were
/// taken as well.
int evenly_spaced(const Film& film) {
  std::map<std::size_t, BoardView> found;
  for (int count = 4; count < 150; count += 1 + count / 20) {
    std::vector<BoardView> views;
    for (int k = 0; k < count; ++k) {
      const std::size_t at = static_cast<std::size_t>(k) * num_frames / static_cast<std::size_t>(count);
      if (!found.contains(at)) found[at] = find_board(film.frames[at], film_board).view;
      if (!found[at].corners.empty()) views.push_back(found[at]);
    }
    const CalibrateReport report =
        calibrate(film_board, views, {640, 480}, {.board_shape = BoardShape::flat, .outliers = OutlierRule::drop});
    if (report.status != CalibrateReport::Status::converged) continue;
    const PixelGrid sigma = projection_sigma(report.camera, 9, 7, std::numeric_limits<double>::infinity());
    if (3.0 * *std::ranges::max_element(sigma.values) <= film_goal_px) return count;
  }
  return 150;
}

/// How many a choice needs that sees the whole film before each photo, and takes what tells most: what no guide can
/// know.
int all_seeing(const Film& film) {
  std::vector<BoardView> shown, kept;
  for (std::size_t at = frames_a_key / 2; at < num_frames; at += frames_a_key) {
    BoardView view = find_board(film.frames[at], film_board).view;
    if (!view.corners.empty()) shown.push_back(std::move(view));
  }
  while (!shown.empty()) {
    const LensSoFar lens = lens_so_far(film_board, kept, {640, 480}, {.outliers = OutlierRule::drop});
    const PosePlan plan(lens.camera, lens.board_points, lens.noise_px);
    if (lens.is_solved && plan.worst_3sigma_px() <= film_goal_px) return static_cast<int>(kept.size());
    const auto gain = [&](const BoardView& view) {
      const auto fit = fit_board_pose(lens.camera, view, lens.board_points, 1.0);
      return fit ? plan.gain_of(view, fit->pose.cam_from_board) : 0.0;
    };
    const auto best = std::ranges::max_element(shown, {}, gain);
    kept.push_back(std::move(*best));
    kept.back().photo = std::to_string(kept.size());
    shown.erase(best);
  }
  return 150;
}

/// Of the environment: more films, for figures.
std::uint64_t given_number(const char* name) {
  const char* given = std::getenv(name);
  return given ? std::stoul(given) : 1;
}

TEST(RenderedWalk, NeedsFewerPhotosThanAnEvenChoice) {
  const std::uint64_t first = given_number("ALIDADE_FIRST_FILM"), num_films = given_number("ALIDADE_FILMS");
  int guided = 0, evenly = 0, seeing = 0, num_within = 0, num_reached = 0;
  for (std::uint64_t seed = first; seed < first + num_films; ++seed) {
    const Film film(seed);
    CaptureGuide guide(film_board, {.until_px = film_goal_px});
    std::size_t shown = 0;
    for (; shown < 3 * num_frames && !guide.state().is_at(film_goal_px); ++shown)
      (void)guide.push(film.frames[shown % num_frames], static_cast<double>(shown) / frames_per_s);
    const int even = evenly_spaced(film);
    const auto diff = guide.state().has_camera ? diff_cameras(guide.state().camera, film.camera) : std::nullopt;
    const int all = num_films > 1 ? all_seeing(film) : 0;
    std::printf("film %d: guided %d of %zu images (3 sigma %.2f px), evenly spaced %d, all-seeing %d; off by %.2f px\n",
                static_cast<int>(seed), guide.state().photos, shown, guide.state().worst_3sigma_px, even, all,
                diff ? diff->max_px : -1.0);
    EXPECT_TRUE(diff && diff->max_px <= guide.state().worst_3sigma_px) << seed;
    num_within += diff && diff->max_px <= guide.state().worst_3sigma_px ? 1 : 0;
    num_reached += guide.state().is_at(film_goal_px) ? 1 : 0;
    seeing += all;
    guided += guide.state().photos;
    evenly += even;
  }
  std::printf(
      "%d films: guided %d, evenly spaced %d, all-seeing %d photos; %d at the goal, the truth within 3 sigma in %d\n",
      static_cast<int>(num_films), guided, evenly, seeing, num_reached, num_within);
  EXPECT_EQ(num_reached, static_cast<int>(num_films));
  EXPECT_LE(guided, 0.5 * evenly);
}

}  // namespace
}  // namespace alidade
