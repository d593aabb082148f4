#pragma once

#include <span>
#include <string>
#include <string_view>

// What alidade reads of what others wrote, each as a function of any bytes at all: fuzzed by `make fuzz`, and tried on
// what fuzzing once found by the test `fuzz_found`.

namespace alidade::fuzz {

struct Reader {
  std::string_view name;  ///< Of the target, and of its folders of seeds and found inputs.
  /// Reads the bytes. Throws only InputError, the one line that users get; aborts where it answers nonsense: a number
  /// that is not finite, or something that cannot be written and read again.
  void (*read)(std::string_view bytes);
};

[[nodiscard]] std::span<const Reader> readers();
/// Null: no such reader.
[[nodiscard]] const Reader* reader_named(std::string_view name);

/// Calls it, and takes InputError for an answer. Anything else that is thrown goes on.
void try_reader(const Reader& reader, std::string_view bytes);

}  // namespace alidade::fuzz
