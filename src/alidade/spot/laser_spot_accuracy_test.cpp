// How well laser spots are found on rendered boards with exact truth, and how well their stated σ says so.
#include <gtest/gtest.h>

#include <Eigen/LU>
#include <cmath>
#include <opencv2/core.hpp>
#include <opencv2/imgproc.hpp>

#include "alidade/simulate/draws.h"
#include "alidade/simulate/example_camera.h"
#include "alidade/simulate/films/spot_photos.h"
#include "alidade/spot/laser_spot.h"

namespace alidade {
namespace {

constexpr std::size_t num_poses = 34;
const Board board{BoardKind::chessboard, 6, 4, 0.03, 0.0, ""};

const SpotScene& scene() {
  static const SpotScene drawn =
      *draw_spot_scene(*example_camera("brown", 320, 240), board, {0.04, -0.01, 0.005}, {-0.06, 0.02, 1.0},
                       {.num_photos = num_poses, .min_range_m = 0.35, .max_range_m = 0.9}, 3);
  return drawn;
}

SeenBoard seen(std::size_t i) { return {board, scene().boards.camera, scene().boards.cam_from_board[i]}; }

SpotStudio studio(std::size_t i, double noise) {
  return {scene().boards, i, {.noise = noise, .black = 25.0, .white = 120.0, .background_texture = 2.0}, i};
}

/// What is known beside a colour photo, or a grey one.
enum class Known { photo_off, nothing, pose, grey_with_pose };

cv::Mat grey_of(const cv::Mat& photo) {
  cv::Mat grey;
  cv::cvtColor(photo, grey, cv::COLOR_BGR2GRAY);
  return grey;
}

LaserSpot find(const cv::Mat& photo, const cv::Mat& photo_off, std::size_t i, Known known) {
  LaserSpotAids aids;
  if (known == Known::photo_off) aids.photo_off = &photo_off;
  if (known == Known::pose || known == Known::grey_with_pose) aids.seen_board = seen(i);
  return find_laser_spot(known == Known::grey_with_pose ? grey_of(photo) : photo, aids);
}

struct Score {
  int num_shown = 0, num_found = 0, num_wrong = 0, num_in_68 = 0, num_in_95 = 0;
  int num_even = 0, num_edge = 0;
  Eigen::Vector2d even_sum = Eigen::Vector2d::Zero();
  double even_squares = 0.0, edge_squares = 0.0;

  void add(const LaserSpot& spot, const Eigen::Vector2d& truth) {
    ++num_shown;
    if (!spot.found()) return;
    ++num_found;
    const Eigen::Vector2d error = spot.px - truth;
    const double chi2 = error.dot(spot.cov.inverse() * error);
    num_in_68 += chi2 < 2.28;
    num_in_95 += chi2 < 5.99;
    num_wrong += error.norm() > 2.0;
    (spot.is_on_edge ? num_edge : num_even) += 1;
    (spot.is_on_edge ? edge_squares : even_squares) += error.squaredNorm();
    if (!spot.is_on_edge) even_sum += error;
  }
  [[nodiscard]] double even_rms() const { return std::sqrt(even_squares / (2 * num_even)); }
  [[nodiscard]] double edge_rms() const { return std::sqrt(edge_squares / (2 * num_edge)); }
  [[nodiscard]] double share_in_68() const { return static_cast<double>(num_in_68) / num_found; }
  [[nodiscard]] double share_in_95() const { return static_cast<double>(num_in_95) / num_found; }
};

/// A photo of a pose, and one with the laser off.
struct Shot {
  std::size_t pose;
  cv::Mat photo, photo_off;
};

/// Red and green, dim (a few grey values on ink), bright, and saturated; on ink, paper and their edges as they come.
const std::vector<Shot>& shots() {
  static const std::vector<Shot> taken = [] {
    std::vector<Shot> all;
    for (std::size_t i = 0; i < num_poses; ++i) {
      SpotStudio photos = studio(i, 2.0);
      const cv::Mat off = photos.photo(1.04, 7 * i);
      for (const LaserColour colour : {LaserColour::red, LaserColour::green}) {
        for (const double peak : {100.0, 250.0, 3000.0}) {
          photos.clear();
          photos.add_spot(spot_in_cam(scene(), i), scene().beam_direction_in_cam, scene().range_m[i],
                          {.colour = colour, .peak = peak});
          all.push_back({i, photos.photo(1.0, 1000 + all.size()), off});
        }
      }
    }
    return all;
  }();
  return taken;
}

// One test: what costs most is to render the photos.
TEST(LaserSpotAccuracy, NoSpotIsWrongAndSigmaSaysHowWellItStands) {
  for (const Known known : {Known::photo_off, Known::nothing, Known::pose, Known::grey_with_pose}) {
    SCOPED_TRACE(static_cast<int>(known));
    Score score;
    for (const Shot& shot : shots())
      score.add(find(shot.photo, shot.photo_off, shot.pose, known), *true_spot(scene(), shot.pose));
    EXPECT_EQ(score.num_shown, 204);
    // One in three is dim; on ink, and in a grey photo, many of those drown.
    EXPECT_GE(score.num_found, known == Known::grey_with_pose ? 136 : 170);
    EXPECT_EQ(score.num_wrong, 0);
    EXPECT_LT(score.edge_rms(), 0.25);     // uncorrected, a spot of 2 px on an edge errs by up to 1 px
    EXPECT_GT(score.share_in_68(), 0.60);  // 0.68 less 2.5 times √(0.68 · 0.32/204)
    EXPECT_GT(score.share_in_95(), 0.90);  // 0.95 less 3 times √(0.95 · 0.05/204)
  }
}

TEST(LaserSpotBias, NoneOnEvenSquares) {
  // Squares of 30 px and more, hit at their centre or nearly: ink and paper.
  const Board large{BoardKind::chessboard, 3, 2, 0.08, 0.0, ""};
  const auto hits = draw_spot_scene(*example_camera("brown", 320, 240), large, {0.04, -0.01, 0.005}, {-0.06, 0.02, 1.0},
                                    {.num_photos = 20, .min_range_m = 0.5, .max_range_m = 0.8}, 4);
  ASSERT_TRUE(hits);
  Score score;
  for (std::size_t i = 0; i < 20; ++i) {
    const RenderConfig config{.black = 25.0, .white = 120.0};
    SpotStudio photos(hits->boards, i, config, i);
    const cv::Mat off = photos.photo(1.0, i);
    photos.add_spot(spot_in_cam(*hits, i), hits->beam_direction_in_cam, hits->range_m[i], {.peak = 300.0});
    for (std::uint64_t seed = 0; seed < 4; ++seed) {
      LaserSpotAids aids;
      aids.photo_off = &off;
      const LaserSpot spot = find_laser_spot(photos.photo(1.0, 100 * i + seed), aids);
      if (spot.found() && !spot.is_on_edge) score.add(spot, *true_spot(*hits, i));
    }
  }
  EXPECT_GT(score.num_even, 30);
  EXPECT_LT((score.even_sum / score.num_even).norm(), 0.05);
  EXPECT_LT(score.even_rms(), 0.15);
}

TEST(LaserSpotFalseAlarms, NoneInPhotosWithoutASpot) {
  int num_photos = 0;
  for (std::size_t i = 0; i < num_poses; ++i) {
    const SpotStudio photos = studio(i, i % 2 == 0 ? 2.0 : 6.0);
    const cv::Mat off = photos.photo(1.04, 7 * i);
    for (std::uint64_t seed = 0; seed < 2; ++seed) {
      const cv::Mat photo = photos.photo(1.0, 1000 * i + seed);
      for (const Known known : {Known::photo_off, Known::nothing, Known::pose, Known::grey_with_pose}) {
        EXPECT_EQ(find(photo, off, i, known).reason, "no laser spot") << i;
        ++num_photos;
      }
    }
  }
  EXPECT_EQ(num_photos, 272);
}

TEST(LaserSpotRivals, TwoSpotsOnABoardAreAlwaysNamed) {
  Draws draws(5);
  int num_photos = 0;
  for (std::size_t i = 0; i < num_poses; ++i) {
    SpotStudio photos = studio(i, 2.0);
    const cv::Mat off = photos.photo(1.04, 7 * i);
    const Rigid3& cam_from_board = scene().boards.cam_from_board[i];
    const Eigen::Vector3d hit = spot_in_cam(scene(), i);
    Eigen::Vector3d other = hit;
    while ((*project(scene().boards.camera, other) - *true_spot(scene(), i)).norm() < 20.0) {
      const Eigen::Vector3d place_in_board(draws.uniform(-0.02, 0.17), draws.uniform(-0.02, 0.11), 0.0);
      other = cam_from_board * place_in_board;
    }
    for (const Eigen::Vector3d& point_in_cam : {hit, other})
      photos.add_spot(point_in_cam, scene().beam_direction_in_cam, scene().range_m[i], {.peak = 600.0});
    const cv::Mat photo = photos.photo(1.0, i);
    for (const Known known : {Known::photo_off, Known::pose, Known::nothing}) {
      EXPECT_EQ(find(photo, off, i, known).reason.substr(0, 17), "two candidates at") << i;
      ++num_photos;
    }
  }
  EXPECT_EQ(num_photos, 102);
}

}  // namespace
}  // namespace alidade
