#pragma once

#include <map>
#include <span>
#include <string>
#include <vector>

#include "alidade/pantilt/head.h"
#include "alidade/pantilt/head_view.h"
#include "alidade/public.h"

namespace alidade {
ALIDADE_PUBLIC_BEGIN

/// Ids of the heads that have views, ascending.
[[nodiscard]] std::vector<int> heads_of(std::span<const HeadView> views);

/// What is wrong with this number of cameras for these heads: "has 2 heads (1, 2), but there are 3 cameras; …", or "".
[[nodiscard]] std::string camera_count_fault(const std::vector<int>& ids, std::size_t num_cameras);

/// One camera for all heads, or one per head in the order of their ids. Throws ConfigError for any other number.
[[nodiscard]] std::map<int, Camera> cameras_by_head(const std::vector<int>& ids, const std::vector<Camera>& cameras);

/// Heads with known cameras and everything else at its default, in the order of their ids.
[[nodiscard]] std::vector<RigHead> heads_with(const std::map<int, Camera>& cameras);

/// Names the first corner outside its camera's image (so it belongs to another camera), or two heads with identical
/// corners. Empty if there is none.
[[nodiscard]] std::string image_fault(std::span<const HeadView> views, const std::map<int, Camera>& cameras);

ALIDADE_PUBLIC_END
}  // namespace alidade
