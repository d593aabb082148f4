#include "cli/app/image_size.h"

#include "alidade/description/field.h"
#include "cli/app/run.h"

namespace alidade::cli {

std::pair<int, int> image_size(const std::string& text) {
  int width = 0, height = 0;
  const TextCode code = pair_code(width, height, 20000, "WIDTHxHEIGHT of 32 to 20000 px, for example 800x600", 32);
  if (const std::string fault = code.read(text); !fault.empty()) throw UsageError("--size: " + fault);
  return {width, height};
}

}  // namespace alidade::cli
