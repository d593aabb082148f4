#include "alidade/matching/match_photos.h"

#include <tbb/parallel_for.h>

#include <algorithm>
#include <atomic>
#include <map>
#include <opencv2/core.hpp>

namespace alidade {
namespace {

constexpr std::size_t min_features = 8;

using Size = std::pair<int, int>;

std::string words(const Size& size) { return std::to_string(size.first) + "x" + std::to_string(size.second); }

/// The most frequent size of the photos; among equally frequent ones, that of the first photo.
Size usual_size(const std::vector<Size>& sizes) {
  std::map<Size, int> count;
  Size usual;
  for (const Size& size : sizes) {
    if (size.first > 0) ++count[size];
  }
  for (const Size& size : sizes) {
    if (size.first > 0 && count[size] > count[usual]) usual = size;
  }
  return usual;
}

std::string other_size(const Size& size, const Size& usual) {
  const bool is_turned = size.first == usual.second && size.second == usual.first;
  return "is " + words(size) + ", but most photos are " + words(usual) +
         (is_turned ? ": its pixels were turned; take it from the camera as it was stored" : "");
}

std::vector<PhotoFeatures> all_features(std::size_t num_photos, const std::function<cv::Mat(std::size_t)>& load_photo,
                                        const FeatureConfig& config, const Progress& progress, PhotoMatches& matches) {
  std::vector<PhotoFeatures> features(num_photos);
  std::vector<Size> sizes(num_photos);
  std::atomic<std::size_t> done = 0;
  tbb::parallel_for(std::size_t{0}, num_photos, [&](std::size_t i) {
    try {
      const cv::Mat photo = load_photo(i);
      sizes[i] = {photo.cols, photo.rows};
      features[i] = find_features(photo, config);
    } catch (const Interrupted&) {
      throw;
    } catch (const std::exception& error) {
      matches.reasons[i] = error.what();
    }
    report_progress(progress, "photos", ++done, num_photos);
  });
  const Size usual = usual_size(sizes);
  std::tie(matches.photos.width_px, matches.photos.height_px) = usual;
  for (std::size_t i = 0; i < num_photos; ++i) {
    if (sizes[i].first == 0) ++matches.num_unreadable;
    if (!matches.reasons[i].empty()) continue;
    if (sizes[i] != usual) matches.reasons[i] = other_size(sizes[i], usual);
    if (features[i].px.size() < min_features) matches.reasons[i] = "shows nothing that could be known again";
    if (!matches.reasons[i].empty()) features[i] = {};
  }
  return features;
}

}  // namespace

PhotoMatches match_photos(const std::vector<std::string>& names, const std::function<cv::Mat(std::size_t)>& load_photo,
                          const FeatureConfig& config, const Progress& progress) {
  PhotoMatches found;
  found.reasons.resize(names.size());
  found.photos.names = names;
  std::vector<PhotoFeatures> features = all_features(names.size(), load_photo, config, progress, found);
  std::vector<MatchedPair>& pairs = found.photos.pairs;
  for (std::size_t a = 0; a < names.size(); ++a) {
    for (std::size_t b = a + 1; b < names.size(); ++b) {
      if (!features[a].px.empty() && !features[b].px.empty())
        pairs.push_back({static_cast<int>(a), static_cast<int>(b), {}});
    }
  }
  std::atomic<std::size_t> done = 0;
  tbb::parallel_for(std::size_t{0}, pairs.size(), [&](std::size_t i) {
    pairs[i].matches = match_features(features[static_cast<std::size_t>(pairs[i].photo_a)].descriptors,
                                      features[static_cast<std::size_t>(pairs[i].photo_b)].descriptors);
    report_progress(progress, "pairs matched", ++done, pairs.size());
  });
  std::erase_if(pairs, [](const MatchedPair& pair) { return pair.matches.empty(); });
  for (PhotoFeatures& each : features) found.photos.features.push_back(std::move(each.px));
  return found;
}

}  // namespace alidade
