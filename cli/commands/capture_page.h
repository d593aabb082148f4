#pragma once

#include <string>

#include "alidade/live/capture/capture_session.h"
#include "cli/commands/guide_page.h"

namespace alidade::cli {

/// Photos of a board, chosen while they are taken, as a page guides to them.
class CaptureWork : public GuidedWork {
 public:
  CaptureWork(const Board& board, live::CaptureSession& session, double goal_px)
      : board_(board), session_(session), goal_px_(goal_px) {}

  [[nodiscard]] std::string about() const override;
  [[nodiscard]] double begin_s() const override { return session_.begin_s(); }
  [[nodiscard]] bool has_goal() const override { return session_.state().is_at(goal_px_); }
  void see(const cv::Mat& grey, double t_s, bool is_exact, GuidePage& page) override;
  void wait(double t_s, GuidePage& page) override;
  void obey(const live::PageCommand& command, const cv::Mat& newest, double t_s, bool is_exact,
            GuidePage& page) override;
  void tell_state(GuidePage& page) override;
  /// What was seen last where no board was.
  [[nodiscard]] const std::string& last_words() const { return last_words_; }

 private:
  void after_taking(GuidePage& page);

  const Board& board_;
  live::CaptureSession& session_;
  double goal_px_;
  std::string last_words_;
};

}  // namespace alidade::cli
