#include "cli/commands/head_live.h"

#include <algorithm>
#include <chrono>
#include <opencv2/core.hpp>

#include "alidade/images/photos.h"
#include "alidade/live/foxglove.h"
#include "alidade/live/streams.h"
#include "alidade/results/documents/follow_document.h"
#include "alidade/servo/head_servo.h"

namespace alidade::cli {
namespace {

using live::FoxgloveType;
using live::TopicKind;

double seconds_now() {
  return std::chrono::duration<double>(std::chrono::steady_clock::now().time_since_epoch()).count();
}

}  // namespace

std::vector<live::Topic> FollowShow::topics() {
  std::vector<live::Topic> topics = live::common_topics();
  FollowedFrame sample;
  sample.pan_tilt_rad = sample.px = sample.target_rad = sample.error_px = Eigen::Vector2d::Zero();
  topics.push_back(live::row_topic("/head", "alidade.FollowedFrame", follow_table({&sample, 1})));
  topics.push_back(
      {live::foxglove_channel("/head1/camera", FoxgloveType::camera_calibration), TopicKind::latest, 10.0, 1});
  topics.push_back(
      {live::foxglove_channel("/head1/marks", FoxgloveType::image_annotations), TopicKind::images, 10.0, 1});
  topics.push_back(
      {live::foxglove_channel("/head1/image", FoxgloveType::compressed_image), TopicKind::images, 10.0, 1});
  return topics;
}

void FollowShow::begin(live::Server& server, const Camera& camera) {
  server.send("/head1/camera", 0, [camera] { return live::camera_calibration_text(0, "head1", camera); });
}

void FollowShow::show(live::Server& server, const Camera& camera, const FollowedFrame& frame, const cv::Mat& image) {
  constexpr int max_width_px = 640;
  const auto t_ns = static_cast<std::int64_t>(frame.t_s * 1e9);
  server.send("/head", t_ns, [frame] { return live::row_text(follow_table({&frame, 1})); });
  if (!limit_.lets_through(seconds_now())) return;
  server.send("/head1/image", t_ns, [t_ns, copy = image.clone()] {
    return live::compressed_image_text(t_ns, "head1", jpeg_preview(copy, max_width_px, 70));
  });
  const double scale = std::min(1.0, static_cast<double>(max_width_px) / image.cols);
  live::Marks marks(t_ns);
  marks.dot(scale * centre_of(camera), 3.0, live::sky);
  if (frame.is_found) marks.dot(scale * frame.px, 6.0, live::orange);
  server.send("/head1/marks", t_ns, [text = marks.text()] { return text; });
}

}  // namespace alidade::cli
