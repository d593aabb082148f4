#pragma once

#include <optional>
#include <span>
#include <vector>

#include "alidade/estimation/progress.h"
#include "alidade/imaging/photos.h"
#include "alidade/rangefinder/calibration.h"

namespace alidade {

struct ShotPhotosConfig {
  std::optional<Board> board = {};  ///< Looked for in every photo; none: spots only.
  bool find_spots = true;           ///< In photos of shots that bring no spot.
  LaserSpotConfig spot = {};
};

/// Looks for board and laser spot in the shots' photos and adds them to the shots: corners twice, the second time with
/// lens and pose known; the spot on the board's print where there is a board, else anywhere. The board is looked for in
/// the photo without laser where there is one. What is wrong with a photo stands in its shot.
[[nodiscard]] std::vector<ShotPhoto> look_at_photos(std::span<Shot> shots, const PhotoByName& load_photo,
                                                    const Camera& camera, const ShotPhotosConfig& config,
                                                    const Progress& progress = {});

/// Looks at the spots once more where the boards alone determine the beam: `by_boards` with its covariance. A light
/// that is not where the beam hits the board within 5σ is no spot (a sticker, the sun, a white square); where there
/// were two, the one that lies there is. Spots seen in fewer than a third of the photos in which the beam should be
/// seen are something else, too. The shots' spots are replaced.
void look_again_for_spots(std::span<Shot> shots, std::span<ShotPhoto> seen, const PhotoByName& load_photo,
                          const Camera& camera, const Beam& by_boards, const ShotPhotosConfig& config,
                          const Progress& progress = {});

}  // namespace alidade
