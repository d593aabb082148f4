#pragma once

#include <vector>

#include "alidade/heads/head_follow.h"
#include "alidade/live/rate_limit.h"
#include "alidade/live/server.h"

namespace alidade::cli {

/// What a head that follows a target shows while it does: each frame as a row, and at most ten images a second.
class FollowShow {
 public:
  [[nodiscard]] static std::vector<live::Topic> topics();
  static void begin(live::Server& server, const Camera& camera);
  void show(live::Server& server, const Camera& camera, const FollowedFrame& frame, const cv::Mat& image);

 private:
  live::RateLimit limit_{10.0};
};

}  // namespace alidade::cli
