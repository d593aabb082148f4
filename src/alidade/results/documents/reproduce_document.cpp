#include "alidade/results/documents/reproduce_document.h"

#include <fmt/format.h>

#include <cmath>

#include "alidade/files/csv.h"

namespace alidade {
namespace {

using reproduce::Claim;
using reproduce::Experiment;
using reproduce::FigureTable;
using reproduce::Holds;
using Numbers = std::vector<double>;
using Texts = std::vector<std::string>;

State state_of(Holds holds) {
  return holds == Holds::reproduced ? State::good : holds == Holds::in_shape ? State::care : State::bad;
}

/// To five digits: the precision of a draw, and a small document.
double short_number(double value) {
  if (!std::isfinite(value) || value == 0.0) return value;
  return std::stod(fmt::format("{:.5g}", value));
}

JsonValue claim_value(const Experiment& experiment, const Claim& claim) {
  JsonValue value = JsonValue::object();
  value["id"] = claim.id;
  value["experiment"] = experiment.id;
  value["quantity"] = claim.quantity;
  value["unit"] = claim.unit;
  value["paper"] = claim.printed;
  value["ours"] = short_number(claim.rerun);
  value["best"] = short_number(claim.ours);
  value["bound"] = short_number(claim.bound);
  value["holds"] = holds_name(claim.holds);
  value["words"] = claim.words;
  return value;
}

DataTable experiments_table(const reproduce::PaperReport& report) {
  Texts ids, quantities, units, states, words;
  Numbers printed, rerun, ours, bound, ratio;
  for (const Experiment& experiment : report.experiments) {
    for (const Claim& claim : experiment.claims) {
      ids.push_back(claim.id);
      quantities.push_back(claim.quantity);
      units.push_back(claim.unit);
      states.push_back(state_name(state_of(claim.holds)));
      words.push_back(std::string(holds_name(claim.holds)) + ". " + claim.words);
      printed.push_back(claim.printed);
      rerun.push_back(short_number(claim.rerun));
      ours.push_back(short_number(claim.ours));
      bound.push_back(short_number(claim.bound));
      ratio.push_back(claim.printed != 0.0 ? short_number(claim.rerun / claim.printed) : std::nan(""));
    }
  }
  return {"experiments",
          {{"id", ids},
           {"quantity", quantities},
           {"unit", units},
           {"printed", printed},
           {"ours", rerun},
           {"best", ours},
           {"bound", bound},
           {"ratio", ratio},
           {"state", states},
           {"words", words}}};
}

DataTable methods_table(const reproduce::PaperReport& report) {
  Texts ids, titles, methods, chosen;
  for (const Experiment& experiment : report.experiments) {
    ids.push_back(experiment.id);
    titles.push_back(experiment.title);
    methods.push_back(experiment.method);
    chosen.push_back(experiment.chosen);
  }
  return {"methods", {{"experiment", ids}, {"title", titles}, {"method", methods}, {"chosen", chosen}}};
}

/// Of each figure, what it shows.
DataTable figures_table(const reproduce::PaperReport& report) {
  Texts ids, titles, captions, across, up;
  for (const Experiment& experiment : report.experiments) {
    for (const FigureTable& figure : experiment.figures) {
      ids.push_back(figure.id);
      titles.push_back(figure.title);
      captions.push_back(figure.caption);
      across.push_back(figure.across);
      up.push_back(figure.up);
    }
  }
  return {"figures", {{"id", ids}, {"title", titles}, {"caption", captions}, {"across", across}, {"up", up}}};
}

std::string cell_of(double value) { return std::isfinite(value) ? fmt::format("{:.6g}", value) : ""; }

std::string figure_csv(const FigureTable& figure) {
  std::string text = figure.labels.empty() ? "" : "label";
  for (const auto& [name, values] : figure.columns) text += (text.empty() ? "" : ",") + name;
  text += "\n";
  for (std::size_t row = 0; row < figure.columns.front().second.size(); ++row) {
    std::string line = figure.labels.empty() ? "" : csv_cell(figure.labels[row]) + ",";
    for (const auto& [name, values] : figure.columns)
      line += (&values == &figure.columns.front().second ? "" : ",") + cell_of(values[row]);
    text += line + "\n";
  }
  return text;
}

std::string claims_csv(const reproduce::PaperReport& report) {
  std::string text = "experiment,id,quantity,unit,printed,ours,best,bound,holds,words\n";
  for (const Experiment& experiment : report.experiments) {
    for (const Claim& claim : experiment.claims)
      text += fmt::format("{},{},{},{},{},{},{},{},{},{}\n", experiment.id, claim.id, csv_cell(claim.quantity),
                          csv_cell(claim.unit), cell_of(claim.printed), cell_of(claim.rerun), cell_of(claim.ours),
                          cell_of(claim.bound), holds_name(claim.holds), csv_cell(claim.words));
  }
  return text;
}

}  // namespace

void fill_reproduction(const reproduce::PaperReport& report, ResultDocument& document) {
  document.counts.given = report.num_claims();
  document.counts.used = report.num_claims();
  JsonValue claims = JsonValue::list();
  for (const Experiment& experiment : report.experiments)
    for (const Claim& claim : experiment.claims) claims.push_back(claim_value(experiment, claim));
  document.estimate["paper"] = report.paper;
  document.estimate["reference"] = report.reference;
  document.estimate["reproduced"] = report.count(Holds::reproduced);
  document.estimate["in_shape"] = report.count(Holds::in_shape);
  document.estimate["not_reproducible"] = report.count(Holds::not_reproducible);
  document.estimate["claims"] = std::move(claims);
  document.data.push_back(experiments_table(report));
  document.data.push_back(methods_table(report));
  document.data.push_back(figures_table(report));
  for (const Experiment& experiment : report.experiments) {
    for (const FigureTable& figure : experiment.figures) {
      DataTable table{"fig_" + figure.id, {}};
      if (!figure.labels.empty()) table.columns.emplace_back("label", figure.labels);
      for (const auto& [name, values] : figure.columns) {
        Numbers numbers;
        for (const double value : values) numbers.push_back(short_number(value));
        table.columns.emplace_back(name, std::move(numbers));
      }
      document.data.push_back(std::move(table));
    }
  }
}

std::vector<std::pair<std::string, std::string>> reproduction_csvs(const reproduce::PaperReport& report) {
  std::vector<std::pair<std::string, std::string>> files{{"claims.csv", claims_csv(report)}};
  for (const Experiment& experiment : report.experiments)
    for (const FigureTable& figure : experiment.figures)
      files.emplace_back("fig_" + figure.id + ".csv", figure_csv(figure));
  return files;
}

}  // namespace alidade
