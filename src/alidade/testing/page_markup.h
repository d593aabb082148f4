#pragma once

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <cctype>
#include <regex>
#include <string>
#include <vector>

namespace alidade::testing {

inline std::size_t occurrences(const std::string& page, const std::string& text) {
  std::size_t count = 0;
  for (std::size_t at = page.find(text); at != std::string::npos; at = page.find(text, at + text.size())) ++count;
  return count;
}

/// The markup of one card.
inline std::string card_of(const std::string& page, const std::string& id) {
  const std::size_t begin = page.find("<section class=\"card\" id=\"fig-" + id + "\"");
  return begin == std::string::npos ? "" : page.substr(begin, page.find("</section>", begin) - begin);
}

inline int marks_of(const std::string& page, const std::string& id) {
  std::smatch match;
  const std::string card = card_of(page, id).substr(0, 200);
  return std::regex_search(card, match, std::regex("data-marks=\"(\\d+)\"")) ? std::stoi(match[1]) : -1;
}

/// Markup whose tags do not balance shows as a broken page. Void and self-closing tags need no end.
inline void expect_balanced(const std::string& page) {
  const std::string body = page.substr(0, page.find("<script"));
  std::vector<std::string> open;
  std::size_t checked = 0;
  for (std::size_t at = body.find('<'); at != std::string::npos; at = body.find('<', at + 1)) {
    const bool is_end = body[at + 1] == '/';
    std::size_t name_end = at + (is_end ? 2 : 1);
    while (name_end < body.size() && std::isalnum(static_cast<unsigned char>(body[name_end]))) ++name_end;
    const std::string name = body.substr(at + (is_end ? 2 : 1), name_end - at - (is_end ? 2 : 1));
    std::size_t close = name_end;
    for (bool in_quotes = false; close < body.size() && (in_quotes || body[close] != '>'); ++close)
      if (body[close] == '"') in_quotes = !in_quotes;
    ++checked;
    const bool is_void = name == "meta" || name == "img" || name == "input" || name.empty() || body[close - 1] == '/';
    if (is_end) {
      ASSERT_FALSE(open.empty()) << name;
      ASSERT_EQ(open.back(), name);
      open.pop_back();
    } else if (!is_void) {
      open.push_back(name);
    }
    at = close;
  }
  EXPECT_THAT(open, ::testing::ElementsAre("html", "body"));  // closed behind the scripts
  EXPECT_GT(checked, 20u);
}

}  // namespace alidade::testing
