#pragma once

#include "alidade/turned/photo_links.h"

namespace alidade {

/// Removes the matches of what is at one place in the image while the scene moves past it, a date, a logo, dirt on the
/// lens: it would link photos that share no scene, as if the camera had not turned. By the pairs whose homography
/// contradicts such matches, at places where at least three photos have them. Returns how many were removed.
std::size_t remove_burned_in(const std::vector<PhotoLink>& links, MatchedPhotos& photos);

}  // namespace alidade
