// One program, linked under the name of each reader: fuzz_camera fuzzes the reader "camera" (libFuzzer's options).
#include <cstddef>
#include <cstdint>
#include <cstdio>
#include <cstdlib>
#include <filesystem>
#include <string>

#include "fuzz/readers.h"

namespace {

const alidade::fuzz::Reader* chosen = nullptr;

}  // namespace

extern "C" int LLVMFuzzerInitialize(int* /*argc*/, char*** argv) {
  const std::string name = std::filesystem::path((*argv)[0]).filename().string();
  constexpr std::string_view prefix = "fuzz_";
  if (name.starts_with(prefix)) chosen = alidade::fuzz::reader_named(name.substr(prefix.size()));
  if (chosen == nullptr) {
    std::fputs("a reader is chosen by the program's name, one of:\n", stderr);
    for (const alidade::fuzz::Reader& reader : alidade::fuzz::readers())
      std::fprintf(stderr, "fuzz_%.*s\n", static_cast<int>(reader.name.size()), reader.name.data());
    std::exit(2);
  }
  return 0;
}

extern "C" int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size) {
  alidade::fuzz::try_reader(*chosen, {reinterpret_cast<const char*>(data), size});
  return 0;
}
