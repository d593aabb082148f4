#include "alidade/localize/map/moved_points.h"

#include <algorithm>
#include <array>
#include <map>
#include <set>
#include <unordered_map>

#include "alidade/localize/frames/known_map.h"
#include "alidade/localize/path/path_resection.h"

// If half of a map has moved, a filter that starts in it takes a pose between both halves, or that of the one seen
// first: it gates by its predictions. Poses of single frames are independent of each other.

namespace alidade {
namespace {

constexpr std::size_t least_seen = 8, least_of_frame = 12, enough_frames = 3;

/// The map's points in one frame, and sets of them that fit one pose: the largest set, and that of the rest.
struct Sighting {
  std::vector<long> ids;
  std::vector<std::vector<bool>> fits;
};

using SavedById = std::unordered_map<long, const SavedPoint*>;

/// The pose that most points fit. Empty: too few do.
std::optional<CameraResection> pose_of_most(const Camera& camera, std::span<const PlacedObservation> some,
                                            std::span<const PlacedObservation> all) {
  constexpr int num_draws = 150;  // with two halves, one in eight triples is all from a given one
  constexpr std::size_t max_poses = 12;
  constexpr double gate = 13.8, near_px = 6.0;
  if (some.size() < least_seen) return std::nullopt;
  std::optional<CameraResection> best;
  for (const Rigid3& pose : poses_of_threes(camera, some, num_draws, max_poses)) {
    const std::array<Rigid3, 1> from{pose};
    auto there = resection(camera, some, from, gate, near_px);
    if (there && there->num_fit >= least_seen && (!best || there->cost < best->cost)) best = std::move(there);
  }
  if (!best) return std::nullopt;
  const std::array<Rigid3, 1> from{best->world_from_cam};
  return resection(camera, all, from, gate, near_px);
}

Sighting sighting_of(const Camera& camera, const ObservationFrame& frame, const SavedById& map, double sigma_px) {
  constexpr int most_parts = 2;
  Sighting sighting;
  std::vector<PlacedObservation> placed;
  for (const FeatureObservation& each : frame.observations) {
    const auto at = map.find(each.id);
    if (at == map.end()) continue;
    sighting.ids.push_back(each.id);
    placed.push_back({each.px, std::max(sigma_px, each.sigma_px), at->second->point_in_world, at->second->cov});
  }
  std::vector<bool> is_placed(placed.size(), false);
  for (int part = 0; part < most_parts; ++part) {
    std::vector<PlacedObservation> rest;
    for (std::size_t i = 0; i < placed.size(); ++i)
      if (!is_placed[i]) rest.push_back(placed[i]);
    auto found = pose_of_most(camera, rest, placed);
    if (!found || found->num_fit < least_seen) break;
    for (std::size_t i = 0; i < placed.size(); ++i) is_placed[i] = is_placed[i] || found->fits[i];
    sighting.fits.push_back(std::move(found->fits));
  }
  return sighting;
}

/// The frames to evaluate, spread over those with enough points of the map.
std::vector<const ObservationFrame*> frames_to_judge(std::span<const ObservationFrame> frames, const SavedById& map) {
  constexpr std::size_t most = 24;
  std::vector<const ObservationFrame*> enough;
  for (const ObservationFrame& frame : frames) {
    const auto num = std::ranges::count_if(frame.observations, [&](const auto& each) { return map.contains(each.id); });
    if (static_cast<std::size_t>(num) >= least_of_frame) enough.push_back(&frame);
  }
  std::vector<const ObservationFrame*> chosen;
  const std::size_t num = std::min(most, enough.size());
  for (std::size_t i = 0; i < num; ++i) chosen.push_back(enough[i * enough.size() / num]);
  return chosen;
}

/// Per point: in how many frames it fitted, and in how many it was seen.
struct Votes {
  std::map<long, std::pair<std::size_t, std::size_t>> of_point;

  void add(const Sighting& sighting, const std::vector<bool>& fits) {
    for (std::size_t i = 0; i < sighting.ids.size(); ++i) {
      auto& [num_fit, num_seen] = of_point[sighting.ids[i]];
      num_fit += fits[i] ? 1 : 0;
      ++num_seen;
    }
  }
  /// Agreement of a set with the votes so far.
  [[nodiscard]] double agreement(const Sighting& sighting, const std::vector<bool>& fits) const {
    double sum = 0.0;
    for (std::size_t i = 0; i < sighting.ids.size(); ++i) {
      const auto at = of_point.find(sighting.ids[i]);
      if (at == of_point.end()) continue;
      const double share = static_cast<double>(at->second.first) / static_cast<double>(at->second.second);
      sum += (fits[i] ? 1.0 : -1.0) * (share - 0.5);
    }
    return sum;
  }
};

/// Votes of the sets that agree with the largest one, frame by frame from there on, then backwards.
Votes votes_of(std::span<const Sighting> sightings) {
  const auto largest = std::ranges::max_element(
      sightings, {}, [](const Sighting& each) { return std::ranges::count(each.fits.front(), true); });
  Votes votes;
  votes.add(*largest, largest->fits.front());
  const auto add = [&](const Sighting& each) {
    const auto agreeing = std::ranges::max_element(
        each.fits, {}, [&](const std::vector<bool>& fits) { return votes.agreement(each, fits); });
    if (votes.agreement(each, *agreeing) > 0.0) votes.add(each, *agreeing);
  };
  std::for_each(largest + 1, sightings.end(), add);
  std::for_each(std::make_reverse_iterator(largest), sightings.rend(), add);
  return votes;
}

std::vector<Sighting> sightings_of(const Camera& camera, std::span<const ObservationFrame> frames, const SavedById& map,
                                   double sigma_px) {
  std::vector<Sighting> sightings;
  for (const ObservationFrame* frame : frames_to_judge(frames, map))
    sightings.push_back(sighting_of(camera, *frame, map, sigma_px));
  std::erase_if(sightings, [](const Sighting& each) { return each.fits.empty(); });
  return sightings;
}

/// Number of points that one pose fits, median over the frames.
std::size_t num_as_one(std::span<const Sighting> sightings) {
  if (sightings.empty()) return 0;
  std::vector<std::size_t> nums;
  for (const Sighting& each : sightings)
    nums.push_back(static_cast<std::size_t>(std::ranges::count(each.fits.front(), true)));
  const auto middle = nums.begin() + static_cast<std::ptrdiff_t>(nums.size() / 2);
  std::ranges::nth_element(nums, middle);
  return *middle;
}

/// Points that fit in less than a third of their frames. `num_judged`: how many were judged.
std::set<long> misfits_of(std::span<const Sighting> sightings, std::size_t& num_judged) {
  std::set<long> ids;
  num_judged = 0;
  if (sightings.size() < enough_frames) return ids;
  for (const auto& [id, votes] : votes_of(sightings).of_point) {
    const auto& [num_fit, num_seen] = votes;
    if (num_seen < enough_frames) continue;
    ++num_judged;
    if (3 * num_fit < num_seen) ids.insert(id);
  }
  return ids;
}

}  // namespace

MovedMapPoints moved_map_points(const Camera& camera, std::span<const ObservationFrame> frames, const SavedMap& map,
                                double sigma_px) {
  constexpr int most_rounds = 5;  // a pose between two parts that are close together fits many of both
  SavedById still, gone;
  for (const KnownPoint& known : known_points(map))
    still[known.id] = &*std::ranges::find(map.points, known.id, &SavedPoint::id);
  MovedMapPoints moved;
  for (int round = 0; round < most_rounds; ++round) {
    std::size_t num_judged = 0;
    const std::set<long> misfits = misfits_of(sightings_of(camera, frames, still, sigma_px), num_judged);
    if (round == 0) moved.num_judged = num_judged;
    const std::size_t num_fit = num_judged - misfits.size();
    if (misfits.empty() || num_fit < least_seen || 5 * num_fit < moved.num_judged) break;
    for (const long id : misfits) gone.insert(still.extract(id));
  }
  for (const auto& [id, point] : gone) moved.ids.push_back(id);
  std::ranges::sort(moved.ids);
  for (const long id : moved.ids) moved.places.push_back(gone.at(id)->point_in_world);
  moved.num_as_one = num_as_one(sightings_of(camera, frames, gone, sigma_px));
  return moved;
}

}  // namespace alidade
