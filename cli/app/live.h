#pragma once

#include <functional>
#include <memory>
#include <mutex>
#include <string>
#include <vector>

#include "alidade/live/server.h"
#include "cli/app/pace.h"
#include "cli/app/run.h"

namespace CLI {  // NOLINT(readability-identifier-naming): CLI11's
class App;
}

namespace alidade::cli {

/// --live [PORT], --live-address, and --live-pace where the command reads what was recorded.
struct LiveOptions {
  bool is_on = false;
  std::string port, address;
  double pace = 0.0;  ///< Times as fast as it was recorded; 0: as fast as possible.
};
void add_live_options(CLI::App& command, LiveOptions& options, bool has_pace = true);

/// Address and port of the options. Throws UsageError where they are none.
[[nodiscard]] live::ServerConfig server_config(const LiveOptions& options);

/// What of a run is seen while it runs. Where --live is not given, it does nothing.
class LiveRun {
 public:
  /// Throws UsageError where the options do not fit together.
  LiveRun(const LiveOptions& options, Run& run);
  /// Says to all clients that the run has stopped, if it did not finish.
  ~LiveRun();
  LiveRun(const LiveRun&) = delete;
  LiveRun& operator=(const LiveRun&) = delete;

  [[nodiscard]] bool is_on() const { return options_.is_on; }
  /// Serves the topics, and prints the address. `row_topic`: whose rows are the table of the result so far.
  void open(std::vector<live::Topic> topics, std::string row_topic);
  /// Null where it is not open.
  [[nodiscard]] live::Server* server() { return server_.get(); }
  /// The run's progress, which clients see as well.
  [[nodiscard]] Progress progress();
  /// Waits, with --live-pace, until so much of the recording's time has passed. Throws Interrupted after Ctrl-C.
  void keep_pace(double t_s);
  /// run.finish(), and gives clients the time to fetch the result.
  [[nodiscard]] ExitCode finish(Verdict verdict);
  [[nodiscard]] ExitCode finish(JobOutcome outcome);

 private:
  ExitCode tell_end(ExitCode code);
  [[nodiscard]] live::HttpAnswer answer(std::string_view path);
  [[nodiscard]] std::string document_so_far(bool has_data);

  LiveOptions options_;
  Run& run_;
  std::string row_topic_;
  std::mutex mutex_;
  std::string result_;  ///< Empty until the run is finished.
  Pace pace_;
  std::unique_ptr<live::Server> server_;  // last: its thread uses the others
};

}  // namespace alidade::cli
