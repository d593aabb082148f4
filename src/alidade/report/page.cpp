#include "alidade/report/page.h"

#include "alidade/report/markup.h"
#include "alidade/report/plain_page.h"

#ifdef ALIDADE_WEB
extern "C" {
extern const char alidade_report_template[];      // template.S
extern const char alidade_report_template_end[];  // one behind its last character
}
#endif

namespace alidade {
namespace {

#ifdef ALIDADE_WEB
std::string_view page_template() {
  return {alidade_report_template, static_cast<std::size_t>(alidade_report_template_end - alidade_report_template)};
}
#else
std::string_view page_template() { return {}; }
#endif

/// The command's name, without reading the whole document, which may be megabytes.
std::string_view command_of(std::string_view result_json) {
  constexpr std::string_view key = "\"command\"";
  const std::size_t at = result_json.find(key);
  if (at == std::string_view::npos) return {};
  const std::size_t begin = result_json.find('"', at + key.size());
  if (begin == std::string_view::npos) return {};
  const std::size_t end = result_json.find('"', begin + 1);
  return end == std::string_view::npos ? std::string_view{} : result_json.substr(begin + 1, end - begin - 1);
}

/// Appends the template up to a placeholder, and what stands for it.
void append_until(std::string& page, std::string_view& rest, std::string_view placeholder, std::string_view value) {
  const std::size_t at = rest.find(placeholder);
  if (at == std::string_view::npos) return;
  page += rest.substr(0, at);
  page += value;
  rest.remove_prefix(at + placeholder.size());
}

/// Inert blocks, each made an image when it is first looked at.
std::string image_blocks(const std::map<std::string, std::string>& images) {
  std::string blocks;
  std::size_t index = 0;
  for (const auto& [name, jpeg] : images)
    blocks += "<script type=\"text/plain\" id=\"image-" + std::to_string(index++) + "\" data-name=\"" +
              report::escaped(name) + "\">" + report::base64(jpeg) + "</script>\n";
  return blocks;
}

}  // namespace

std::string report_page(std::string_view result_json, const std::map<std::string, std::string>& images) {
  std::string_view rest = page_template();
  if (rest.empty()) return report::plain_page(result_json);
  const std::string blocks = image_blocks(images);
  std::string page;
  page.reserve(rest.size() + result_json.size() + blocks.size() + 1024);
  append_until(page, rest, "@TITLE@", "alidade " + report::escaped(command_of(result_json)));
  append_until(page, rest, "@RESULT@", report::json_in_script(result_json));
  append_until(page, rest, "@PICTURES@", blocks);
  page += rest;
  return page;
}

}  // namespace alidade
