// Wide lenses that distort strongly, between photos like telephoto lenses, and photos of many pixels.

#include <gtest/gtest.h>

#include <cmath>

#include "alidade/simulate/turned_scene.h"
#include "alidade/turned/turned_fit.h"

namespace alidade::turned_lens {
namespace {

TEST(TurnedLens, WhereNoFitExplainsThePhotosOrdinaryFocalLengthsAreTried) {
  TurnedScene scene;
  scene.points_per_rad2 = 250.0;
  scene.num_photos = 10;
  scene.fx = scene.fy = 830.0;
  scene.k1 = -0.28;
  scene.k2 = -0.013;
  scene.sigma_px = 0.15;
  scene.pan_step_rad = 0.12;
  scene.tilt_rad = 0.25;
  const MatchedPhotos photos = simulate_turned_photos(scene, 310);
  const std::vector<PhotoLink> links = find_links(photos, {});
  const PhotoTree tree = largest_tree(photos.names.size(), links);
  const std::vector<TurnedFit> found = fits_of_ordinary({}, photos, links, tree, {}, {});
  ASSERT_FALSE(found.empty());
  EXPECT_NEAR(found.front().bundle.camera[0] * 0.5 * scene.width_px, scene.fx, 0.01 * scene.fx);
  EXPECT_TRUE(fits_of_ordinary(found, photos, links, tree, {}, {}).empty());  // what explains them needs no other
}

/// A focal length that may differ from photo to photo, be it by 1 in 4000, hides where the centre is and what p1 is.
TEST(TurnedLens, InPhotosOfManyPixelsNoPhotoHasAZoomOfItsOwn) {
  TurnedScene scene;
  scene.width_px = 4000;
  scene.height_px = 3000;
  scene.fx = scene.fy = 4430.0;
  scene.cx = 2005.0;
  scene.cy = 1504.0;
  scene.k1 = 0.044;
  scene.k2 = 0.011;
  scene.p1 = 0.002;
  scene.sigma_px = 0.2;
  TurnedConfig config;
  config.sigma_parallax = 0.0;
  const TurnedReport report = observe_turned(simulate_turned_photos(scene, 520), config);
  ASSERT_EQ(report.status, TurnedReport::Status::ok);
  for (const double zoom : report.bundle.log_zoom) EXPECT_EQ(zoom, 0.0);
  const Eigen::Vector4d truth(scene.fx, scene.fy, scene.cx, scene.cy);
  for (int i = 0; i < 4; ++i)  // one of 30 000 draws is beyond 4σ
    EXPECT_LT(std::abs(report.camera[i] - truth[i]), 4.0 * std::sqrt(report.cov(i, i))) << i;
}

}  // namespace
}  // namespace alidade::turned_lens
