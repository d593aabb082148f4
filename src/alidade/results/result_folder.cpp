#include "alidade/results/result_folder.h"

#include <algorithm>
#include <ctime>
#include <nlohmann/json.hpp>
#include <set>
#include <tuple>

#include "alidade/files/files.h"
#include "alidade/report/page.h"
#include "alidade/results/save.h"
#include "alidade/results/thin_tables.h"

namespace alidade {
namespace {

const char* const refused = "refused";

/// What an earlier run left in a folder, by the result.json there.
struct EarlierResult {
  bool has_estimate = false;
  std::vector<std::filesystem::path> files;  ///< Inside the folder; result.json and the report first.
};

EarlierResult earlier_result(const std::filesystem::path& folder) {
  EarlierResult found;
  std::error_code ignored;
  if (!std::filesystem::is_regular_file(folder / "result.json", ignored)) return found;
  const auto json = nlohmann::json::parse(read_file(folder / "result.json"), nullptr, false);
  const auto member = [&](const char* pointer) {
    const nlohmann::json::json_pointer at(pointer);
    return json.contains(at) ? json[at] : nlohmann::json();
  };
  if (member("/schema") != "alidade-result/1") return found;
  found.files = {"result.json", "report.html"};
  for (const auto& name : member("/files")) {
    const std::filesystem::path file = name.is_string() ? name.get<std::string>() : "";
    const bool is_inside =
        !file.empty() && file.is_relative() && file == file.lexically_normal() && *file.begin() != "..";
    if (is_inside && file.has_filename()) found.files.push_back(file);
  }
  const nlohmann::json code = member("/verdict/exit_code");
  found.has_estimate = code.is_number_integer() && is_estimate(code.get<int>());
  return found;
}

/// Its files stay where this run reads one of them: photos that were simulated into DIR, then calibrated there.
void spare_inputs(const std::vector<InputFile>& inputs, const std::filesystem::path& folder, EarlierResult& earlier) {
  std::error_code ignored;
  std::set<std::filesystem::path> read;
  for (const InputFile& input : inputs) read.insert(std::filesystem::weakly_canonical(input.name, ignored));
  const bool is_read = std::any_of(earlier.files.begin(), earlier.files.end(), [&](const std::filesystem::path& file) {
    return read.contains(std::filesystem::weakly_canonical(folder / file, ignored));
  });
  if (is_read) earlier.files.resize(2);
}

/// What an earlier run left in a folder and this one does not replace, as paths in `folder`.
std::vector<std::filesystem::path> leftovers(const std::filesystem::path& out, bool is_aside,
                                             const EarlierResult& earlier) {
  if (is_aside) return earlier_result(out / refused).files;
  std::vector<std::filesystem::path> files = earlier.files;
  for (const std::filesystem::path& name : earlier_result(out / refused).files) files.push_back(refused / name);
  return files;
}

bool has_estimate(const ResultDocument& document) { return is_estimate(static_cast<int>(document.verdict.exit_code)); }

}  // namespace

ResultFolder::ResultFolder(const std::filesystem::path& out, const ResultDocument& document)
    : out_(out),
      folder_(out),
      is_aside_(!has_estimate(document) && earlier_result(out).has_estimate),
      swap_(is_aside_ ? out / refused : out) {
  if (is_aside_) folder_ /= refused;
  EarlierResult earlier = earlier_result(out);
  spare_inputs(document.inputs, out, earlier);
  to_remove_ = leftovers(out, is_aside_, earlier);
}

void ResultFolder::add(const std::filesystem::path& name, std::string_view bytes) { swap_.add(name, bytes); }

void ResultFolder::add_report(const std::string& result_text, std::vector<NamedBytes> images) {
  constexpr std::size_t max_page_bytes = 12'000'000;  // opens at once, and goes through the mail
  std::size_t room = max_page_bytes - std::min(max_page_bytes, report_page(result_text, {}).size());
  std::map<std::string, std::string> shown;
  for (NamedBytes& image : images) {
    const std::size_t size = image.bytes.size() * 4 / 3 + image.name.size() + 100;  // as base64, in its element
    if (size > room) break;
    room -= size;
    shown[image.name] = std::move(image.bytes);
  }
  swap_.add("report.html", report_page(result_text, shown));
}

void ResultFolder::commit() {
  for (const std::filesystem::path& name : to_remove_) swap_.remove(name);
  swap_.commit();
}

void settle(ResultDocument& document) {
  Verdict& verdict = document.verdict;
  if (verdict.state == State::bad && verdict.exit_code == ExitCode::ok) verdict.exit_code = ExitCode::not_trusted;
  std::stable_sort(document.inputs.begin(), document.inputs.end(), [](const InputFile& a, const InputFile& b) {
    return std::tie(a.role, a.name) < std::tie(b.role, b.name);
  });
}

void save(JobOutcome outcome, const std::filesystem::path& folder) {
  if (folder.empty()) throw InputError("folder: is empty; a folder is needed");
  ResultDocument& document = outcome.document;
  settle(document);
  if (document.created_utc.empty()) document.created_utc = utc_now();
  Verdict& verdict = document.verdict;
  if (verdict.state == State::bad && verdict.exit_code == ExitCode::ok) verdict.exit_code = ExitCode::not_trusted;
  for (const NamedBytes& file : outcome.files) document.files.push_back(file.name);
  std::vector<NamedBytes> tables;  // of which the document has a part
  const std::string text = result_text_of_size(document, [&](std::string name, std::string csv) {
    document.files.push_back(name);
    tables.push_back({std::move(name), std::move(csv)});
  });
  ResultFolder results(folder, document);
  results.add("result.json", text);
  for (const auto* files : {&outcome.files, &tables}) {
    for (const NamedBytes& file : *files) results.add(file.name, file.bytes);
  }
  results.add_report(text, std::move(outcome.images));
  results.commit();
}

std::string utc_now() {
  const std::time_t now = std::time(nullptr);
  std::tm parts{};
  ::gmtime_r(&now, &parts);
  std::string text(32, '\0');
  text.resize(std::strftime(text.data(), text.size(), "%Y-%m-%dT%H:%M:%SZ", &parts));
  return text;
}

}  // namespace alidade
