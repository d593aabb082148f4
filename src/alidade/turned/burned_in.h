#pragma once

#include "alidade/turned/photo_links.h"

namespace alidade {

/// Removes matches of what is fixed in the image while the scene moves (a date, a logo, dirt on the lens): they would
/// link photos that share no scene, as if the camera had not rotated. Uses pairs whose homography contradicts such
/// matches, at pixels where at least three photos have them. Returns the number of removed matches.
std::size_t remove_burned_in(const std::vector<PhotoLink>& links, MatchedPhotos& photos);

}  // namespace alidade
