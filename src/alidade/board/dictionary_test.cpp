#include "alidade/board/dictionary.h"

#include <gtest/gtest.h>

#include <cmath>
#include <opencv2/aruco.hpp>

namespace alidade {
namespace {

TEST(MarkerDictionary, AgreesWithOpenCv) {
  const std::string names = marker_dictionary_names();
  int checked = 0;
  for (std::size_t at = 0; at < names.size(); ++checked) {
    const std::size_t end = std::min(names.find(", ", at), names.size());
    const auto dictionary = marker_dictionary(names.substr(at, end - at));
    ASSERT_TRUE(dictionary);
    EXPECT_EQ(dictionary->opencv_id, checked);
    EXPECT_EQ(cv::aruco::getPredefinedDictionary(checked)->bytesList.rows, dictionary->num_markers);
    at = end + 2;
  }
  EXPECT_EQ(checked, 21);
  EXPECT_EQ(marker_dictionary("DICT_5X5_100")->opencv_id, cv::aruco::DICT_5X5_100);
  EXPECT_EQ(marker_dictionary("DICT_APRILTAG_36h11")->opencv_id, cv::aruco::DICT_APRILTAG_36h11);
  EXPECT_FALSE(marker_dictionary("DICT_9X9_1"));
}

TEST(BoardFault, NamesWhatIsWrong) {
  EXPECT_EQ(fault(Board{}), "");
  EXPECT_EQ(fault(Board{.kind = BoardKind::asymmetric_circles, .cols = 4, .rows = 11}), "");
  EXPECT_EQ(fault(Board{.cols = 1}), "a board has 2 to 200 columns and rows, not 1x6");
  EXPECT_EQ(fault(Board{.square_m = std::nan("")}), "the pitch of a board is larger than 0");
  const Board charuco{BoardKind::charuco, 20, 20, 0.03, 0.02, "DICT_4X4_50"};
  EXPECT_EQ(fault(charuco), "the board needs 220 markers, DICT_4X4_50 has 50");
  EXPECT_NE(fault(Board{.kind = BoardKind::charuco, .marker_m = 0.02, .dictionary = "DICT"}), "");
  EXPECT_NE(fault(Board{.kind = BoardKind::circles, .marker_m = 0.03}), "");
  EXPECT_NE(fault(Board{.kind = BoardKind::aprilgrid}), "");  // no gap given
}

}  // namespace
}  // namespace alidade
