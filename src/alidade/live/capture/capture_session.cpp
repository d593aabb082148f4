#include "alidade/live/capture/capture_session.h"

#include <fmt/format.h>

#include <algorithm>
#include <opencv2/core.hpp>

#include "alidade/calibrate.h"
#include "alidade/files/files.h"
#include "alidade/images/photo_set.h"
#include "alidade/images/photos.h"

namespace alidade::live {
namespace {

constexpr double without_board_s = 60.0;
constexpr double frozen_s = 5.0;      // of a video: the same image to the bit
constexpr int frozen_images = 5;      // of a folder: one after the other
constexpr int enough_of_another = 3;  // images of another board in a row

std::uint64_t sum_of(const cv::Mat& grey) {
  std::uint64_t sum = 14695981039346656037ull;
  for (int row = 0; row < grey.rows; ++row) {
    const uchar* values = grey.ptr(row);
    for (int col = 0; col < grey.cols; ++col) sum = (sum ^ values[col]) * 1099511628211ull;
  }
  return sum;
}

std::string board_words(const Board& board) {
  return fmt::format("{} of {}×{} {}", kind_name(board.kind), board.cols, board.rows,
                     board.kind == BoardKind::chessboard ? "inner corners" : "points");
}

}  // namespace

CaptureSession::CaptureSession(const Board& board, const CaptureConfig& config, KeptPhotos photos,
                               std::function<void(const std::string&)> tell)
    : board_(board), config_(config), guide_(board, config), kept_(std::move(photos)), tell_(std::move(tell)) {
  for (const KeptPhoto& photo : kept_.photos()) {
    const std::filesystem::path path = kept_.path_of(photo);
    const cv::Mat grey = decode_photo(read_file(path), path.string());
    if (const std::string reason = guide_.take(grey); !reason.empty()) throw InputError(path.string() + ": " + reason);
    begin_s_ = std::max(begin_s_, photo.t_s);
  }
}

void CaptureSession::tell_once(const std::string& line) {
  if (std::ranges::find(given_, line) != given_.end()) return;
  given_.push_back(line);
  tell_(line);
}

/// What is wrong with the stream, however long it goes on.
void CaptureSession::note(const CaptureLook& look, const cv::Mat& grey, double t_s) {
  const std::uint64_t sum = sum_of(grey);
  const bool is_same = same_since_s_ && sum == last_sum_;
  last_sum_ = sum;
  num_same_ = is_same ? num_same_ + 1 : 1;
  if (!is_same) same_since_s_ = t_s;
  const bool is_frozen = config_.is_video ? t_s - *same_since_s_ >= frozen_s : num_same_ >= frozen_images;
  if (is_frozen) tell_once("the stream is frozen: the same image again and again, to the bit");
  const bool has_board = look.status != LookStatus::nothing && look.status != LookStatus::other_board;
  if (!board_seen_s_ || has_board) board_seen_s_ = t_s;
  num_other_ = look.status == LookStatus::other_board ? num_other_ + 1 : 0;
  if (num_other_ >= enough_of_another) {
    tell_once(fmt::format("{}; if it is the one to calibrate with: --board {}x{} (inner corners)", look.words,
                          look.other_cols, look.other_rows));
  }
  if (t_s - *board_seen_s_ >= without_board_s)
    tell_once("no board for a minute; what is looked for: a " + board_words(board_));
}

std::string CaptureSession::keep(const cv::Mat& grey, double t_s, bool is_exact) {
  if (const std::string reason = guide_.take(grey); !reason.empty()) return reason;
  kept_.add(grey, t_s, is_exact);
  // One of each kind: the figures in it change with each photo.
  for (const std::string& warning : guide_.state().warnings) {
    if (!has_warned_) tell_once(warning);
    has_warned_ = true;
  }
  return "";
}

CaptureSession::Seen CaptureSession::see(const cv::Mat& grey, double t_s, bool is_exact, bool is_again) {
  Seen seen{guide_.look(grey, t_s), ""};
  if (!is_again) note(seen.look, grey, t_s);
  all_exact_ = all_exact_ && is_exact;
  act(seen, grey, t_s, is_exact);
  return seen;
}

CaptureSession::Seen CaptureSession::look_back(double t_s) {
  Seen seen{guide_.look_back(t_s), ""};
  if (seen.look.earlier && seen.look.earlier->image) act(seen, *seen.look.earlier->image, t_s, all_exact_);
  return seen;
}

void CaptureSession::act(Seen& seen, const cv::Mat& grey, double t_s, bool is_exact) {
  if (!seen.look.take() || is_paused_) return;
  const std::optional<EarlierImage>& earlier = seen.look.earlier;
  const std::string reason = earlier ? keep(*earlier->image, earlier->t_s, all_exact_) : keep(grey, t_s, is_exact);
  if (!reason.empty()) {
    seen.look.status = LookStatus::little;
    seen.look.words = seen.look.words_mirrored = reason;
  } else {
    seen.file = kept_.photos().back().file;
  }
}

std::string CaptureSession::take(const cv::Mat& grey, double t_s, bool is_exact) { return keep(grey, t_s, is_exact); }

bool CaptureSession::undo() {
  if (!kept_.undo()) return false;
  guide_.forget(kept_.photos().size());
  return true;
}

bool CaptureSession::reached_goal(const Progress& progress) {
  constexpr std::size_t photos_between = 2;  // the whole job takes as long as a hundred looks
  const std::size_t num_photos = kept_.photos().size();
  if (!state().is_at(config_.until_px) || (checked_at_ > 0 && num_photos < checked_at_ + photos_between)) return false;
  checked_at_ = num_photos;
  const Calibration whole = calibrate(photos_in(kept_.folder()), board_, config_.calibrate, progress);
  if (whole.status != CalibrateReport::Status::converged) return false;
  guide_.correct(whole.next.worst_3sigma_px);
  if (whole.next.worst_3sigma_px > config_.until_px) return false;
  if (whole.verdict.ok()) return true;
  tell_once("the goal is reached, but " + whole.verdict.sentence);
  return false;
}

}  // namespace alidade::live
