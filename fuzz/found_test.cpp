// What fuzzing found stays mended: fuzz/found/READER/* are read, and answered or refused in one line.
#include <gtest/gtest.h>

#include <filesystem>

#include "alidade/files/files.h"
#include "fuzz/readers.h"

namespace alidade::fuzz {
namespace {

TEST(FuzzFound, EveryInputThatOnceFailedIsAnsweredOrRefused) {
  const std::filesystem::path found = std::filesystem::path(ALIDADE_SOURCE_DIR) / "fuzz" / "found";
  for (const auto& folder : std::filesystem::directory_iterator(found)) {
    const Reader* reader = reader_named(folder.path().filename().string());
    ASSERT_NE(reader, nullptr) << folder.path();
    for (const auto& input : std::filesystem::directory_iterator(folder.path()))
      EXPECT_NO_THROW(try_reader(*reader, read_file(input.path()))) << input.path();
  }
}

// Every prefix of these is what is left of a file that was cut off.
TEST(FuzzFound, BytesOfNoFormatAreRefusedByEveryReader) {
  for (const Reader& reader : readers()) {
    for (const std::string bytes :
         {"", "\n", "\xef\xbb\xbf", "a,b\n1", "a: [", "{\"a\":", "%YAML:1.0\n---\na: !!opencv-matrix",
          "P5\n9999999 9999999\n255\n", "\xff\xd8\xff\xe1\xff\xff", "II*\0\xff\xff\xff\x7f"})
      EXPECT_NO_THROW(try_reader(reader, bytes)) << reader.name << ": " << bytes;
  }
}

}  // namespace
}  // namespace alidade::fuzz
