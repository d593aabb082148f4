#include <gtest/gtest.h>

#include <tuple>

#include "alidade/files/files.h"
#include "alidade/testing/command_test.h"

// Photos of two cameras of one image size in one folder: the focal lengths are 30 % apart, too far for what is linear.

namespace alidade {
namespace {

using testing::Outcome;

class TwoCameras : public testing::CommandTest {
 protected:
  /// Rows of the corners that a camera sees, its photos with that name in front.
  [[nodiscard]] std::string corners(const std::string& name, const std::string& lens, int photos, int seed) const {
    write_file(path(name + ".yaml"),
               "model: brown\nwidth: 800\nheight: 600\nskew: 0\nk2: 0.08\np1: 0\np2: 0\nk3: 0\n" + lens);
    const Outcome made = alidade(
        {"simulate", "board", "--board", "9x6", "--square", "0.025", "--camera", path(name + ".yaml"), "--photos",
         std::to_string(photos), "--seed", std::to_string(seed), "--corners-only", "--out", path(name), "--quiet"},
        {});
    EXPECT_EQ(made.code, 0) << made.err;
    std::string rows = read_file(path(name + "/corners.csv"));
    rows.erase(0, rows.find('\n') + 1);
    std::string prefixed;
    for (std::size_t at = 0; at < rows.size();) {
      const std::size_t end = rows.find('\n', at);
      prefixed += name + "_" + rows.substr(at, end - at + 1);
      at = end + 1;
    }
    return prefixed;
  }
};

TEST_F(TwoCameras, AreNamedWithTheirPhotos) {
  for (const auto& [seed, first, second] : {std::tuple(1, 10, 5), {1, 12, 4}, {1, 10, 3}, {1, 7, 3}, {2, 12, 4}}) {
    write_file(path("mix.csv"),
               "photo,corner,u_px,v_px,sigma_u_px,sigma_v_px\n" +
                   corners("a", "fx: 700\nfy: 700\ncx: 402\ncy: 297\nk1: -0.2\n", first, seed) +
                   corners("b", "fx: 910\nfy: 910\ncx: 395\ncy: 305\nk1: -0.15\n", second, 100 + seed));
    const Outcome outcome = alidade({"calibrate", "--corners", path("mix.csv"), "--size", "800x600", "--board", "9x6",
                                     "--square", "0.025", "--no-report", "--out", path("out")},
                                    {});
    EXPECT_EQ(outcome.code, 6) << outcome.out;
    const bool is_named =
        outcome.out.find("the photos are of two lenses: " + std::to_string(second) + " of ") != std::string::npos &&
        outcome.out.find("(b_board") != std::string::npos;
    EXPECT_TRUE(is_named) << seed << ", " << first << " and " << second << ": " << outcome.out;
  }
}

}  // namespace
}  // namespace alidade
