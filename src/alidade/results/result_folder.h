#pragma once

#include <filesystem>
#include <map>
#include <string>
#include <string_view>
#include <vector>

#include "alidade/files/folder_swap.h"
#include "alidade/results/outcome.h"

namespace alidade {

/// The files of a run on their way into a folder: all of them take their place at once, or none does. What an earlier
/// run left there and this one does not replace goes, by its result.json; but a refusal has nothing to put in the place
/// of an estimate, leaves that alone, and goes to FOLDER/refused.
class ResultFolder {
 public:
  /// `document` has its verdict and inputs. Files that this run read are left alone. Throws InputError where nothing
  /// can be written there.
  ResultFolder(const std::filesystem::path& out, const ResultDocument& document);

  /// Where the files will stand: the folder, or `refused` in it.
  [[nodiscard]] const std::filesystem::path& path() const { return folder_; }
  [[nodiscard]] bool is_aside() const { return is_aside_; }
  void add(const std::filesystem::path& name, std::string_view bytes);
  /// report.html of result.json's text, with as many of the images (the most wanted first) as a page of 12 MB holds.
  /// Throws where it cannot be made.
  void add_report(const std::string& result_text, std::vector<NamedBytes> images);
  /// Puts everything in its place. Throws InputError; then all is as it was.
  void commit();

 private:
  std::filesystem::path out_, folder_;
  bool is_aside_ = false;
  std::vector<std::filesystem::path> to_remove_;
  FolderSwap swap_;
};

/// What every finished document keeps to: an estimate that its checks speak against ends in that exit code, and inputs
/// have one order, whichever thread read them first.
void settle(ResultDocument& document);

/// Seconds since 1970 as 2026-01-31T12:00:00Z, now.
[[nodiscard]] std::string utc_now();

}  // namespace alidade
