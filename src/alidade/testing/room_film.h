#pragma once

#include <opencv2/core.hpp>
#include <vector>

#include "alidade/localize.h"
#include "alidade/testing/room_video.h"

namespace alidade::testing {

/// Images of a room, and the poses (world_from_cam) from which they were taken.
struct RoomFilm {
  RoomScene scene;
  std::vector<cv::Mat> images;
  std::vector<TimedPose> truth;

  /// The `number`-th image of the scene, with noise of its own.
  void take(std::size_t number, const Rigid3& world_from_cam) {
    images.push_back(render_room(scene, world_from_cam, number + 1));
    truth.push_back({static_cast<double>(number) / scene.rate_hz, world_from_cam});
  }
};

/// All images along the scene's own path, from the `first`-th on.
inline RoomFilm room_film(const RoomScene& scene, std::size_t first = 0) {
  RoomFilm film{scene, {}, {}};
  const std::vector<Rigid3> path = room_path(scene);
  for (std::size_t i = first; i < path.size(); ++i) film.take(i, path[i]);
  return film;
}

inline Localization localized(const RoomFilm& film, const LocalizeConfig& config) {
  std::size_t i = 0;
  const NextImage next = [&](cv::Mat& grey, long& frame, double& t_s) {
    if (i == film.images.size()) return false;
    grey = film.images[i];
    frame = static_cast<long>(i);
    t_s = film.truth[i++].t_s;
    return true;
  };
  return localize(ImageStream{next, film.images.size()}, film.scene.camera, config, film.truth);
}

}  // namespace alidade::testing
