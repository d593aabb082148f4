#include "alidade/report/page_frame.h"

#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <cmath>

#include "alidade/report/markup.h"

namespace alidade::report {
namespace {

struct StateLook {
  std::string_view name, symbol, word;
};

// Never by colour alone: a symbol and a word go with it.
constexpr std::array<StateLook, 5> state_looks{{{"good", "●", "Good"},
                                                {"care", "◆", "Usable with care"},
                                                {"bad", "▲", "Bad"},
                                                {"refused", "■", "Refused"},
                                                {"not_converged", "✕", "Not converged"}}};

StateLook look_of(const std::string& state) {
  const auto found =
      std::find_if(state_looks.begin(), state_looks.end(), [&](const StateLook& l) { return l.name == state; });
  return found == state_looks.end() ? StateLook{"unknown", "○", "No verdict"} : *found;
}

bool begins_alike(std::string_view sentence, std::string_view word) {
  return sentence.size() >= word.size() && std::equal(word.begin(), word.end(), sentence.begin(),
                                                      [](char a, char b) { return (a | 0x20) == (b | 0x20); });
}

double count(const Document& document, std::string_view name) {
  const auto found =
      std::find_if(document.counts.begin(), document.counts.end(), [&](const auto& c) { return c.first == name; });
  return found == document.counts.end() ? std::nan("") : found->second;
}

double total_seconds(const Document& document) {
  for (const auto& [name, value] : document.seconds)
    if (name == "total") return value;
  return std::nan("");
}

std::string counts_line(const Document& document) {
  std::vector<std::string> parts;
  const bool is_calibrate = document.command == "calibrate";
  const double used = count(document, "used"), given = count(document, "given"), dropped = count(document, "dropped");
  if (std::isfinite(used))
    parts.push_back(fmt::format("{}{} {}", number_text(used, 9), given > used ? " of " + number_text(given, 9) : "",
                                is_calibrate                        ? "photos"
                                : document.command == "observe"     ? "rows"
                                : document.command == "rangefinder" ? "shots"
                                                                    : "used"));
  if (const Table* corners = document.table("corners"); corners && is_calibrate)
    parts.push_back(fmt::format("{} corners{}", corners->num_rows,
                                std::isfinite(dropped) ? " (" + number_text(dropped, 9) + " dropped)" : ""));
  else if (std::isfinite(dropped))
    parts.push_back(number_text(dropped, 9) + " dropped");
  if (!document.skipped.empty()) parts.push_back(fmt::format("{} skipped", document.skipped.size()));
  if (const double rms = document.estimated("rms_px"); std::isfinite(rms))
    parts.push_back("RMS " + number_text(rms, 3) + (is_calibrate ? " px per corner" : " px"));
  if (const double rms = document.estimated("rms_range_m"); rms > 0.0)
    parts.push_back("ranges " + number_text(1e3 * rms, 3) + " mm");
  if (const double seconds = total_seconds(document); std::isfinite(seconds))
    parts.push_back(number_text(seconds, 2) + " s");
  std::string line;
  for (const std::string& part : parts) line += (line.empty() ? "" : " · ") + part;
  return escaped(line);
}

// Checks may name the table or grid that decides instead of the figure that shows it.
std::string figure_of_check(const std::string& name) {
  if (name.rfind("sigma", 0) == 0) return "trust";
  if (name == "rings" || name == "models") return "lens";
  if (name == "cells" || name == "corners") return "residuals";
  return name == "board_points" ? "board" : name;
}

std::string check_markup(const CheckLine& check, const std::vector<Figure>& figures) {
  const StateLook look = look_of(check.state);
  const std::string target = figure_of_check(check.figure);
  const bool has_figure = std::any_of(figures.begin(), figures.end(), [&](const Figure& f) { return f.id == target; });
  const std::string name =
      fmt::format("<span class=\"state-{}\"><span role=\"img\" aria-label=\"{}\">{}</span> <b>{}</b></span>", look.name,
                  look.word, look.symbol, escaped(check.name));
  const std::string inside = name + " " + escaped(check.text);
  if (!has_figure) return "<li>" + inside + "</li>";
  return "<li><a href=\"#fig-" + target + "\">" + inside + "</a></li>";
}

std::string row(std::string_view name, const std::string& value_markup) {
  return fmt::format("<tr><th>{}</th><td>{}</td></tr>", name, value_markup);
}

std::string inputs_table(const Document& document) {
  if (document.inputs.empty()) return "";
  std::string rows;
  for (const InputFile& input : document.inputs)
    rows += "<tr><td class=\"word\">" + escaped(input.role) + "</td><td class=\"word\">" + escaped(input.name) +
            "</td><td>" + number_text(input.bytes, 12) + "</td><td class=\"word hash\">" + escaped(input.sha256) +
            "</td></tr>";
  return fmt::format(
      "<details{}><summary>{} input files</summary><div class=\"scroll\"><table class=\"data\"><thead><tr><th>role</th>"
      "<th>name</th><th>bytes</th><th>SHA-256</th></tr></thead><tbody>{}</tbody></table></div></details>",
      document.inputs.size() <= 3 ? " open" : "", document.inputs.size(), rows);
}

std::string skipped_list(const Document& document) {
  if (document.skipped.empty()) return "";
  std::string items;
  for (const SkippedInput& one : document.skipped) {
    const std::string line = std::isfinite(one.line) ? fmt::format(":{}", number_text(one.line, 12)) : "";
    items += "<li><b>" + escaped(one.file + line) + "</b> " + escaped(one.reason) + "</li>";
  }
  return fmt::format("<details{}><summary>{} skipped, and why</summary><ul>{}</ul></details>",
                     document.skipped.size() <= 6 ? " open" : "", document.skipped.size(), items);
}

}  // namespace

std::string page_header(const Document& document, const std::vector<Figure>& figures) {
  const StateLook look = look_of(document.state);
  const std::string word = begins_alike(document.sentence, look.word) ? "" : fmt::format("{}: ", look.word);
  std::string out = fmt::format(
      "<header class=\"top border-{0}\"><div class=\"headline\"><h1><span class=\"state-{0}\" "
      "aria-hidden=\"true\">{1}</span> "
      "<span class=\"state-{0}\">{2}</span>{3}</h1><nav><button id=\"theme\">dark / light</button>"
      "<button id=\"download\">result.json</button></nav></div>",
      look.name, look.symbol, word, document.sentence.empty() ? "no sentence was given" : escaped(document.sentence));
  out += "<p class=\"counts\"><b>alidade " + escaped(document.command) + "</b> · " + counts_line(document) + "</p>";
  if (!document.to_add.empty()) out += "<p class=\"to-add\"><b>What to do:</b> " + escaped(document.to_add) + "</p>";
  if (!document.checks.empty()) {
    out += "<ul class=\"checks\">";
    for (const CheckLine& check : document.checks) out += check_markup(check, figures);
    out += "</ul>";
  }
  return out + "</header>";
}

std::string card(const Figure& figure) {
  return fmt::format(
             "<section class=\"card\" id=\"fig-{0}\" style=\"--span:{1}\" data-marks=\"{2}\"><div "
             "class=\"title\"><h2>{3}</h2><span>{4}</span></div>",
             figure.id, figure.span, figure.marks, escaped(figure.title), escaped(figure.note)) +
         figure.body + (figure.good.empty() ? "" : "<p class=\"good\">" + escaped(figure.good) + "</p>") + "</section>";
}

std::string provenance(const Document& document) {
  std::string command_line, seconds;
  for (const std::string& word : document.argv) {
    const bool is_plain = !word.empty() && word.find_first_of(" '\"\\$&|;<>()*?\t\n") == std::string::npos;
    command_line += (command_line.empty() ? "" : " ") + (is_plain ? word : "'" + word + "'");
  }
  for (const auto& [name, value] : document.seconds)
    seconds += (seconds.empty() ? "" : " · ") + escaped(name) + " " + number_text(value, 3) + " s";
  std::string out = "<footer><h2>Where this comes from</h2><table class=\"provenance\">";
  out += row("version", "alidade " + (document.version.empty() ? "–" : escaped(document.version)));
  out += row("command", "<code>" + (command_line.empty() ? "–" : escaped(command_line)) + "</code>");
  out += row("made", document.created_utc.empty() ? "–" : escaped(document.created_utc));
  out += row("seed", document.seed.empty() ? "–" : escaped(document.seed));
  out += row("time", seconds.empty() ? "–" : seconds);
  out += "</table>" + inputs_table(document) + skipped_list(document);
  return out + "</footer>";
}

}  // namespace alidade::report
