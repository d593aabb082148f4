#pragma once

#include <optional>
#include <vector>

#include "alidade/estimation/verdict.h"
#include "alidade/pantilt/rotation_log.h"

namespace alidade {

/// Images that stand in a row of another time than theirs: frames were dropped before one and those behind numbered
/// through, or a frame was taken once more for the next, or inserted once more and those behind it numbered on.
struct FramePlaces {
  struct Gap {
    std::size_t before = 0;  ///< Row.
    int num = 0;
  };
  std::vector<Gap> missing;
  std::vector<std::size_t> repeated;  ///< Rows whose pixels are those of the row before.
  int num_inserted = 0;               ///< Of these behind which the images are in a row too late.
  std::vector<int> later;             ///< How many rows behind its own each image was taken; empty: none.

  [[nodiscard]] bool are_as_given() const { return missing.empty() && repeated.empty(); }
};

/// From the rotation between two images by all their points together, beside the measured one between their rows: at a
/// gap it is that of some rows more, of a repeated image none, until the next makes up for it or, behind one that was
/// inserted, does not. All images are placed together. As given where rows have no constant rate, or fewer than four
/// points in common.
[[nodiscard]] FramePlaces frame_places(const RotationLog& log);

/// The log with each image in the row of its time, repeated ones left out. Images behind its end have no row.
[[nodiscard]] RotationLog placed(const RotationLog& log, const FramePlaces& places);

/// By this name.
inline constexpr const char* frames_check = "frames";
[[nodiscard]] Check places_check(const RotationLog& log, const FramePlaces& places);

}  // namespace alidade
