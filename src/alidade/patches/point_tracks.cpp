#include "alidade/patches/point_tracks.h"
#include "alidade/estimation/median.h"

#include <tbb/parallel_for.h>

#include <Eigen/SVD>
#include <algorithm>
#include <cmath>
#include <map>
#include <opencv2/core.hpp>
#include <opencv2/imgproc.hpp>
#include <optional>
#include <utility>

#include "alidade/geometry/decompositions.h"
#include "alidade/patches/anchor_patch.h"
#include "alidade/patches/pyramid_flow.h"

namespace alidade {
namespace {

constexpr int max_levels = 4;              // flow of up to about 40 px per frame without a guess
constexpr double max_align_move_px = 1.5;  // beyond that, alignment and flow found different things
constexpr double min_distance_px = 8.0;    // half a patch: closer points carry the same information
constexpr double first_noise = 2.0;        // grey values, until estimated from the frames
constexpr double min_gain = 0.5, max_gain = 2.0;

struct Track {
  int id = 0;
  AnchorPatch patch;
  Eigen::Vector2d offset = Eigen::Vector2d::Zero();     ///< Of the point from its patch's centre, in the patch.
  PatchPose pose;                                       ///< Of the patch in the last frame.
  Eigen::Vector2d anchor_px = Eigen::Vector2d::Zero();  ///< Where the patch was cut out, in `anchor_frame`.
  std::size_t anchor_frame = 0;
  Eigen::Vector2d px = Eigen::Vector2d::Zero();
  Eigen::Vector2d flow_px = Eigen::Vector2d::Zero();  ///< Since the previous frame.
  double sigma_px = 0.0;
  double noise = first_noise;  ///< Estimate from this patch: σ in grey values of the unsmoothed image.
  bool is_lost = false;
};

double sigma_of(const Eigen::Matrix2d& cov) { return std::sqrt(0.5 * cov.trace()); }

/// Largest ratio by which a direction was lengthened or shortened.
double stretch_of(const Eigen::Matrix2d& linear) {
  const Eigen::Vector2d lengths = svd_of(linear).values;
  return std::max(lengths[0], 1.0 / lengths[1]);
}

bool has_room(const cv::Mat& image, const Eigen::Vector2d& px) {
  constexpr int margin = AnchorPatch::margin_px;
  return px.x() >= margin && px.y() >= margin && px.x() <= image.cols - 1 - margin && px.y() <= image.rows - 1 - margin;
}

/// Cuts the track's patch out of this image, around the whole pixel nearest to the point.
bool set_anchor(Track& track, const cv::Mat& smoothed, std::size_t frame) {
  const Eigen::Vector2d centre = track.px.array().round();
  if (!has_room(smoothed, centre)) return false;
  track.patch = AnchorPatch(smoothed, static_cast<int>(centre.x()), static_cast<int>(centre.y()));
  track.offset = track.px - centre;
  track.pose = {.px = centre};
  track.anchor_px = centre;
  track.anchor_frame = frame;
  return true;
}

/// A grid of roughly square cells, as many as the desired number of tracks.
struct Grid {
  int cols, rows;
  double cell_w, cell_h;

  Grid(const cv::Mat& image, int count) {
    const double side = std::sqrt(static_cast<double>(image.cols) * image.rows / count);
    cols = std::max(1, static_cast<int>(std::lround(image.cols / side)));
    rows = std::max(1, count / cols);
    cell_w = static_cast<double>(image.cols) / cols;
    cell_h = static_cast<double>(image.rows) / rows;
  }
  [[nodiscard]] std::size_t cell_of(const Eigen::Vector2d& px) const {
    const int col = std::clamp(static_cast<int>(px.x() / cell_w), 0, cols - 1);
    const int row = std::clamp(static_cast<int>(px.y() / cell_h), 0, rows - 1);
    return static_cast<std::size_t>(row * cols + col);
  }
};

}  // namespace

class PointTracker::Impl {
 public:
  explicit Impl(const PointTrackerConfig& config) : config_(config) {}

  const std::vector<TrackedPoint>& update(const cv::Mat& grey) {
    const cv::Mat smoothed = smoothed_for_patches(grey);
    std::vector<cv::Mat> levels = pyramid_of(smoothed, max_levels);
    if (!levels_.empty() && levels_[0].size() != smoothed.size()) tracks_.clear();
    ++frame_;
    predict_bends();
    tbb::parallel_for(std::size_t{0}, tracks_.size(), [&](std::size_t i) { follow(tracks_[i], levels); });
    drop_doubles();
    std::erase_if(tracks_, [](const Track& track) { return track.is_lost; });
    note_noise();
    replenish(smoothed);
    note_places();
    levels_ = std::move(levels);
    seen_.clear();
    for (const Track& track : tracks_) seen_.push_back({track.id, track.px, track.sigma_px});
    return seen_;
  }

 private:
  /// Predicts the curvature of each patch by perspective under the rotation since it was cut out, from all points seen
  /// then and in the previous frame.
  void predict_bends() {
    std::vector<PointMove> moves;
    for (const auto& [frame, places] : places_) {
      moves.clear();
      auto track = tracks_.begin();
      for (const auto& [id, px] : places) {
        while (track != tracks_.end() && track->id < id) ++track;
        if (track != tracks_.end() && track->id == id) moves.push_back({px, track->px});
      }
      const std::optional<ImageWarp> warp = ImageWarp::fit(moves);
      for (Track& each : tracks_)
        if (warp && each.anchor_frame == frame) each.pose.bend = warp->bend_at(each.anchor_px);
    }
  }

  /// Stores all points of this frame if a patch was cut out of it, until the last such patch is gone.
  void note_places() {
    const auto is_used = [&](std::size_t frame) {
      return std::ranges::any_of(tracks_, [&](const Track& track) { return track.anchor_frame == frame; });
    };
    std::erase_if(places_, [&](const auto& each) { return !is_used(each.first); });
    if (!is_used(frame_)) return;
    auto& places = places_[frame_];
    for (const Track& track : tracks_) places.emplace_back(track.id, track.px);
  }

  void follow(Track& track, const std::vector<cv::Mat>& levels) const {
    track.is_lost = true;
    const Eigen::Vector2d before = track.px;
    const auto moved = find_shifted(levels_, levels, before, before + track.flow_px);
    if (!moved) return;
    PatchPose start = track.pose;
    start.px += *moved - before;
    const PatchFit fit = track.patch.align(levels[0], start);
    if (!fit.converged || !is_alike(track, fit)) return;
    const Eigen::Vector2d now = fit.pose.px + fit.pose.linear * track.offset;
    if ((now - *moved).norm() > max_align_move_px) return;
    const auto returned = find_shifted(levels, levels_, now, before);
    if (!returned || (*returned - before).norm() > config_.max_return_px) return;
    track.pose = fit.pose;
    track.px = now;
    track.flow_px = now - before;
    track.sigma_px = sigma_of(fit.cov);
    track.noise = fit.rms / track.patch.rms_of_unit_noise();
    track.is_lost = track.sigma_px > config_.max_sigma_px;
    if (!track.is_lost && stretch_of(track.pose.linear) > config_.max_stretch)
      track.is_lost = !set_anchor(track, levels[0], frame_);
  }

  [[nodiscard]] bool is_alike(const Track& track, const PatchFit& fit) const {
    const double unlike = fit.rms / track.patch.contrast();
    return unlike * unlike < 1.0 - config_.min_likeness * config_.min_likeness && fit.pose.gain > min_gain &&
           fit.pose.gain < max_gain;
  }

  /// If two tracks have converged to one point, the younger one is dropped.
  void drop_doubles() {
    for (std::size_t i = 0; i < tracks_.size(); ++i)
      for (std::size_t j = 0; j < i && !tracks_[i].is_lost; ++j)
        if (!tracks_[j].is_lost &&
            (tracks_[i].px - tracks_[j].px).squaredNorm() < 0.25 * min_distance_px * min_distance_px)
          tracks_[i].is_lost = true;
  }

  /// Median over the tracks.
  void note_noise() {
    if (tracks_.empty()) return;
    std::vector<double> all;
    for (const Track& track : tracks_) all.push_back(track.noise);
    noise_ = median_of(std::move(all));
  }

  /// Adds points in empty cells: the sharpest corner of each. J. Shi & C. Tomasi, "Good features to track",
  /// 1994.
  void replenish(const cv::Mat& smoothed) {
    const Grid grid(smoothed, config_.max_tracks);
    std::vector<char> is_taken(static_cast<std::size_t>(grid.cols * grid.rows), 0);
    for (const Track& track : tracks_) is_taken[grid.cell_of(track.px)] = 1;
    const auto num_free = std::count(is_taken.begin(), is_taken.end(), 0);
    const auto room = config_.max_tracks - static_cast<std::ptrdiff_t>(tracks_.size());
    // Cells without corners stay empty: searching them in every frame would be wasted.
    const bool is_due = frames_since_search_ >= 5 || num_free > last_free_ + 5;
    ++frames_since_search_;
    if (room <= 0 || num_free == 0 || !is_due) return;
    frames_since_search_ = 0;
    for (const Eigen::Vector2i& corner : best_corners(smoothed, grid, is_taken)) {
      if (static_cast<int>(tracks_.size()) >= config_.max_tracks) break;
      begin_track(corner, smoothed);
    }
    std::fill(is_taken.begin(), is_taken.end(), 0);
    for (const Track& track : tracks_) is_taken[grid.cell_of(track.px)] = 1;
    last_free_ = std::count(is_taken.begin(), is_taken.end(), 0);
  }

  /// One per empty cell, in order of cells.
  [[nodiscard]] static std::vector<Eigen::Vector2i> best_corners(const cv::Mat& smoothed, const Grid& grid,
                                                                 const std::vector<char>& is_taken) {
    constexpr int block_px = 7, margin = AnchorPatch::margin_px;
    cv::Mat sharpness;
    cv::cornerMinEigenVal(smoothed, sharpness, block_px, 3);
    std::vector<float> best(is_taken.size(), 0.0f);
    std::vector<Eigen::Vector2i> place(is_taken.size(), Eigen::Vector2i(-1, -1));
    for (int v = margin; v < smoothed.rows - margin; ++v) {
      const float* row = sharpness.ptr<float>(v);
      for (int u = margin; u < smoothed.cols - margin; ++u) {
        const std::size_t cell = grid.cell_of({u, v});
        if (is_taken[cell] || row[u] <= best[cell]) continue;
        best[cell] = row[u];
        place[cell] = {u, v};
      }
    }
    std::erase_if(place, [](const Eigen::Vector2i& each) { return each.x() < 0; });
    return place;
  }

  void begin_track(const Eigen::Vector2i& corner, const cv::Mat& smoothed) {
    Track track;
    track.px = corner.cast<double>();
    for (const Track& other : tracks_)
      if ((other.px - track.px).squaredNorm() < min_distance_px * min_distance_px) return;
    if (!set_anchor(track, smoothed, frame_)) return;
    track.sigma_px = noise_ * sigma_of(track.patch.cov_of_unit_noise());
    if (!(track.sigma_px < config_.max_sigma_px)) return;
    track.noise = noise_;
    track.id = next_id_++;
    tracks_.push_back(std::move(track));
  }

  PointTrackerConfig config_;
  std::vector<cv::Mat> levels_;                                                 ///< Of the previous frame.
  std::vector<Track> tracks_;                                                   ///< In order of ids.
  std::map<std::size_t, std::vector<std::pair<int, Eigen::Vector2d>>> places_;  ///< By frame, then by id.
  std::vector<TrackedPoint> seen_;
  std::size_t frame_ = 0;
  int next_id_ = 0, frames_since_search_ = 1000;
  std::ptrdiff_t last_free_ = 0;
  double noise_ = first_noise;
};

PointTracker::PointTracker(const PointTrackerConfig& config) : impl_(std::make_unique<Impl>(config)) {}
PointTracker::PointTracker(PointTracker&&) noexcept = default;
PointTracker& PointTracker::operator=(PointTracker&&) noexcept = default;
PointTracker::~PointTracker() = default;

const std::vector<TrackedPoint>& PointTracker::update(const cv::Mat& grey) { return impl_->update(grey); }

}  // namespace alidade
