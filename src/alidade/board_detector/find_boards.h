#pragma once

#include <cstddef>
#include <functional>
#include <vector>

#include "alidade/board/board.h"
#include "alidade/board_detector/find_board.h"
#include "alidade/estimation/progress.h"
#include "alidade/imaging/photos.h"

namespace alidade {

struct PhotoSize {
  int width_px = 0, height_px = 0;
};

/// The boards of many photos, in the order of the photos, with the size of every photo (0×0 if it could not be read).
struct BoardDetections {
  std::vector<BoardDetection> photos;
  std::vector<PhotoSize> sizes;
};

/// Detects the board in every photo, on all cores available to TBB; the result does not depend on their number. Only
/// as many photos as there are threads are in memory at a time. Throws Interrupted if `progress` returns false.
[[nodiscard]] BoardDetections find_boards(std::size_t num_photos, const PhotoLoader& load_photo, const Board& board,
                                          bool reject_partial = false, const Progress& progress = {});

/// A board's pose from a first calibration, for the second extraction. Photos without one are skipped.
struct KnownBoard {
  const BoardView* first = nullptr;  ///< As found before; null: skip this photo.
  Rigid3 cam_from_board;
};

/// refind_board() for every photo with a known board; a photo whose second extraction fails gets the reason.
[[nodiscard]] std::vector<BoardDetection> refind_boards(const std::vector<KnownBoard>& known,
                                                        const PhotoLoader& load_photo, const Board& board,
                                                        const Camera& camera, const Progress& progress = {});

}  // namespace alidade
