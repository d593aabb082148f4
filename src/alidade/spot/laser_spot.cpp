#include "alidade/spot/laser_spot.h"

#include <algorithm>
#include <cmath>
#include <opencv2/core.hpp>

#include "alidade/spot/spot_candidates.h"
#include "alidade/spot/spot_fit.h"
#include "alidade/spot/spot_signal.h"

namespace alidade {
namespace {

std::string at_pixel(const Eigen::Vector2d& px) {
  return "(" + std::to_string(std::lround(px.x())) + ", " + std::to_string(std::lround(px.y())) + ")";
}

constexpr int green = 1, red = 2, grey = 3;

/// One channel with its candidates, in pixels of the photo.
struct Channel {
  int index;  ///< Of BGR; 3 is the grey photo.
  SpotSignal signal;
  std::vector<SpotCandidate> candidates;

  [[nodiscard]] Eigen::Vector2d px(const SpotCandidate& spot) const {
    return spot.px + Eigen::Vector2d(signal.u_min, signal.v_min);
  }
  [[nodiscard]] double strongest() const { return candidates.empty() ? 0.0 : candidates.front().strength; }
};

std::vector<int> channels_for(const cv::Mat& photo, SpotColour colour) {
  if (photo.channels() < 3 || colour == SpotColour::bright) return {grey};
  if (colour == SpotColour::red) return {red};
  if (colour == SpotColour::green) return {green};
  return {red, green};
}

/// A light of comparable strength elsewhere, in any channel: what its own light leaks into other channels lies at the
/// same place, and patches within its disc are parts of it that speckle or compression cut off.
const SpotCandidate* rival_of(const Channel& best, const std::vector<Channel>& channels, const LaserSpotConfig& config,
                              Eigen::Vector2d& px) {
  const SpotCandidate& spot = best.candidates.front();
  for (const Channel& channel : channels) {
    for (const SpotCandidate& other : channel.candidates) {
      px = channel.px(other);
      const bool is_same = (px - best.px(spot)).norm() < 2.0 * std::max(spot.radius_px, other.radius_px) + 2.0;
      const bool is_part = (px - best.px(spot)).norm() < 3.0 * spot.radius_px + 1.0 && best.signal.is_interpolated;
      if (&other != &spot && !is_part && !(is_same && &channel != &best) &&
          other.strength >= config.rival_share * spot.strength)
        return &other;
    }
  }
  return nullptr;
}

/// Whether the grey photo has at least half of the light that a channel's excess adds to it: a laser's has, what
/// compression makes of the colours at a print's edges has none, but blurs them alone.
bool is_in_grey(const cv::Mat& photo, const LaserSpotAids& aids, const Channel& best) {
  const SpotSignal in_grey = spot_signal(photo, grey, aids);
  if (!in_grey.reason.empty()) return true;
  const SpotCandidate& spot = best.candidates.front();
  const float share = best.index == red ? 0.299F : 0.587F;
  float light = 0.0F, excess = 0.0F;
  for (Eigen::Index v = 0; v < in_grey.light.rows(); ++v) {
    for (Eigen::Index u = 0; u < in_grey.light.cols(); ++u) {
      const Eigen::Vector2d px(static_cast<double>(u), static_cast<double>(v));
      if ((px - spot.px).norm() > 2.0 * spot.radius_px) continue;
      light += in_grey.light(v, u);
      excess += best.signal.detected(v, u);
    }
  }
  return light >= 0.5F * share * excess;
}

LaserSpot no_spot(std::string reason) {
  LaserSpot spot;
  spot.reason = std::move(reason);
  return spot;
}

bool is_blown_out(const SpotSignal& signal) {
  const auto num_region = (signal.is_in_region > 0).count();
  const auto num_saturated = (signal.is_in_region > 0 && signal.is_saturated > 0).count();
  return 2 * num_saturated > num_region;
}

}  // namespace

LaserSpot find_laser_spot(const cv::Mat& photo, const LaserSpotAids& aids, const LaserSpotConfig& config) {
  std::vector<Channel> channels;
  for (const int channel : channels_for(photo, config.colour)) {
    channels.push_back({channel, spot_signal(photo, channel, aids), {}});
    SpotSignal& signal = channels.back().signal;
    if (!signal.reason.empty()) return no_spot(signal.reason);
    if (is_blown_out(signal)) return no_spot("the photo is blown out");
    channels.back().candidates = spot_candidates(signal, config);
  }
  const Channel& best = *std::max_element(channels.begin(), channels.end(), [](const Channel& a, const Channel& b) {
    return a.strongest() < b.strongest();
  });
  if (best.candidates.empty()) return no_spot("no laser spot");
  const SpotCandidate& candidate = best.candidates.front();
  Eigen::Vector2d rival_px;
  if (rival_of(best, channels, config, rival_px) != nullptr)
    return no_spot("two candidates at " + at_pixel(best.px(candidate)) + " and " + at_pixel(rival_px));
  const bool is_of_colours = best.signal.is_excess && best.signal.is_interpolated && !candidate.is_saturated;
  const bool has_print = aids.seen_board && aids.seen_board->board.kind == BoardKind::chessboard;
  if (is_of_colours && has_print && !is_in_grey(photo, aids, best))
    return no_spot("no laser spot: at " + at_pixel(best.px(candidate)) +
                   " the colour differs, the brightness does not");
  if (!candidate.reason.empty())
    return no_spot("the laser spot at " + at_pixel(best.px(candidate)) + " " + candidate.reason);
  const SpotPlace place = measure_spot(best.signal, candidate);
  if (!place.reason.empty()) return no_spot(place.reason);
  return {.px = place.px + Eigen::Vector2d(best.signal.u_min, best.signal.v_min),
          .cov = place.cov,
          .peak = place.peak,
          .radius_px = place.radius_px,
          .is_saturated = candidate.is_saturated,
          .is_on_edge = place.is_on_edge,
          .reason = {}};
}

}  // namespace alidade
