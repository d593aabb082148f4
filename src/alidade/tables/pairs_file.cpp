#include "alidade/tables/pairs_file.h"

#include <fmt/format.h>

#include <algorithm>
#include <map>
#include <set>
#include <string>
#include <tuple>
#include <utility>

#include "alidade/files/table_rows.h"
#include "alidade/tables/logs/rotation_log_columns.h"

namespace alidade {
namespace {

struct PairColumns {
  std::string frame_a, frame_b, ua, va, ub, vb;
};

PairColumns pair_columns_in(const Csv& csv) {
  const auto either = [&](const char* first, const char* second) { return csv.has(second) ? second : first; };
  const PairColumns names{either("frame_a", "image_a"), either("frame_b", "image_b"), either("ua_px", "ua"),
                          either("va_px", "va"),        either("ub_px", "ub"),        either("vb_px", "vb")};
  csv.require(std::vector<std::string>{names.frame_a, names.frame_b, names.ua, names.va, names.ub, names.vb});
  return names;
}

struct Match {
  std::string frame_a, frame_b;
  Eigen::Vector2d px_a, px_b;
};

Match read_match(const Csv& csv, const PairColumns& names, std::size_t row) {
  const auto pixel = [&](const std::string& column) {
    return csv_pixel(csv.text(row, column), {csv.name(), csv.line(row), column});
  };
  Match match{csv.text(row, names.frame_a), csv.text(row, names.frame_b), {}, {}};
  if (match.frame_a.empty()) throw InputError(csv.where(row, names.frame_a) + ": is empty; a frame's name is needed");
  if (match.frame_b.empty()) throw InputError(csv.where(row, names.frame_b) + ": is empty; a frame's name is needed");
  if (match.frame_a == match.frame_b)
    throw InputError(csv.where(row, names.frame_b) + ": '" + match.frame_b + "' is matched with itself");
  match.px_a = {pixel(names.ua), pixel(names.va)};
  match.px_b = {pixel(names.ub), pixel(names.vb)};
  return match;
}

/// Frames, their features and the pairs, as the rows come.
class MatchesSoFar {
 public:
  /// False: the match is known.
  bool add(const Match& match) {
    int photo_a = photo(match.frame_a), photo_b = photo(match.frame_b);
    FeatureMatch features{feature(photo_a, match.px_a), feature(photo_b, match.px_b)};
    if (photo_a > photo_b) {
      std::swap(photo_a, photo_b);
      std::swap(features.a, features.b);
    }
    if (!known_.emplace(photo_a, photo_b, features.a, features.b).second) return false;
    const auto [it, is_new] = pairs_.try_emplace({photo_a, photo_b}, photos.pairs.size());
    if (is_new) photos.pairs.push_back({photo_a, photo_b, {}});
    photos.pairs[it->second].matches.push_back(features);
    return true;
  }

  MatchedPhotos photos;

 private:
  int photo(const std::string& name) {
    const auto [it, is_new] = photos_.try_emplace(name, static_cast<int>(photos_.size()));
    if (is_new) {
      photos.names.push_back(name);
      photos.features.emplace_back();
      features_.emplace_back();
    }
    return it->second;
  }

  int feature(int photo, const Eigen::Vector2d& px) {
    const auto at = static_cast<std::size_t>(photo);
    const auto [it, is_new] = features_[at].try_emplace({px.x(), px.y()}, static_cast<int>(features_[at].size()));
    if (is_new) photos.features[at].push_back(px);
    return it->second;
  }

  std::map<std::string, int> photos_;
  std::vector<std::map<std::pair<double, double>, int>> features_;  // by pixel
  std::map<std::pair<int, int>, std::size_t> pairs_;
  std::set<std::tuple<int, int, int, int>> known_;
};

}  // namespace

PairsFile read_pairs(const std::filesystem::path& file, bool skip_bad) {
  constexpr std::size_t max_frames = 2000;
  const Csv csv = Csv::read(file, skip_bad);
  const PairColumns names = pair_columns_in(csv);
  MatchesSoFar matches;
  PairsFile read;
  for_each_row(csv, skip_bad, read.skipped, [&](std::size_t row) {
    if (!matches.add(read_match(csv, names, row))) read.skipped.push_back(skipped_row(csv, row, "repeated row"));
  });
  if (matches.photos.names.size() < 2) throw InputError(file.string() + ": has no matches; at least one row is needed");
  if (matches.photos.names.size() > max_frames)
    throw InputError(file.string() + ": has more than 2000 frames; match fewer at a time");
  read.photos = std::move(matches.photos);
  return read;
}

void require_features_inside(const MatchedPhotos& photos, const std::filesystem::path& file) {
  if (photos.width_px <= 0) return;
  std::size_t outside = 0, all = 0;
  for (const auto& features : photos.features) {
    for (const Eigen::Vector2d& px : features) {
      const bool inside = px.minCoeff() > -1.0 && px.x() < photos.width_px && px.y() < photos.height_px;
      outside += inside ? 0 : 1;
      ++all;
    }
  }
  if (20 * outside <= all) return;
  throw InputError(fmt::format("{}: {} of {} points lie outside an image of {}x{} px: check --size", file.string(),
                               outside, all, photos.width_px, photos.height_px));
}

std::string pairs_csv(const MatchedPhotos& photos) {
  std::string text = "frame_a,frame_b,ua_px,va_px,ub_px,vb_px\n";
  for (const MatchedPair& pair : photos.pairs) {
    const auto a = static_cast<std::size_t>(pair.photo_a), b = static_cast<std::size_t>(pair.photo_b);
    for (const FeatureMatch& match : pair.matches) {
      const Eigen::Vector2d& in_a = photos.features[a][static_cast<std::size_t>(match.a)];
      const Eigen::Vector2d& in_b = photos.features[b][static_cast<std::size_t>(match.b)];
      text += fmt::format("{},{},{:.4f},{:.4f},{:.4f},{:.4f}\n", photos.names[a], photos.names[b], in_a.x(), in_a.y(),
                          in_b.x(), in_b.y());
    }
  }
  return text;
}

}  // namespace alidade
