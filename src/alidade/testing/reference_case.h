#pragma once

#include <string>

namespace alidade::testing {

/// A file of src/alidade/testing/cases: measurements, and what a program that shares no code with alidade makes of
/// them.
inline std::string reference_case(const std::string& name) {
  return ALIDADE_SOURCE_DIR "/src/alidade/testing/cases/" + name;
}

}  // namespace alidade::testing
