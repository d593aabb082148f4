#pragma once

#include <functional>
#include <optional>
#include <span>
#include <string>
#include <vector>

#include "alidade/beam/beam.h"
#include "alidade/beam/shot.h"
#include "alidade/board/board.h"
#include "alidade/estimation/progress.h"
#include "alidade/spot/laser_spot.h"

namespace alidade {

/// Gives the photo of shot `i`, or with `laser_off` the one without the laser; empty where there is none. Called from
/// several threads. What it throws becomes that shot's reason.
using ShotPhotoLoader = std::function<cv::Mat(std::size_t i, bool laser_off)>;

struct ShotPhotosConfig {
  std::optional<Board> board = {};  ///< Looked for in every photo; none: spots only.
  bool find_spots = true;           ///< In photos of shots that bring no spot.
  LaserSpotConfig spot = {};
};

/// What was seen in the photo of one shot.
struct ShotPhoto {
  bool has_photo = false;
  std::string fault;              ///< Not readable, or of another size than the camera's; empty otherwise.
  std::string no_board, no_spot;  ///< Why there is none; empty where there is one, or where none was looked for.
  std::optional<LaserSpot> spot = {};
  std::string false_spot = {};  ///< What was taken for the spot at first, and why it is none; empty: nothing.
};

/// Looks for board and laser spot in the shots' photos and adds them to the shots: corners twice, the second time with
/// lens and pose known; the spot on the board's print where there is a board, else anywhere. The board is looked for in
/// the photo without laser where there is one.
[[nodiscard]] std::vector<ShotPhoto> look_at_photos(std::span<Shot> shots, const ShotPhotoLoader& load_photo,
                                                    const Camera& camera, const ShotPhotosConfig& config,
                                                    const Progress& progress = {});

/// Looks at the spots once more where the boards alone tell the beam: `by_boards` with its covariance. A light that is
/// not where the beam hits the board within 5σ is no spot (a sticker, the sun, a white square); where there were
/// two, the one that lies there is. Spots seen in fewer than a third of the photos in which the beam should be seen
/// are something else, too. The shots' spots are replaced.
void look_again_for_spots(std::span<Shot> shots, std::span<ShotPhoto> seen, const ShotPhotoLoader& load_photo,
                          const Camera& camera, const Beam& by_boards, const ShotPhotosConfig& config,
                          const Progress& progress = {});

}  // namespace alidade
