#include "alidade/description/name_list.h"

#include <gtest/gtest.h>

namespace alidade {
namespace {

TEST(NameList, AWordBeforeNumbersIsSaidOnce) {
  EXPECT_EQ(name_list({}), "");
  EXPECT_EQ(name_list({"view 3", "view 8", "view 13"}), "view 3, 8, 13");
  EXPECT_EQ(name_list({"a 1.png", "a 2.png"}), "a 1.png, a 2.png");
  EXPECT_EQ(name_list({"view 3", "left.png", "view 8", "row 9"}), "view 3, left.png, view 8, row 9");
}

}  // namespace
}  // namespace alidade
