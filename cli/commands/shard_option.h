#pragma once

#include <string>

#include "alidade/study/study_plan.h"

namespace alidade::cli {

/// --shard: "3/8"; the whole where the text is empty. Throws UsageError.
[[nodiscard]] Shard shard_from(const std::string& text);

}  // namespace alidade::cli
