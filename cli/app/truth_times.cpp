#include "cli/app/truth_times.h"

#include <fmt/format.h>

namespace alidade::cli {

InputError truth_of_other_times(const std::filesystem::path& file, const TimeSpan& truth, const TimeSpan& path,
                                const std::string& compared) {
  return InputError(
      fmt::format("{}: is not of the path's times: {:.3f} to {:.3f} s, the path's are {:.3f} to {:.3f} s; {}",
                  file.string(), truth.from_s, truth.until_s, path.from_s, path.until_s, compared));
}

}  // namespace alidade::cli
