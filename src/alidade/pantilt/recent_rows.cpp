#include "alidade/pantilt/recent_rows.h"

#include <fmt/format.h>

namespace alidade {

void add_recent_rows(std::size_t forgotten, std::size_t kept, const char* unit, Verdict& verdict) {
  if (forgotten == 0) return;
  verdict.checks.push_back({.name = "newest rows",
                            .state = State::good,
                            .text = fmt::format("the result is of the newest {} of {} {} (--keep-rows); each was "
                                                "answered as it came",
                                                kept, kept + forgotten, unit),
                            .value = static_cast<double>(kept),
                            .unit = unit});
}

}  // namespace alidade
