#include "alidade/results/seen_frames.h"

#include <fmt/format.h>

#include <array>
#include <limits>
#include <opencv2/core.hpp>

#include "alidade/images/photos.h"

namespace alidade {
namespace {

constexpr std::size_t max_frames = 24;  // of 40 kB each

}  // namespace

SeenFrames::SeenFrames(std::size_t num_images, bool keeps_images)
    : every_(std::max<std::size_t>(1, (num_images + max_frames - 1) / max_frames)), keeps_images_(keeps_images) {}

void SeenFrames::offer(double t_s, const cv::Mat& image, std::span<const ObservationTried> tried) {
  if (count_++ % every_ != 0) return;
  if (frames_.size() == max_frames) {  // more than was said: every other one leaves
    every_ *= 2;
    std::vector<Frame> kept;
    for (std::size_t i = 0; i < frames_.size(); ++i) {
      if (i % 2 == 0)
        kept.push_back(std::move(frames_[i]));
      else
        images_.erase(frames_[i].name);
    }
    frames_ = std::move(kept);
    if ((count_ - 1) % every_ != 0) return;
  }
  constexpr int max_width_px = 640, quality = 75;
  std::string name = fmt::format("frame {:06}", count_ - 1);
  if (keeps_images_) images_[name] = jpeg_preview(image, max_width_px, quality);
  frames_.push_back({t_s, std::move(name), image.cols, image.rows, {tried.begin(), tried.end()}});
}

DataTable SeenFrames::observations_table() const {
  std::vector<std::int64_t> frame, id;
  std::vector<bool> used;
  std::array<std::vector<double>, 7> c;
  for (std::size_t at = 0; at < frames_.size(); ++at) {
    for (const ObservationTried& observation : frames_[at].tried) {
      frame.push_back(static_cast<std::int64_t>(at));
      id.push_back(observation.id);
      const double none = std::numeric_limits<double>::quiet_NaN();
      const Eigen::Vector2d found_px = observation.found_px.value_or(Eigen::Vector2d(none, none));
      const Eigen::Vector2d expected_px = observation.expected_px;
      const Eigen::Matrix2d& S = observation.S;
      const std::array<double, 7> row{expected_px.x(), expected_px.y(), S(0, 0),     S(0, 1),
                                      S(1, 1),         found_px.x(),    found_px.y()};
      for (std::size_t k = 0; k < 7; ++k) c[k].push_back(row[k]);
      used.push_back(observation.is_used);
    }
  }
  return {"sights",
          {{"frame", frame},
           {"id", id},
           {"expected_u_px", rounded(c[0], 2)},
           {"expected_v_px", rounded(c[1], 2)},
           {"cov_uu_px2", c[2]},
           {"cov_uv_px2", c[3]},
           {"cov_vv_px2", c[4]},
           {"u_px", rounded(c[5], 2)},
           {"v_px", rounded(c[6], 2)},
           {"used", used}}};
}

void SeenFrames::add_to(JobOutcome& outcome) const {
  if (frames_.empty()) return;
  std::vector<double> t_s;
  std::vector<std::string> names;
  std::vector<int> width_px, height_px;
  for (const Frame& one : frames_) {
    t_s.push_back(one.t_s);
    names.push_back(one.name);
    width_px.push_back(one.width_px);
    height_px.push_back(one.height_px);
  }
  std::vector<DataTable>& data = outcome.document.data;
  data.insert(data.begin(), observations_table());
  data.insert(data.begin(),
              {"frames", {{"t_s", t_s}, {"name", names}, {"width_px", width_px}, {"height_px", height_px}}});
  for (const auto& [image, jpeg] : images_) outcome.images.push_back({image, jpeg});
}

}  // namespace alidade
