#pragma once

#include <span>

#include "alidade/heads/head_follow.h"
#include "alidade/results/result_document.h"

namespace alidade {

/// Table `follow`: in each frame the position of the target, and the actual, commanded and correct angles of the
/// head.
[[nodiscard]] DataTable follow_table(std::span<const FollowedFrame> frames);

}  // namespace alidade
