#pragma once

#include <cstdint>
#include <limits>
#include <map>
#include <string>
#include <vector>

#include "alidade/fleet/camera_state.h"

namespace alidade {

/// What is kept of the numbers of a camera's rows, beside its state.
struct FleetNumbers {
  std::int64_t num_missing = 0;                                 ///< Rows that never came, and were given up.
  std::int64_t num_restarts = 0;                                ///< How often the observer began anew.
  std::uint64_t begun_at = 0;                                   ///< Place in the stream of the first row since it did.
  std::uint64_t read_to = 0;                                    ///< Place of the last row that was read.
  std::int64_t num_back = 0;                                    ///< How often t was less than in the row before.
  double most_back_s = 0.0;                                     ///< By how much at most.
  double first_t_s = std::numeric_limits<double>::quiet_NaN();  ///< Of row 1; NaN: not known.
  double last_t_s = std::numeric_limits<double>::quiet_NaN();   ///< Of the last row in order.
};
/// Of the next row in order.
void note_time(const FleetRow& row, FleetNumbers& numbers);
/// "2 rows never came; its observer restarted; its clock went back by 3600 s"; empty: nothing of that kind.
[[nodiscard]] std::string sentence_of(const FleetNumbers& numbers);
/// As one line, and back; false where it is none.
[[nodiscard]] std::string numbers_text(const FleetNumbers& numbers);
[[nodiscard]] bool parse_numbers(const std::string& text, FleetNumbers& numbers);

/// Puts the rows of a camera in the order of their numbers n. An early row waits for those before it, until 256 wait,
/// or at least three whose times span more than 30 s: then the missing ones are given up, and counted. A number that
/// has been, with a later time than the last row's (or n = 1 with another time than the first row's), is an observer
/// that began anew: its rows are taken in from there. All of it is a function of the rows in the stream's order.
class FleetRowOrder {
 public:
  struct Ready {
    FleetRow row;
    std::int64_t num_missing = 0;  ///< Rows before it that were given up.
    bool begins_anew = false;
  };
  enum class Arrival {
    ready,
    waits,
    late,  ///< Twice, or after it was given up: not used.
    known  ///< Read before the numbers were stored.
  };

  FleetRowOrder() = default;
  /// Goes on after row n.
  FleetRowOrder(const FleetNumbers& numbers, std::int64_t n) : numbers_(numbers), n_(n) {}

  /// A row at a place of the stream (rising). What is to be taken in now is appended to `ready`, in order.
  Arrival add(const FleetRow& row, std::uint64_t place, std::vector<Ready>& ready);

  [[nodiscard]] const FleetNumbers& numbers() const { return numbers_; }
  [[nodiscard]] std::int64_t n() const { return n_; }  ///< Of the last row in order; 0: none yet.
  [[nodiscard]] std::size_t num_waiting() const { return waiting_.size(); }
  /// Number of the first row that waits, where one does.
  [[nodiscard]] std::int64_t first_waiting_n() const { return waiting_.begin()->first; }
  /// The first place of the rows that wait; the largest number: none does.
  [[nodiscard]] std::uint64_t first_waiting_place() const;

 private:
  struct Waiting {
    FleetRow row;
    std::uint64_t place = 0;
    std::int64_t n_then = 0;
  };

  [[nodiscard]] bool begins_anew(const FleetRow& row) const;
  [[nodiscard]] bool is_given_up() const;
  void take(const FleetRow& row, std::int64_t num_missing, bool begins_anew, std::vector<Ready>& ready);
  void release(bool all, std::vector<Ready>& ready);

  FleetNumbers numbers_;
  std::int64_t n_ = 0;
  std::map<std::int64_t, Waiting> waiting_;
};

}  // namespace alidade
