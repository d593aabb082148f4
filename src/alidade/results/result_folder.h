#pragma once

#include <filesystem>
#include <map>
#include <string>
#include <string_view>
#include <vector>

#include "alidade/files/folder_swap.h"
#include "alidade/results/outcome.h"

namespace alidade {

/// Writes the files of a run into a folder, all at once or none. Files that an earlier run left there, according to its
/// result.json, and that are not replaced are removed; but a refusal has no estimate to replace an earlier one, does
/// not touch it, and is written to FOLDER/refused.
class ResultFolder {
 public:
  /// `document` has its verdict and inputs. Files that this run read are not touched. Throws InputError if nothing can
  /// be written there.
  ResultFolder(const std::filesystem::path& out, const ResultDocument& document);

  /// The final place of the files: the folder, or `refused` in it.
  [[nodiscard]] const std::filesystem::path& path() const { return folder_; }
  [[nodiscard]] bool is_aside() const { return is_aside_; }
  void add(const std::filesystem::path& name, std::string_view bytes);
  /// Adds report.html from the text of result.json, with as many images (the most important first) as a page of 12 MB
  /// holds. Throws if it cannot be made.
  void add_report(const std::string& result_text, std::vector<NamedBytes> images);
  /// Moves everything into place. Throws InputError after undoing everything.
  void commit();

 private:
  std::filesystem::path out_, folder_;
  bool is_aside_ = false;
  std::vector<std::filesystem::path> to_remove_;
  FolderSwap swap_;
};

/// Completes a document: an estimate that its checks contradict gets that exit code, and inputs are sorted, whichever
/// thread read them first.
void settle(ResultDocument& document);

/// The present time as 2026-01-31T12:00:00Z.
[[nodiscard]] std::string utc_now();

}  // namespace alidade
