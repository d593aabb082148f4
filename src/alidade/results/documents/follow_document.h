#pragma once

#include <span>

#include "alidade/heads/head_follow.h"
#include "alidade/results/result_document.h"

namespace alidade {

/// Table `follow`: where the target stood in each frame, and where the head was, was asked to be, and would have been
/// right.
[[nodiscard]] DataTable follow_table(std::span<const FollowedFrame> frames);

}  // namespace alidade
