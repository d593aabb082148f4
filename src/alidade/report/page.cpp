#include "alidade/report/page.h"

#include <fmt/format.h>

#include "alidade/report/figures.h"
#include "alidade/report/markup.h"
#include "alidade/report/page_frame.h"

namespace alidade {
namespace {

using report::CalibrateScene;
using report::Document;
using report::Figure;
using report::MaybeFigure;
using report::Pictures;

struct Content {
  std::vector<Figure> figures;
  std::vector<std::string> left_out;  // titles of figures whose tables are missing
  std::string shared;
};

void add(Content& content, MaybeFigure figure, const char* title) {
  if (figure)
    content.figures.push_back(std::move(*figure));
  else
    content.left_out.emplace_back(title);
}

Content calibrate_content(const Document& document, const Pictures& pictures) {
  const CalibrateScene scene = report::calibrate_scene(document, pictures);
  Content content;
  add(content, report::figure_estimate(document), "Estimate");
  add(content, report::figure_trust(scene), "Where can I trust a pixel?");
  add(content, report::figure_residuals(scene), "Have the residuals structure?");
  add(content, report::figure_worst_photos(scene), "Which photos fit worst?");
  add(content, report::figure_poses(scene, pictures), "Where was the board?");
  add(content, report::figure_photo(scene, pictures), "This photo");
  add(content, report::figure_all_photos(scene, pictures), "Is it the same in every photo?");
  add(content, report::figure_halves(scene), "Do the halves agree?");
  add(content, report::figure_lens(scene), "Is the lens model enough?");
  add(content, report::figure_board(scene), "Is the board flat?");
  add(content, report::figure_next(scene), "What next?");
  add(content, report::figure_undistorted(scene, pictures), "Are straight lines straight?");
  content.shared = report::shared_drawings(scene, pictures);
  return content;
}

Content difference_content(const Document& document) {
  Content content;
  add(content, report::figure_difference(document), "How far apart?");
  add(content, report::figure_diagonal(document), "Where along the diagonal?");
  add(content, report::figure_parameters(document), "Which parameters differ?");
  add(content, report::figure_estimate(document), "Estimate");
  if (content.figures.size() == 4) content.figures.back().span = 10;
  return content;
}

Content observe_content(const Document& document) {
  const report::ObserveScene scene = report::observe_scene(document);
  Content content;
  add(content, report::figure_estimate(document), "Estimate");
  add(content, report::figure_observe_intrinsics(scene), "What are fx, fy, cx and cy, and how sure is it?");
  add(content, report::figure_observe_motion(scene), "Did the motion tell enough?");
  add(content, report::figure_observe_nis(scene), "Does each frame fit?");
  add(content, report::figure_observe_tracks(scene), "Where were the points seen?");
  add(content, report::figure_observe_directions(scene), "Where did it look?");
  add(content, report::figure_observe_points(scene), "Does each point fit?");
  return content;
}

Content rangefinder_content(const Document& document, const Pictures& pictures) {
  const report::RangefinderScene scene = report::rangefinder_scene(document, pictures);
  Content content;
  add(content, report::figure_rangefinder_estimate(scene), "Estimate");
  if (!document.is_answer()) add(content, report::figure_rangefinder_refusal(scene), "What cannot be told?");
  add(content, report::figure_rangefinder_beam(scene), "Where is the beam?");
  add(content, report::figure_rangefinder_residuals(scene), "Does each shot fit?");
  add(content, report::figure_rangefinder_photo(scene, pictures), "Is the spot where the beam puts it?");
  add(content, report::figure_rangefinder_precision(scene), "How well is it known?");
  add(content, report::figure_rangefinder_next(scene), "Which shot next?");
  add(content, report::figure_rangefinder_counts(scene), "Do more shots help?");
  add(content, report::figure_rangefinder_all_photos(scene, pictures), "Is it the same in every photo?");
  content.shared = report::shared_rangefinder_drawings(scene, pictures);
  if (!document.is_answer())  // the refusal stands where the beam would
    for (Figure& figure : content.figures) {
      if (figure.id == "beam") figure.span = 14;
      if (figure.id == "residuals") figure.span = 10;
      if (figure.id == "precision") figure.span = 14;
    }
  return content;
}

Content content_of(const Document& document, const Pictures& pictures) {
  if (document.command == "calibrate") return calibrate_content(document, pictures);
  if (document.command == "observe") return observe_content(document);
  if (document.command == "rangefinder") return rangefinder_content(document, pictures);
  if (document.command == "camera diff") return difference_content(document);
  Content content;
  add(content, report::figure_estimate(document), "Estimate");
  return content;
}

std::string left_out_words(const Content& content) {
  if (content.left_out.empty()) return "";
  std::string titles;
  for (const std::string& title : content.left_out) titles += (titles.empty() ? "" : " · ") + title;
  return "<p class=\"left-out\">Left out, as this run has no data for them: " + report::escaped(titles) + "</p>";
}

constexpr std::string_view hatch =
    "<svg class=\"shared\" aria-hidden=\"true\"><defs><pattern id=\"hatch\" width=\"6\" height=\"6\" "
    "patternUnits=\"userSpaceOnUse\" "
    "patternTransform=\"rotate(45)\"><line x1=\"0\" y1=\"0\" x2=\"0\" y2=\"6\" stroke=\"#888\" "
    "stroke-width=\"2.5\"/></pattern></defs></svg>";

}  // namespace

std::string report_page(std::string_view result_json, const std::map<std::string, std::string>& pictures) {
  constexpr std::size_t many_corners = 5000;  // dots become thinner
  Document document = report::read_document(result_json);
  if (!document.readable) document.sentence = "The result document cannot be read.";
  const Content content = content_of(document, pictures);
  const report::Table* corners = document.table("corners");
  std::string page =
      "<!DOCTYPE html>\n<html lang=\"en\"><head><meta charset=\"utf-8\"><meta name=\"viewport\" "
      "content=\"width=device-width,initial-scale=1\">"
      "<title>alidade " +
      report::escaped(document.command) + "</title><style>" + report::page_style() + "</style></head><body" +
      (corners && corners->num_rows > many_corners ? " class=\"many\">" : ">");
  page += report::page_header(document, content.figures);
  page += hatch;
  page += "<main>";
  for (const Figure& figure : content.figures) page += report::card(figure);
  page += "</main><div class=\"below\">" + left_out_words(content);
  if (const std::string tables = report::data_tables(document); !tables.empty())
    page +=
        "<section id=\"data\"><div class=\"title\"><h2>Data behind the figures</h2><span>camera.yaml and the other "
        "files lie beside this page</span></div>" +
        tables + "</section>";
  page += report::provenance(document) + "</div>" + content.shared;
  page += "<script type=\"application/json\" id=\"result\">" +
          (document.readable ? report::json_in_script(result_json) : "null") + "</script>";
  page += "<script>";
  page += report::page_script();
  return page + "</script></body></html>\n";
}

}  // namespace alidade
