#pragma once

#include <optional>
#include <span>
#include <vector>

#include "alidade/estimation/progress.h"
#include "alidade/imaging/photos.h"
#include "alidade/rangefinder/calibration.h"

namespace alidade {

struct ShotPhotosConfig {
  std::optional<Board> board = {};  ///< Searched for in every photo; none: spots only.
  bool find_spots = true;           ///< In photos of shots without a given spot.
  LaserSpotConfig spot = {};
};

/// Detects board and laser spot in the shots' photos and adds them to the shots: corners twice, the second time with
/// lens and pose known; the spot on the print of the board if there is one, else anywhere. The board is searched for in
/// the photo without laser if there is one. Problems with a photo are recorded in its shot.
[[nodiscard]] std::vector<ShotPhoto> look_at_photos(std::span<Shot> shots, const PhotoByName& load_photo,
                                                    const Camera& camera, const ShotPhotosConfig& config,
                                                    const Progress& progress = {});

/// Checks the spots again where the boards alone determine the beam: `by_boards` with its covariance. A light that is
/// not within 5σ of where the beam hits the board is not the spot (a sticker, the sun, a white square); of two
/// candidates, the one there is taken. Spots seen in fewer than a third of the photos in which the beam should be
/// visible are not the laser either. The shots' spots are replaced.
void look_again_for_spots(std::span<Shot> shots, std::span<ShotPhoto> seen, const PhotoByName& load_photo,
                          const Camera& camera, const Beam& by_boards, const ShotPhotosConfig& config,
                          const Progress& progress = {});

}  // namespace alidade
