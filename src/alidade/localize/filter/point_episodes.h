#pragma once

#include <limits>
#include <map>
#include <span>
#include <unordered_map>
#include <vector>

#include "alidade/localize/localization.h"

namespace alidade {

/// A point that left the map and is seen again long after: the path has drifted meanwhile, and it is a new point of the
/// map, by a number of its own, until the loop is closed (loop_closure.h).
class PointEpisodes {
 public:
  /// The number by which the map has an observed point. `has_left`: whether the one that the map had last is not in it.
  template <typename HasLeft>
  long id_of(long number, std::size_t frame, const HasLeft& has_left) {
    constexpr std::size_t long_after = 100;  // frames: a gap so short costs little to bridge, and drifts little
    const auto [at, is_new] = now_.try_emplace(number, Episode{number, frame});
    Episode& episode = at->second;
    if (!is_new && frame > episode.last_frame + long_after && has_left(episode.id)) {
      episode.id = next_++;
      number_of_[episode.id] = number;
    }
    episode.last_frame = frame;
    return episode.id;
  }

  /// Of those that have another than their own.
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

/// A map by its points' own numbers: of each the one that is known best, those that were solved for first. `solved`:
/// their ids, growing.
void join_episodes(const PointEpisodes& episodes, std::span<const long> solved, std::vector<MapPoint>& map);

}  // namespace alidade
