#include "alidade/results/file_verdict.h"

#include <fmt/format.h>
#include <yaml-cpp/yaml.h>

#include "alidade/files/yaml_fields.h"

namespace alidade {

std::string file_verdict_text(const Verdict& verdict, const std::string& cause) {
  if (verdict.state != State::care && verdict.state != State::bad) return "";
  return fmt::format("verdict: {}\nverdict_sentence: {}\n", verdict.state == State::care ? "care" : "bad",
                     detail::quoted_text(verdict.sentence)) +
         (cause.empty() ? "" : fmt::format("verdict_cause: {}\n", detail::quoted_text(cause)));
}

std::optional<FileVerdict> file_verdict(std::string_view text) {
  if (text.find("\nverdict: ") == std::string_view::npos) return std::nullopt;
  try {
    const YAML::Node root = YAML::Load(std::string(text));
    if (!root.IsMap() || !root["verdict"] || !root["verdict"].IsScalar()) return std::nullopt;
    const std::string state = root["verdict"].Scalar();
    if (state != "care" && state != "bad") return std::nullopt;
    const auto text_at = [&root](const char* key) {
      const YAML::Node node = root[key];
      return node && node.IsScalar() ? node.Scalar() : std::string();
    };
    return FileVerdict{state == "bad" ? State::bad : State::care, text_at("verdict_sentence"),
                       text_at("verdict_cause")};
  } catch (const YAML::Exception&) {
    return std::nullopt;  // its reader says so
  }
}

void heed_file(const std::string& file, const FileVerdict& told, bool is_passed_on, Verdict& verdict) {
  const bool is_bad = told.state == State::bad;
  const Check check{.name = "inputs",
                    .state = is_bad || is_passed_on || !told.cause.empty() ? State::care : State::good,
                    .text = fmt::format("the run that made {} says {}: {}", file, is_bad ? "▲" : "◆",
                                        told.cause.empty() ? told.sentence : told.cause)};
  heed(check,
       told.cause.empty() ? fmt::format("see what the run that made {} advises", file)
                          : fmt::format("mend that, and make {} again", file),
       verdict);
}

}  // namespace alidade
