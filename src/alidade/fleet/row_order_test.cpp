#include "alidade/fleet/row_order.h"

#include <gtest/gtest.h>

#include <random>

namespace alidade {
namespace {

using Arrival = FleetRowOrder::Arrival;

FleetRow row_at(std::int64_t n, double t_s) {
  FleetRow row;
  row.n = n;
  row.t_s = t_s;
  return row;
}

/// A camera's rows, and what came of them.
struct Ordered {
  FleetRowOrder order;
  std::vector<FleetRowOrder::Ready> ready;
  std::uint64_t place = 0;

  Arrival add(std::int64_t n, double t_s) { return order.add(row_at(n, t_s), ++place, ready); }
};

TEST(FleetRowOrder, PutsRowsInOrder) {
  Ordered rows;
  std::vector<int> order(200);
  for (int i = 0; i < 200; ++i) order[static_cast<std::size_t>(i)] = i + 1;
  std::mt19937 bits(3);
  for (auto at = order.begin(); at != order.end(); at += 20) std::shuffle(at, at + 20, bits);  // 20 s of rows
  for (const int n : order) (void)rows.add(n, n);
  ASSERT_EQ(rows.ready.size(), 200u);
  for (std::size_t i = 0; i < rows.ready.size(); ++i) EXPECT_EQ(rows.ready[i].row.n, static_cast<std::int64_t>(i + 1));
  EXPECT_EQ(rows.order.numbers().num_missing, 0);
  EXPECT_EQ(sentence_of(rows.order.numbers()), "");
  EXPECT_EQ(rows.add(7, 7.0), Arrival::late);
}

/// Row 50 is lost: those behind it wait for half a minute, or are 256, and the loss is counted. It comes late.
TEST(FleetRowOrder, GivesUpAGapAndCountsIt) {
  for (const double rate_hz : {1.0, 100.0}) {
    Ordered rows;
    for (int n = 1; n <= 49; ++n) (void)rows.add(n, n / rate_hz);
    int n = 51;
    for (; rows.order.n() == 49; ++n) ASSERT_EQ(rows.add(n, n / rate_hz) == Arrival::waits, rows.order.n() == 49);
    EXPECT_EQ(n, rate_hz == 1.0 ? 51 + 32 : 51 + 257);
    EXPECT_EQ(rows.order.n(), n - 1);
    EXPECT_EQ(rows.ready[49].row.n, 51);
    EXPECT_EQ(rows.ready[49].num_missing, 1);
    EXPECT_EQ(rows.order.numbers().num_missing, 1);
    EXPECT_EQ(sentence_of(rows.order.numbers()), "1 row never came");
    EXPECT_EQ(rows.add(50, 50 / rate_hz), Arrival::late);
  }
}

TEST(FleetRowOrder, BeginsWhereAnObserverWasRunningBefore) {
  Ordered rows;
  for (int n = 10; rows.order.n() == 0 && n < 100; ++n) (void)rows.add(n, n);
  EXPECT_EQ(rows.ready.front().row.n, 10);
  EXPECT_EQ(rows.order.numbers().num_missing, 9);
}

/// It counts from 1 again while its clock goes on, or both begin anew; in the middle of a gap as well; where the
/// broker took its first rows for those it had, from where they go on.
TEST(FleetRowOrder, FollowsAnObserverThatBeginsAnew) {
  for (const double clock : {100.0, -3.5}) {
    Ordered rows;
    for (int n = 1; n <= 100; ++n) (void)rows.add(n, n);
    for (int n = 1; n <= 30; ++n) EXPECT_EQ(rows.add(n, clock + n), Arrival::ready) << n;
    EXPECT_EQ(rows.ready.size(), 130u);
    EXPECT_TRUE(rows.ready[100].begins_anew);
    EXPECT_FALSE(rows.ready[101].begins_anew);
    EXPECT_EQ(sentence_of(rows.order.numbers()), "its observer restarted");
  }
  Ordered gap;
  for (int n = 1; n <= 60; ++n)
    if (n != 50) (void)gap.add(n, n);
  for (int n = 1; n <= 5; ++n) (void)gap.add(n, 60 + n);
  ASSERT_EQ(gap.ready.size(), 64u);
  EXPECT_EQ(gap.ready[58].row.t_s, 60.0);
  EXPECT_EQ(gap.ready[59].row.n, 1);
  Ordered later;
  for (int n = 1; n <= 100; ++n) (void)later.add(n, n);
  for (int n = 17; n <= 120; ++n) (void)later.add(n, 100 + n);
  EXPECT_EQ(later.order.n(), 120);
  EXPECT_EQ(sentence_of(later.order.numbers()), "16 rows never came; its observer restarted");
}

/// Rows that come again, an hour's clock error, one number far beyond all: nothing begins anew, nothing stays held.
TEST(FleetRowOrder, IsNotMisledBySingleRows) {
  Ordered rows;
  for (int n = 1; n <= 100; ++n) (void)rows.add(n, n);
  EXPECT_EQ(rows.add(100, 100.0), Arrival::late);
  EXPECT_EQ(rows.add(40, 40.0), Arrival::late);
  EXPECT_EQ(rows.add(std::int64_t{1} << 62U, 101.0), Arrival::waits);
  for (int n = 101; n <= 6000; ++n) EXPECT_EQ(rows.add(n, n), Arrival::ready);
  EXPECT_EQ(rows.order.num_waiting(), 0u);
  EXPECT_EQ(sentence_of(rows.order.numbers()), "");
}

TEST(FleetRowOrder, SaysThatAClockWentBack) {
  Ordered rows;
  for (int n = 1; n <= 200; ++n) (void)rows.add(n, n <= 100 ? n : n - 3600);
  EXPECT_EQ(rows.ready.size(), 200u);
  EXPECT_EQ(sentence_of(rows.order.numbers()), "its clock went back by 3599 s");
}

/// A worker that ends anywhere, and another that reads from the first row that waited (or earlier): the same.
TEST(FleetRowOrder, GoesOnFromWhatIsStored) {
  std::vector<FleetRow> stream;
  std::mt19937 bits(5);
  for (int n = 1; n <= 120; ++n)
    if (n != 30) stream.push_back(row_at(n, n));
  for (int n = 1; n <= 200; ++n)
    if (n < 50 || n > 53) stream.push_back(row_at(n, 120 + n));
  for (std::size_t at = 0; at + 4 < 110; at += 4)
    std::shuffle(stream.begin() + static_cast<std::ptrdiff_t>(at), stream.begin() + static_cast<std::ptrdiff_t>(at) + 4,
                 bits);
  std::vector<FleetRowOrder::Ready> undisturbed;
  FleetRowOrder one;
  for (std::size_t i = 0; i < stream.size(); ++i) (void)one.add(stream[i], i + 1, undisturbed);
  for (std::size_t end = 1; end < stream.size(); ++end) {
    std::vector<FleetRowOrder::Ready> ready;
    FleetRowOrder before;
    for (std::size_t i = 0; i < end; ++i) (void)before.add(stream[i], i + 1, ready);
    FleetNumbers numbers;
    ASSERT_TRUE(parse_numbers(numbers_text(before.numbers()), numbers));
    FleetRowOrder after(numbers, before.n());
    const std::size_t safe = std::min<std::size_t>(before.first_waiting_place() - 1, end);
    const std::size_t from = safe > 25 ? safe - 25 : 0;
    for (std::size_t i = from; i < stream.size(); ++i) {
      const Arrival arrival = after.add(stream[i], i + 1, ready);
      if (i < end) {
        EXPECT_NE(arrival, Arrival::late);
      }
    }
    ASSERT_EQ(ready.size(), undisturbed.size()) << end;
    for (std::size_t i = 0; i < ready.size(); ++i) ASSERT_EQ(ready[i].row.t_s, undisturbed[i].row.t_s) << end;
    EXPECT_EQ(numbers_text(after.numbers()), numbers_text(one.numbers()));
  }
  FleetNumbers numbers;
  EXPECT_FALSE(parse_numbers("", numbers));
  EXPECT_FALSE(parse_numbers("1 2 x", numbers));
}

}  // namespace
}  // namespace alidade
