#pragma once

#include <limits>
#include <map>
#include <span>
#include <unordered_map>
#include <vector>

#include "alidade/localize/localization.h"

namespace alidade {

/// A point that left the map and is observed again much later: the path has drifted meanwhile, so it becomes a new
/// point of the map, with its own number, until the loop is closed (loop_closure.h).
class PointEpisodes {
 public:
  /// The map's number of an observed point. `has_left`: whether the map no longer contains its last number.
  template <typename HasLeft>
  long id_of(long number, std::size_t frame, const HasLeft& has_left) {
    constexpr std::size_t long_after = 100;  // frames: shorter gaps are cheap to bridge and drift little
    const auto [at, is_new] = now_.try_emplace(number, Episode{number, frame});
    Episode& episode = at->second;
    if (!is_new && frame > episode.last_frame + long_after && has_left(episode.id)) {
      episode.id = next_++;
      number_of_[episode.id] = number;
    }
    episode.last_frame = frame;
    return episode.id;
  }

  /// Map number → own number, for those that differ.
  [[nodiscard]] const std::map<long, long>& number_of() const { return number_of_; }
  [[nodiscard]] long number(long id) const {
    const auto at = number_of_.find(id);
    return at == number_of_.end() ? id : at->second;
  }

 private:
  struct Episode {
    long id = 0;
    std::size_t last_frame = 0;
  };
  std::unordered_map<long, Episode> now_;
  std::map<long, long> number_of_;
  long next_ = std::numeric_limits<long>::min();
};

/// Renames the points of a map to their own numbers; among duplicates, keeps the one with the smallest σ, preferring
/// points that were solved for. `solved`: their ids, ascending.
void join_episodes(const PointEpisodes& episodes, std::span<const long> solved, std::vector<MapPoint>& map);

}  // namespace alidade
