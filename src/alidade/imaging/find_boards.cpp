#include "alidade/imaging/find_boards.h"

#include <tbb/parallel_for.h>

#include <atomic>
#include <exception>
#include <opencv2/core.hpp>

namespace alidade {
namespace {

constexpr const char* what = "looking for the board";

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

}  // namespace

BoardDetections find_boards(std::size_t num_photos, const PhotoLoader& load_photo, const Board& board,
                            bool reject_partial, const Progress& progress) {
  BoardDetections found{.photos = std::vector<BoardDetection>(num_photos), .sizes = std::vector<PhotoSize>(num_photos)};
  std::atomic<std::size_t> done{0};
  report_progress(progress, what, 0, num_photos);
  // One photo a task: photos differ in cost, and a thread holds one photo at a time.
  tbb::parallel_for(
      tbb::blocked_range<std::size_t>(0, num_photos, 1),
      [&](const tbb::blocked_range<std::size_t>& range) {
        for (std::size_t i = range.begin(); i < range.end(); ++i) {
          found.photos[i] = find_in(load_photo, i, board, reject_partial, found.sizes[i]);
          report_progress(progress, what, ++done, num_photos);
        }
      },
      tbb::simple_partitioner{});
  return found;
}

}  // namespace alidade
