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

/// The boards of many photos, in the photos' order, with the size of every photo (0×0 where it could not be read).
struct BoardDetections {
  std::vector<BoardDetection> photos;
  std::vector<PhotoSize> sizes;
};

/// Finds the board in every photo, on all cores that TBB is allowed; the answer does not depend on their number. Only
/// as many photos as there are threads are in memory at a time. Throws Interrupted when `progress` says stop.
[[nodiscard]] BoardDetections find_boards(std::size_t num_photos, const PhotoLoader& load_photo, const Board& board,
                                          bool reject_partial = false, const Progress& progress = {});

/// A board's pose by a first calibration, for the second extraction. Photos without one are left alone.
struct KnownBoard {
  const BoardView* first = nullptr;  ///< As found before; null: leave this photo alone.
  Rigid3 cam_from_board;
};

/// refind_board() for every photo with a known board; a photo whose second extraction fails gets the reason.
[[nodiscard]] std::vector<BoardDetection> refind_boards(const std::vector<KnownBoard>& known,
                                                        const PhotoLoader& load_photo, const Board& board,
                                                        const Camera& camera, const Progress& progress = {});

}  // namespace alidade
