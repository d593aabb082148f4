#include "alidade/board_detector/find_boards.h"

#include <tbb/parallel_for.h>

#include <atomic>
#include <exception>
#include <opencv2/core.hpp>

namespace alidade {
namespace {

BoardDetection find_in(const PhotoLoader& load_photo, std::size_t i, const Board& board, bool reject_partial,
                       PhotoSize& size) {
  try {
    const cv::Mat photo = load_photo(i);
    size = {photo.cols, photo.rows};
    return find_board(photo, board, reject_partial);
  } catch (const Interrupted&) {
    throw;
  } catch (const std::exception& error) {
    return {.view = {}, .reason = error.what()};
  }
}

/// Calls `work(i)` for every photo on all threads, one photo a task: photos differ in cost, and a thread holds one at a
/// time.
template <class Work>
void for_each_photo(std::size_t num_photos, std::string_view what, const Progress& progress, const Work& work) {
  std::atomic<std::size_t> done{0};
  report_progress(progress, what, 0, num_photos);
  tbb::parallel_for(
      tbb::blocked_range<std::size_t>(0, num_photos, 1),
      [&](const tbb::blocked_range<std::size_t>& range) {
        for (std::size_t i = range.begin(); i < range.end(); ++i) {
          work(i);
          report_progress(progress, what, ++done, num_photos);
        }
      },
      tbb::simple_partitioner{});
}

}  // namespace

BoardDetections find_boards(std::size_t num_photos, const PhotoLoader& load_photo, const Board& board,
                            bool reject_partial, const Progress& progress) {
  BoardDetections found{.photos = std::vector<BoardDetection>(num_photos), .sizes = std::vector<PhotoSize>(num_photos)};
  for_each_photo(num_photos, "looking for the board", progress, [&](std::size_t i) {
    found.photos[i] = find_in(load_photo, i, board, reject_partial, found.sizes[i]);
  });
  return found;
}

std::vector<BoardDetection> refind_boards(const std::vector<KnownBoard>& known, const PhotoLoader& load_photo,
                                          const Board& board, const Camera& camera, const Progress& progress) {
  std::vector<BoardDetection> found(known.size());
  for_each_photo(known.size(), "extracting the corners again", progress, [&](std::size_t i) {
    if (known[i].first == nullptr) return;
    try {
      found[i] = refind_board(load_photo(i), board, *known[i].first, camera, known[i].cam_from_board);
    } catch (const Interrupted&) {
      throw;
    } catch (const std::exception& error) {
      found[i].reason = error.what();
    }
  });
  return found;
}

}  // namespace alidade
