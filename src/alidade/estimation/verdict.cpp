#include "alidade/estimation/verdict.h"

#include <cstdio>

namespace alidade {

std::string text_of(double value, int digits) {
  char text[32];
  std::snprintf(text, sizeof text, "%.*g", digits, value);
  return text;
}

}  // namespace alidade
