#include "alidade/reference/name_tables.h"

namespace alidade {
namespace {

/// Figures of one point of a study, behind a prefix.
std::string point_names(const std::string& prefix) {
  std::string names;
  for (const char* line :
       {"trials count that were run", "estimates count with an estimate",
        "beyond count estimates so far off that no sum takes them; in no figure", "verdicts.* count trials by verdict",
        "good_beyond_5_sigma count said to be good, and beyond 5σ in some quantity",
        "quantities.*.bias any mean error, in the quantity's unit",
        "quantities.*.rms any root of the mean squared error, in its unit",
        "quantities.*.rms_over_bound 1 the same with each error over its bound",
        "quantities.*.rms_sigma any root of the mean squared stated σ",
        "quantities.*.median any half of the errors are smaller",
        "quantities.*.p90 any nine tenths of the errors are smaller",
        "quantities.*.values count estimates that have it",
        "quantities.*.coverage.* 1 share of the trials within so many stated σ",
        "worst[].trial count its number: --trial", "worst[].quantity text furthest off", "worst[].error any its error",
        "worst[].sigma any its stated σ"})
    names += prefix + line + "\n";
  return names;
}

std::string study_table() {
  return "estimate:\n"
         "bound text what errors are compared with: Cramér–Rao, or the RMS of the stated σ\n" +
         point_names("") +
         "varied text setting that is varied\n"
         "curve[].value 1 of that setting\n" +
         point_names("curve[].") +
         "data:\n"
         "quantities.varied 1 value of what is varied\n"
         "quantities.quantity text name\n"
         "quantities.unit text of the figures\n"
         "quantities.bias any mean error\n"
         "quantities.rms any root of the mean squared error\n"
         "quantities.rms_sigma any root of the mean squared stated σ\n"
         "quantities.rms_over_bound 1 RMS of the error over the bound\n"
         "quantities.median any half of the errors are smaller\n"
         "quantities.p90 any nine tenths of the errors are smaller\n"
         "quantities.inside_1_sigma 1 share of the trials\n"
         "quantities.inside_2_sigma 1 share of the trials\n"
         "quantities.inside_3_sigma 1 share of the trials\n"
         "worst.varied 1 value of what is varied\n"
         "worst.trial count number\n"
         "worst.quantity text furthest off\n"
         "worst.error any its error\n"
         "worst.sigma any its stated σ\n"
         "files:\n"
         "study.json text what depends on the study alone: the same bytes for every number of threads, ranks and "
         "shards\n";
}

const char* const batch_table = R"(estimate:
rows        count  of the lot
verdicts.*  count  rows by verdict; failed: without a result
outliers    count  outliers of the lot
data:
outliers.
  camera         text  of the row
  quantity       text  of its result
  value          any   of the row
  sigma          any   σ
  median_of_lot  any   of all rows that have it
  z              1     distance over the lot's scatter and σ
lot.
  quantity  text   of the results
  rows      count  that have it
  median    any    of the lot
  scatter   any    1.4826 times the median distance from the median
  sigma     any    median of the stated σ
values.
  camera         text  of the row
  quantity       text  that eight rows or more have
  value          any   of the row
  sigma          any   σ
  median_of_lot  any   of all rows that have it
  z              1     distance over the lot's scatter and σ; of large lots all beyond 4, and some of the others
rows.
  camera     text   of the row
  verdict    text   of its result; failed: there is none
  exit_code  count  of its command
  seconds    s      that it took
  sentence   text   of its verdict, or the line that it ended with
  folder     text   of its results
files:
batch.csv.
  camera     text   of the row
  verdict    text   of its result; failed: there is none
  exit_code  count  of its command
  *          any    each estimate that has a σ, and sigma_ it
  seconds    s      that it took
  sentence   text   of its verdict, or the line that it ended with
  folder     text   of its results
)";

}  // namespace

const NameTables& campaign_names() {
  static const NameTables names = [] {
    NameTables all;
    for (const char* study : {"observe", "calibrate", "rangefinder", "track", "localize", "turned", "chain", "merge"})
      all["study " + std::string(study)] = study_table();
    all["batch"] = batch_table;
    all["simulate fleet"] =
        "estimate:\n"
        "rows count that were made\n"
        "rows_per_s 1/s of what was published\n"
        "latest_s s largest delay against the rate asked for\n"
        "files:\n"
        "rows.txt text lines 'CAMERA ROW', in order of time\n"
        "truth.csv text the truth of each camera, and what happens to it: event, its time, its size [rad, or "
        "relative], and how its focal length follows the temperature [per °C]\n";
    all["fleet worker"] =
        "estimate:\n"
        "rows count taken in\n"
        "cameras count seen\n"
        "alarms count said\n"
        "rows_per_s 1/s taken in, by one thread\n"
        "bytes_a_camera count of what is kept of each\n"
        "files:\n"
        "states.jsonl text the last state of each camera, as on cam.ID.state\n"
        "alarms.jsonl text as on cam.ID.alarm\n";
    return all;
  }();
  return names;
}

}  // namespace alidade
