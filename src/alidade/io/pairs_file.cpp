#include "alidade/io/pairs_file.h"

#include <algorithm>
#include <map>
#include <set>
#include <tuple>

#include "alidade/io/table_rows.h"

namespace alidade {
namespace {

struct Names {
  std::string frame_a, frame_b, ua, va, ub, vb;
};

Names names_in(const Csv& csv) {
  const auto either = [&](const char* first, const char* second) { return csv.has(second) ? second : first; };
  const Names names{either("frame_a", "image_a"), either("frame_b", "image_b"), either("ua_px", "ua"),
                    either("va_px", "va"),        either("ub_px", "ub"),        either("vb_px", "vb")};
  csv.require(std::vector<std::string>{names.frame_a, names.frame_b, names.ua, names.va, names.ub, names.vb});
  return names;
}

struct Match {
  std::string frame_a, frame_b;
  Eigen::Vector2d px_a, px_b;
};

Match read_match(const Csv& csv, const Names& names, std::size_t row) {
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

/// Points grown from matches: sets of places (frame, pixel), each frame once in a set.
class Tracks {
 public:
  std::size_t frame(const std::string& name) { return frames_.try_emplace(name, frames_.size()).first->second; }
  [[nodiscard]] std::size_t num_frames() const { return frames_.size(); }

  [[nodiscard]] std::size_t num_points() const {
    return static_cast<std::size_t>(std::ranges::count_if(tracks_, [](const Track& t) { return t.size() > 1; }));
  }

  /// Joins the points of both places. False: the match is known.
  bool add(const Match& match) {
    const Place at_a{frame(match.frame_a), match.px_a.x(), match.px_a.y()};
    const Place at_b{frame(match.frame_b), match.px_b.x(), match.px_b.y()};
    if (!matches_.emplace(std::min(at_a, at_b), std::max(at_a, at_b)).second) return false;
    const std::size_t a = track_of(at_a), b = track_of(at_b);
    if (a == b) return true;
    const bool contradict =
        std::ranges::any_of(tracks_[b], [&](const auto& seen) { return tracks_[a].contains(seen.first); });
    if (contradict) {
      parent_.push_back(tracks_.size());
      tracks_.push_back({{std::get<0>(at_a), match.px_a}, {std::get<0>(at_b), match.px_b}});
    } else {
      tracks_[a].merge(tracks_[b]);
      tracks_[b].clear();
      parent_[b] = a;
    }
    return true;
  }

  /// Points that two frames or more see: a row a frame.
  [[nodiscard]] std::vector<RotationRow> rows() const {
    std::vector<RotationRow> rows(frames_.size());
    for (std::size_t k = 0; k < rows.size(); ++k) rows[k].t_s = static_cast<double>(k);
    for (const Track& track : tracks_) {
      if (track.size() < 2) continue;
      for (std::size_t k = 0; k < rows.size(); ++k) {
        const auto seen = track.find(k);
        rows[k].px.push_back(seen == track.end() ? Eigen::Vector2d(Eigen::Vector2d::Constant(not_seen)) : seen->second);
      }
    }
    return rows;
  }

 private:
  using Track = std::map<std::size_t, Eigen::Vector2d>;   // frame → pixel
  using Place = std::tuple<std::size_t, double, double>;  // frame, pixel

  std::size_t track_of(const Place& place) {
    const auto [it, is_new] = track_.try_emplace(place, tracks_.size());
    if (is_new) {
      parent_.push_back(tracks_.size());
      tracks_.push_back({{std::get<0>(place), {std::get<1>(place), std::get<2>(place)}}});
    }
    std::size_t root = it->second;
    while (parent_[root] != root) root = parent_[root] = parent_[parent_[root]];
    return root;
  }

  std::map<std::string, std::size_t> frames_;
  std::map<Place, std::size_t> track_;  // where it began
  std::vector<Track> tracks_;           // empty: joined with another
  std::vector<std::size_t> parent_;     // a track that it was joined with, or itself
  std::set<std::pair<Place, Place>> matches_;
};

}  // namespace

RotationLogFile read_pairs(const std::filesystem::path& file, const RotationLogOptions& options) {
  constexpr std::size_t most_cells = 50'000'000;  // frames × points: 0.8 GB
  const Csv csv = Csv::read(file);
  const Names names = names_in(csv);
  Tracks tracks;
  RotationLogFile read;
  read.log.source = RotationSource::none;
  for_each_row(csv, options.skip_bad, read.skipped, [&](std::size_t row) {
    if (!tracks.add(read_match(csv, names, row))) read.skipped.push_back(skipped_row(csv, row, "repeated row"));
  });
  if (tracks.num_frames() < 2) throw InputError(file.string() + ": has no matches; at least one row is needed");
  if (tracks.num_points() > most_cells / tracks.num_frames())
    throw InputError(file.string() + ": has too many frames and points; match fewer at a time");
  read.log.rows = tracks.rows();
  read.log.num_points = read.log.rows.front().px.size();
  return read;
}

}  // namespace alidade
