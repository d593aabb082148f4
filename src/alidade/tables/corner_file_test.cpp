#include "alidade/tables/corner_file.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "alidade/testing/temporary_folder.h"

namespace alidade {
namespace {

using ::testing::HasSubstr;

constexpr int num_points = 54;

class CornerFile : public ::testing::Test {
 protected:
  [[nodiscard]] std::filesystem::path file(const std::string& text) const {
    write_file(folder_.path() / "corners.csv", text);
    return folder_.path() / "corners.csv";
  }

  /// What a file of that text is refused with; empty where it is not.
  [[nodiscard]] std::string refusal(const std::string& text) const {
    try {
      (void)read_corners(file(text), num_points);
    } catch (const InputError& error) {
      return error.what();
    }
    return "";
  }

 private:
  testing::TemporaryFolder folder_;
};

TEST_F(CornerFile, RoundTrip) {
  Eigen::Matrix2d cov;
  cov << 0.01, -0.004, -0.004, 0.0025;
  const std::vector<BoardView> views = {
      {"left01.jpg", {{0, {12.345678, 400.5}, cov}, {53, {639.0, 0.25}, Eigen::Matrix2d::Identity()}}},
      {"a, \"quoted\" name.jpg", {{7, {1.5, 2.5}, cov}}}};
  const auto read = read_corners(file(corners_csv(views)), num_points);
  ASSERT_EQ(read.size(), 2u);
  for (std::size_t k = 0; k < 2; ++k) {
    EXPECT_EQ(read[k].photo, views[k].photo);
    ASSERT_EQ(read[k].corners.size(), views[k].corners.size());
    for (std::size_t i = 0; i < read[k].corners.size(); ++i) {
      EXPECT_EQ(read[k].corners[i].index, views[k].corners[i].index);
      EXPECT_LT((read[k].corners[i].px - views[k].corners[i].px).norm(), 1e-6);  // six decimals are written
      EXPECT_LT((read[k].corners[i].cov - views[k].corners[i].cov).norm(), 1e-6);
    }
  }
  EXPECT_EQ(read[0].corners[1].cov, Eigen::Matrix2d::Identity()) << "unknown stays unknown";
}

TEST_F(CornerFile, ANearlyDegenerateCovarianceReadsBack) {
  Eigen::Matrix2d cov;
  cov << 1.0, 0.99999, 0.99999, 1.0;
  const std::vector<BoardView> views = {{"a.jpg", {{0, {1.0, 2.0}, cov}}}};
  EXPECT_EQ(refusal(corners_csv(views)), "");
}

TEST_F(CornerFile, ReadsWhatOthersWrite) {
  const auto views = read_corners(file("v,corner,photo,u,note\n20.5,3,b.png,10.25,x\n1,0,a.png,2,\n"), num_points);
  ASSERT_EQ(views.size(), 2u);
  EXPECT_EQ(views[0].photo, "b.png");  // in order of first appearance
  EXPECT_EQ(views[0].corners[0].px, Eigen::Vector2d(10.25, 20.5));
  EXPECT_EQ(views[0].corners[0].cov, Eigen::Matrix2d::Identity());
  // σ of some corners only.
  const auto mixed =
      read_corners(file("photo,corner,u_px,v_px,sigma_u_px,sigma_v_px\na,0,1,2,0.1,0.2\na,1,3,4,,\n"), num_points);
  EXPECT_NEAR(mixed[0].corners[0].cov(1, 1), 0.04, 1e-15);
  EXPECT_EQ(mixed[0].corners[1].cov, Eigen::Matrix2d::Identity());
}

TEST_F(CornerFile, HostileFilesAreRefusedAtTheirPlace) {
  const std::string head = "photo,corner,u_px,v_px,sigma_u_px,sigma_v_px,corr_uv\na,0,1,2,0.1,0.1,0\n";
  const std::vector<std::pair<std::string, std::string>> cases = {
      {head + "a,0,1,2,0.1,0.1,0\n", "corners.csv:3: column 'corner'"},      // twice
      {head + "a,54,1,2,0.1,0.1,0\n", "corners.csv:3: column 'corner'"},     // the board has 0…53
      {head + "a,-1,1,2,0.1,0.1,0\n", "corners.csv:3: column 'corner'"},     //
      {head + "a,1.5,1,2,0.1,0.1,0\n", "corners.csv:3: column 'corner'"},    //
      {head + "a,1,nan,2,0.1,0.1,0\n", "corners.csv:3: column 'u_px'"},      //
      {head + "a,1,1,inf,0.1,0.1,0\n", "corners.csv:3: column 'v_px'"},      //
      {head + "a,1,1,,0.1,0.1,0\n", "corners.csv:3: column 'v_px'"},         //
      {head + "a,1,1,2,0,0.1,0\n", "corners.csv:3: column 'sigma_u_px'"},    //
      {head + "a,1,1,2,0.1,-1,0\n", "corners.csv:3: column 'sigma_v_px'"},   //
      {head + "a,1,1,2,0.1,,0\n", "corners.csv:3: column 'sigma_v_px'"},     // one σ without the other
      {head + "a,1,1,2,,0.1,0\n", "corners.csv:3: column 'sigma_u_px'"},     //
      {head + "a,1,1,2,0.1,nan,0\n", "corners.csv:3: column 'sigma_v_px'"},  //
      {head + "a,1,1,2,0.1,0.1,1\n", "corners.csv:3: column 'corr_uv'"},     //
      {head + "a,1,1,2\n", "corners.csv:3"},                                 // a short row
      {"photo,corner,u_px\na,0,1\n", "v"},                                   // no v
      {"corner,u_px,v_px\n0,1,2\n", "photo"},                                //
      {"photo,u_px,v_px\na,1,2\n", "corner"},                                //
      {"photo,corner,u_px,v_px,sigma_u_px\na,0,1,2,0.1\n", "sigma_v_px"},    // half of the σ
      {"photo,corner,u_px,v_px,sigma_v_px\na,0,1,2,0.1\n", "sigma_u_px"},    //
      {"", "corners.csv"},
  };
  for (const auto& [text, place] : cases) {
    const std::string said = refusal(text);
    EXPECT_THAT(said, HasSubstr(place)) << text;
    EXPECT_THAT(said, HasSubstr("corners.csv")) << text;
    EXPECT_EQ(said.find('\n'), std::string::npos) << "one line";
  }
}

TEST_F(CornerFile, BoardPointsRoundTrip) {
  const std::vector<Eigen::Vector3d> points = {{0, 0, 1e-4}, {0.025, -2e-9, -3.5e-5}, {0.05, 0.1, 0}};
  const auto read = read_board_points(file(board_points_csv(points)), 3);
  ASSERT_EQ(read.size(), 3u);
  for (std::size_t i = 0; i < 3; ++i) EXPECT_LT((read[i] - points[i]).norm(), 2e-9);  // a nanometre is written
}

TEST_F(CornerFile, BoardPointsThatAreMissingOrTwiceAreRefused) {
  const auto read = [&](const std::string& rows) { (void)read_board_points(file("corner,x_m,y_m,z_m\n" + rows), 2); };
  EXPECT_NO_THROW(read("1,0,0,0\n0,0,0,0\n"));
  EXPECT_THROW(read("0,0,0,0\n"), InputError);
  EXPECT_THROW(read("0,0,0,0\n1,0,0,0\n1,5,0,0\n"), InputError);
  EXPECT_THROW(read("0,0,0,0\n2,0,0,0\n"), InputError);
  EXPECT_THROW(read("0,0,0,nan\n1,0,0,0\n"), InputError);
}

TEST_F(CornerFile, PosesHaveARowAPhoto) {
  const Rigid3 pose{exp_so3({0.1, 0.2, 0.3}), {1.0, 2.0, 3.0}};
  const std::string text = poses_csv({"a.jpg"}, {&pose, 1});
  EXPECT_THAT(text, HasSubstr("\na.jpg,1,2,3,"));
  EXPECT_EQ(std::count(text.begin(), text.end(), '\n'), 2);
  EXPECT_EQ(std::count(text.begin(), text.end(), ','), 2 * 7);
}

}  // namespace
}  // namespace alidade
