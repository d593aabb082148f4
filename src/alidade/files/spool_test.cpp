#include "alidade/files/spool.h"

#include <gtest/gtest.h>

#include "alidade/files/files.h"
#include "alidade/testing/temporary_folder.h"

namespace alidade {
namespace {

TEST(Spool, GivesBackWhatWasPutAsideAndHasNoName) {
  const testing::TemporaryFolder folder;
  Spool spool(folder.path() / "not" / "made" / "yet");
  const std::string zeros(100000, '\0');
  const Spool::Place a = spool.put("first"), none = spool.put(""), b = spool.put(zeros), c = spool.put("last");
  EXPECT_EQ(spool.get(c), "last");
  EXPECT_TRUE(spool.get(b) == zeros);
  EXPECT_EQ(spool.get(none), "");
  EXPECT_EQ(spool.get(a), "first");
  EXPECT_TRUE(std::filesystem::is_empty(folder.path()));
}

TEST(Spool, AFolderThatCannotBeWrittenIsNamed) {
  try {
    const Spool spool("/proc/self");
    FAIL() << "no file can be made in /proc";
  } catch (const InputError& error) {
    EXPECT_EQ(std::string(error.what()).find("/proc/self: cannot be written: "), 0u) << error.what();
  }
}

}  // namespace
}  // namespace alidade
