#include "alidade/live/capture/shot_session.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <opencv2/core.hpp>

#include "alidade/files/csv.h"
#include "alidade/files/files.h"
#include "alidade/images/photos.h"
#include "alidade/rangefinder/shot_photos.h"

namespace alidade::live {

ShotSession::ShotSession(const Camera& camera, const RangefinderConfig& config, const ShotConfig& where,
                         KeptPhotos photos)
    : camera_(camera),
      config_(config),
      looker_(*config.board),
      guide_(camera, config, where),
      kept_(std::move(photos)) {
  if (!kept_.photos().empty()) go_on();
}

/// Photos that have no reading (killed between the two) stay on disk, and are no shots.
void ShotSession::go_on() {
  const Csv csv = Csv::read(table());
  csv.require(std::vector<std::string>{"range_m", "photo"});
  for (std::size_t row = 0; row < csv.num_rows(); ++row) {
    const std::filesystem::path photo = table().parent_path() / csv.text(row, "photo");
    const Shot shot = measured(decode_photo(read_file(photo), photo.string()), csv.number(row, "range_m"));
    if (!shot.board) throw InputError(photo.string() + ": " + shot.no_board);
    rows_.push_back({shot.range_m, csv.text(row, "photo")});
    history_m_.push_back(guide_.push(shot).sigma_origin_m);
  }
  begin_s_ = kept_.photos().back().t_s;
}

Shot ShotSession::measured(const cv::Mat& grey, double range_m) const {
  std::vector<Shot> shots{Shot{.range_m = range_m, .name = "shot", .photo = "shot"}};
  ShotPhotosConfig photos{.board = config_.board, .find_spots = config_.method != RangefinderMethod::plane};
  photos.spot.colour = config_.spot;
  const auto seen = look_at_photos(
      shots, [&grey](const std::string&) { return grey; }, camera_, photos);
  if (!seen.front().fault.empty()) shots.front().no_board = "the image " + seen.front().fault;
  return std::move(shots.front());
}

std::string ShotSession::take(const cv::Mat& grey, double t_s, bool is_exact, double range_m) {
  if (!std::isfinite(range_m) || !(range_m > 0.0)) return "the reading is no distance";
  const Shot shot = measured(grey, range_m);
  if (!shot.board) return shot.no_board.empty() ? "no board in view" : shot.no_board;
  history_m_.push_back(guide_.push(shot).sigma_origin_m);
  rows_.push_back({range_m, "photos/" + kept_.add(grey, t_s, is_exact).file});
  write_table();
  return "";
}

bool ShotSession::undo() {
  if (rows_.empty()) return false;
  rows_.pop_back();
  history_m_.pop_back();
  write_table();
  guide_.undo();
  return kept_.undo();
}

void ShotSession::write_table() const {
  std::string text = "range_m,photo\n";
  for (const Row& row : rows_) text += fmt::format("{},{}\n", row.range_m, row.photo);
  write_file(table(), text);
}

}  // namespace alidade::live
