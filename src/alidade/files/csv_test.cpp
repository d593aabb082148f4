#include "alidade/files/csv.h"

#include <gtest/gtest.h>

#include <numbers>
#include <sstream>
#include <utility>

#include "alidade/testing/fault.h"
#include "alidade/testing/temporary_folder.h"

namespace alidade {
namespace {

using testing::fault_of;

std::string fault_of_text(std::string_view text) {
  return fault_of([&] { (void)Csv::parse(text, "shots.csv"); });
}

/// The fault of the number in row 0 of a table with one other column.
std::string fault_of_number(const std::string& cell) {
  return fault_of([&] { (void)Csv::parse("id,range_m\n1," + cell + "\n", "shots.csv").number(0, "range_m"); });
}

TEST(Csv, ReadsCellsByColumnName) {
  const Csv csv = Csv::parse("t, u_px ,name\n1,-2.5e1, a b \n+4,0,\n", "x.csv");
  ASSERT_EQ(csv.num_rows(), 2u);
  EXPECT_EQ(csv.header(), (std::vector<std::string>{"t", "u_px", "name"}));
  EXPECT_EQ(csv.number(0, "u_px"), -25.0);
  EXPECT_EQ(csv.number(1, "t"), 4.0);
  EXPECT_EQ(csv.text(0, "name"), "a b");
  EXPECT_TRUE(csv.is_empty(1, "name"));
  EXPECT_TRUE(csv.has("t"));
  EXPECT_FALSE(csv.has("v_px"));
}

TEST(Csv, ReadsWhatSpreadsheetsWrite) {
  const Csv csv = Csv::parse("\xEF\xBB\xBF\"t\",\"a \"\"b\"\", c\"\r\n1,\"x\r\ny\"\r\n2,z\r\n\r\n\r\n", "x.csv");
  ASSERT_EQ(csv.num_rows(), 2u);
  EXPECT_EQ(csv.text(0, "a \"b\", c"), "x\r\ny");
  EXPECT_EQ(csv.where(1, "t"), "x.csv:4: column 't'") << "a cell of two lines counts as two";
}

TEST(Csv, LastLineNeedsNoEnd) { EXPECT_EQ(Csv::parse("a,b\n1,2", "x.csv").number(0, "b"), 2.0); }

TEST(Csv, OldMacLineEndsAreRead) { EXPECT_EQ(Csv::parse("a,b\r1,2\r", "x.csv").number(0, "b"), 2.0); }

TEST(Csv, AHeaderWithoutRowsIsATable) { EXPECT_EQ(Csv::parse("a,b\n", "x.csv").num_rows(), 0u); }

TEST(Csv, NumbersThatAreNoneAreRefusedByPlace) {
  const std::string where = "shots.csv:2: column 'range_m': ";
  EXPECT_EQ(fault_of_number("nan"), where + "'nan' is not a finite number");
  EXPECT_EQ(fault_of_number("-NaN"), where + "'-NaN' is not a finite number");
  EXPECT_EQ(fault_of_number("inf"), where + "'inf' is not a finite number");
  EXPECT_EQ(fault_of_number("1e300"), where + "'1e300' is out of range; numbers up to 1e12 are read");
  EXPECT_EQ(fault_of_number("-1e999"), where + "'-1e999' is out of range; numbers up to 1e12 are read");
  EXPECT_EQ(fault_of_number("two"), where + "'two' is not a number");
  EXPECT_EQ(fault_of_number("2.5 m"), where + "'2.5 m' is not a number");
  EXPECT_EQ(fault_of_number("0x10"), where + "'0x10' is not a number");
  EXPECT_EQ(fault_of_number("1_000"), where + "'1_000' is not a number");
  EXPECT_EQ(fault_of_number("--1"), where + "'--1' is not a number");
  EXPECT_EQ(fault_of_number("\"2,5\""), where + "'2,5' is not a number");
  EXPECT_EQ(fault_of_number(""), where + "is empty; a number is needed");
  EXPECT_EQ(fault_of_number("1e12"), "");
}

TEST(Csv, ALongCellIsCutInTheMessage) {
  EXPECT_EQ(fault_of_number(std::string(100'000, 'x')),
            "shots.csv:2: column 'range_m': '" + std::string(40, 'x') + "…' is not a number");
}

TEST(Csv, IntegersHaveARange) {
  const Csv csv = Csv::parse("i\n7\n-1\n7.5\n99999999999999999999\n", "x.csv");
  const auto fault = [&](std::size_t row) { return fault_of([&] { (void)csv.integer(row, "i", 0, 10); }); };
  EXPECT_EQ(csv.integer(0, "i", 0, 10), 7);
  EXPECT_EQ(fault(1), "x.csv:3: column 'i': '-1' is not a whole number from 0 to 10");
  EXPECT_EQ(fault(2), "x.csv:4: column 'i': '7.5' is not a whole number from 0 to 10");
  EXPECT_EQ(fault(3), "x.csv:5: column 'i': '99999999999999999999' is not a whole number from 0 to 10");
}

TEST(Csv, AWholeNumberMayBeWrittenAsAFloatingOne) {
  const Csv csv = Csv::parse("i\n7.0\n1e1\n-0.0\n7.5\n1e13\nnan\n", "x.csv");
  EXPECT_EQ(csv.integer(0, "i", 0, 10), 7) << "as pandas and numpy write a column of whole numbers with a gap";
  EXPECT_EQ(csv.integer(1, "i", 0, 10), 10);
  EXPECT_EQ(csv.integer(2, "i", 0, 10), 0);
  for (const std::size_t row : {3u, 4u, 5u})
    EXPECT_NE(fault_of([&] { (void)csv.integer(row, "i", 0, 1'000'000'000); }), "") << csv.text(row, "i");
}

TEST(Csv, NanosecondTimeStampsAreExact) {
  EXPECT_EQ(Csv::parse("t_ns\n1403636579763555584\n", "x.csv").integer(0, "t_ns", 0, 2'000'000'000'000'000'000),
            1403636579763555584);
}

TEST(Csv, ColumnsAreAskedForInSiUnitsWhateverTheirs) {
  const Csv csv = Csv::parse("t_ms,pan[deg],tilt (deg),range [mm],roll[°]\n1500,90,-45,20,180\n", "x.csv");
  EXPECT_EQ(csv.number(0, "t_s"), 1.5);
  EXPECT_NEAR(csv.number(0, "pan_rad"), 0.5 * std::numbers::pi, 1e-15);
  EXPECT_NEAR(csv.number(0, "tilt_rad"), -0.25 * std::numbers::pi, 1e-15);
  EXPECT_NEAR(csv.number(0, "range_m"), 0.02, 1e-15);
  EXPECT_NEAR(csv.number(0, "roll_rad"), std::numbers::pi, 1e-15);
  EXPECT_EQ(csv.number(0, "pan_deg"), 90.0) << "the column itself";
  EXPECT_EQ(csv.where(0, "pan_rad"), "x.csv:2: column 'pan_deg'");
  const Csv points = Csv::parse("omega_x [rad/s],p1x [px],p12y[px],u[px]\n1,2,3,4\n", "x.csv");
  EXPECT_EQ(points.number(0, "omega_x"), 1.0) << "names that never have their unit";
  EXPECT_EQ(points.number(0, "p1x"), 2.0);
  EXPECT_EQ(points.number(0, "p12y"), 3.0);
  EXPECT_EQ(points.number(0, "u_px"), 4.0);
  EXPECT_FALSE(csv.has("t_deg"));
  EXPECT_FALSE(Csv::parse("t_ms,t_ns\n", "x.csv").has("t_s")) << "which of both is meant?";
  EXPECT_EQ(Csv::parse("t_s,t_ms\n1,5\n", "x.csv").number(0, "t_s"), 1.0);
  const Csv azimuth = Csv::parse("azimuth_deg,elevation\n90,0.5\n", "x.csv");
  EXPECT_NEAR(azimuth.number(0, "pan_rad"), -0.5 * std::numbers::pi, 1e-15) << "to the right";
  EXPECT_EQ(azimuth.number(0, "tilt_rad"), 0.5);
}

TEST(Csv, TimesMayBeThoseOfAClock) {
  EXPECT_NEAR(Csv::parse("t_ns\n1403636579763555584\n", "x.csv").number(0, "t_s"), 1403636579.763555584, 1e-6);
  EXPECT_NEAR(Csv::parse("t_capture_ns\n1403636579763555584\n", "x.csv").number(0, "t_capture_s"), 1403636579.763555584,
              1e-6);
  const Csv same = Csv::parse("t_capture_ns,t_arrival_ms\n150000000,150\n", "x.csv");
  EXPECT_EQ(same.number(0, "t_capture_s"), same.number(0, "t_arrival_s"));
  EXPECT_EQ(Csv::parse("time\n12.5\n", "x.csv").number(0, "t_s"), 12.5);
  EXPECT_NEAR(Csv::parse("%time,a\n1403636579763555584,1\n", "x.csv").number(0, "t_s"), 1403636579.7635556, 1e-6);
  EXPECT_NE(fault_of([] { (void)Csv::parse("time\nnan\n", "x.csv").number(0, "t_s"); }), "");
}

TEST(Csv, TabsSeparateAndAHeaderMayBeAComment) {
  for (const char* text : {"a\tb c\td\n1\t\t3\n", "# by hand\n# a\tb c\td\n1\t\t3\n"}) {
    const bool is_comment = text[0] == '#';
    const Csv csv = Csv::parse(is_comment ? "# by hand\n# a\tb\td\n1\t\t3\n" : text, "x.csv");
    EXPECT_EQ(csv.number(0, "a"), 1.0);
    EXPECT_EQ(csv.text(0, is_comment ? "b" : "b c"), "");
    EXPECT_EQ(csv.number(0, "d"), 3.0);
    EXPECT_EQ(csv.line(0), is_comment ? 3u : 2u);
  }
  EXPECT_EQ(Csv::parse("# made by x, y and z\n\n# on Monday\na,b\n1,2\n", "x.csv").number(0, "b"), 2.0);
  const std::string text = "# made by x\n%time,b\n5,2\n6,nan\n";
  std::istringstream in(text);
  CsvStream stream(in, "x.csv");
  EXPECT_EQ(stream.header(), (std::vector<std::string>{"time", "b"}));
  const Csv whole = Csv::parse(text, "x.csv");
  EXPECT_EQ(whole.header(), stream.header());
  EXPECT_EQ(stream.next()->line, 3u);
  EXPECT_EQ(fault_of([&] { (void)whole.number(1, "b"); }), "x.csv:4: column 'b': 'nan' is not a finite number");
  EXPECT_EQ(Csv::parse(text, "x.csv", true).number(1, "t_s"), 6.0);
}

TEST(Csv, WrongTablesAreRefusedByLine) {
  const std::vector<std::pair<std::string, std::string>> cases{
      {"", "shots.csv: is empty; a header line with the columns' names is needed"},
      {"\n\r\n \n", "shots.csv: is empty; a header line with the columns' names is needed"},
      {"a,b\n1,2\n3\n", "shots.csv:3: has 1 cell, the header has 2"},
      {"a,b\n1,2,3\n", "shots.csv:2: has 3 cells, the header has 2"},
      {"a,b,a\n", "shots.csv:1: column 'a' appears twice in the header"},
      {"a,,b\n", "shots.csv:1: column 2 has no name"},
      {"a,b\n1,2\n\n3,4\n", "shots.csv:3: a blank line inside the table; remove it"},
      {"a,b\n1,\"2\n", "shots.csv:2: a quote is opened and never closed"},
      {"a,b\n1,\"2\"3\n", "shots.csv:2: text after a closing quote"},
      {std::string("a,b\n1,\0\n", 8), "shots.csv:2: is not a text file; a table of comma-separated values is needed"},
      {"\xFF\xD8\xFF\xE0\x01JFIF", "shots.csv:1: is not a text file; a table of comma-separated values is needed"},
  };
  for (const auto& [text, message] : cases) EXPECT_EQ(fault_of_text(text), message);
}

TEST(Csv, WithSkipBadWhatIsNoRowIsNamedAndTheRestIsRead) {
  const Csv csv = Csv::parse("a,b\n1,2\n3\n\n4,5,6\n7,\"8\"9\n10,11\n", "x.csv", /*skip_bad=*/true);
  ASSERT_EQ(csv.num_rows(), 2u);
  EXPECT_EQ(csv.number(1, "b"), 11.0);
  EXPECT_EQ(csv.line(1), 7u);
  std::vector<std::string> named;
  for (const SkippedInput& each : csv.skipped()) named.push_back(std::to_string(each.line) + " " + each.reason);
  EXPECT_EQ(named,
            (std::vector<std::string>{"3 has 1 cell, the header has 2", "4 a blank line inside the table; remove it",
                                      "5 has 3 cells, the header has 2", "6 text after a closing quote"}));
  EXPECT_NE(fault_of([] { (void)Csv::parse("a,a\n1,2\n", "x.csv", true); }), "") << "a header must be right";
}

TEST(Csv, AMissingColumnIsNamedWithThoseThatAreThere) {
  const Csv csv = Csv::parse("a,b\n1,2\n", "x.csv");
  EXPECT_EQ(fault_of([&] { (void)csv.number(0, "range_m"); }), "x.csv: has no column 'range_m'; it has: a, b");
}

TEST(Csv, AFileIsNamedAsGiven) {
  const testing::TemporaryFolder folder;
  const auto file = folder.path() / "views.csv";
  write_file(file, "a\nx\n");
  EXPECT_EQ(fault_of([&] { (void)Csv::read(file).number(0, "a"); }),
            file.string() + ":2: column 'a': 'x' is not a number");
}

}  // namespace
}  // namespace alidade
