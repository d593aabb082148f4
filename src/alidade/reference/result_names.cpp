#include "alidade/reference/result_names.h"

#include <map>
#include <sstream>

#include "alidade/reference/name_tables.h"

namespace alidade {
namespace {

const std::map<std::string, std::string>& tables() {
  static const std::map<std::string, std::string> all = [] {
    std::map<std::string, std::string> joined;
    for (const auto* part : {&camera_names(), &observe_names(), &beam_names(), &motion_names(), &head_names(),
                             &study_names(), &campaign_names()}) {
      joined.insert(part->begin(), part->end());
    }
    return joined;
  }();
  return all;
}

/// Adds the names that many results have, each behind a prefix; "-" is none.
void add_shared(const std::string& block, std::string prefix, std::vector<ResultName>& part) {
  if (prefix.ends_with('-')) prefix.pop_back();
  for (ResultName& name : parse_result_names(shared_names().at(block)).estimate) {
    name.path = prefix + name.path;
    part.push_back(std::move(name));
  }
}

}  // namespace

std::vector<std::string> commands_with_results() {
  std::vector<std::string> names;
  for (const auto& [command, table] : tables()) names.push_back(command);
  return names;
}

ResultNames result_names(const std::string& command) { return parse_result_names(tables().at(command)); }

ResultNames parse_result_names(std::string_view text) {
  ResultNames names;
  std::map<std::string, std::vector<ResultName>*> parts{
      {"estimate:", &names.estimate}, {"data:", &names.data}, {"grids:", &names.grids}, {"files:", &names.files}};
  std::vector<ResultName>* part = &names.estimate;
  std::istringstream lines{std::string(text)};
  std::string line, prefix;
  while (std::getline(lines, line)) {
    std::istringstream words(line);
    ResultName name;
    if (!(words >> name.path)) continue;
    if (const auto heading = parts.find(name.path); heading != parts.end()) {
      part = heading->second;
      prefix.clear();
      continue;
    }
    if (!line.starts_with(' ')) prefix.clear();
    if (name.path.starts_with('@')) {
      words >> name.kind;
      add_shared(name.path, prefix + name.kind, *part);
      continue;
    }
    if (name.path.ends_with('.')) {
      prefix = name.path;
      continue;
    }
    words >> name.kind >> std::ws;
    std::getline(words, name.meaning);
    name.path = prefix + name.path;
    part->push_back(std::move(name));
  }
  return names;
}

}  // namespace alidade
