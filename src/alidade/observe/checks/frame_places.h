#pragma once

#include <optional>
#include <vector>

#include "alidade/estimation/verdict.h"
#include "alidade/pantilt/rotation_log.h"

namespace alidade {

/// Images stored in rows of another time than theirs: frames were dropped and the following ones numbered through, or a
/// frame was repeated in place of the next one, or inserted a second time and the following ones numbered on.
struct FramePlaces {
  struct Gap {
    std::size_t before = 0;  ///< Row before which frames are missing.
    int num = 0;
  };
  std::vector<Gap> missing;
  std::vector<std::size_t> repeated;  ///< Rows whose pixels repeat those of the row before.
  int num_inserted = 0;               ///< Of these, inserted ones: each makes the later images one row late.
  std::vector<int> later;             ///< Per image: how many rows after its own it was taken; empty: all in place.

  [[nodiscard]] bool are_as_given() const { return missing.empty() && repeated.empty(); }
};

/// Compares the rotation between two images, from all their points, with the measured one between
/// their rows: at a gap it is that of several rows more; at a repeated image it is zero, until the
/// next image makes up for it or, after an inserted one, does not. All images are placed jointly.
/// Returns them as given if rows have no constant rate, or have fewer than four points in common.
[[nodiscard]] FramePlaces frame_places(const RotationLog& log);

/// The log with each image in the row of its time and repeated ones removed. Images beyond its end are dropped.
[[nodiscard]] RotationLog placed(const RotationLog& log, const FramePlaces& places);

/// Name of the check that places_check() returns.
inline constexpr const char* frames_check = "frames";
[[nodiscard]] Check places_check(const RotationLog& log, const FramePlaces& places);

}  // namespace alidade
