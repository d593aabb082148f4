#pragma once

#include <functional>
#include <string>

#include "alidade/files/files.h"

namespace alidade::testing {

/// What it throws as InputError, in words; "" if nothing.
[[nodiscard]] inline std::string fault_of(const std::function<void()>& work) {
  try {
    work();
  } catch (const InputError& error) {
    return error.what();
  }
  return "";
}

}  // namespace alidade::testing
