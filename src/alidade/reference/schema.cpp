#include "alidade/reference/schema.h"

#include <charconv>
#include <initializer_list>
#include <map>
#include <memory>

namespace alidade {
namespace {

/// Names as a tree: what stands under a member, or in each element of a list.
struct Node {
  const ResultName* leaf = nullptr;
  bool is_list = false;
  long length = 0;  ///< Of a list; 0: any.
  std::vector<std::pair<std::string, std::unique_ptr<Node>>> members;

  Node& member(const std::string& name) {
    for (auto& [known, node] : members) {
      if (known == name) return *node;
    }
    members.emplace_back(name, std::make_unique<Node>());
    return *members.back().second;
  }
};

/// "origin_m[3]" is a list of three.
Node& step_into(Node& node, std::string part) {
  const std::size_t open = part.find('[');
  long length = 0;
  if (open != std::string::npos) std::from_chars(&part[open] + 1, part.data() + part.size() - 1, length);
  Node& next = node.member(part.substr(0, open));
  next.is_list = open != std::string::npos;
  next.length = length;
  return next;
}

Node tree_of(const std::vector<ResultName>& names) {
  Node root;
  for (const ResultName& name : names) {
    Node* node = &root;
    for (std::size_t begin = 0; begin <= name.path.size();) {
      const std::size_t end = std::min(name.path.find('.', begin), name.path.size());
      node = &step_into(*node, name.path.substr(begin, end - begin));
      begin = end + 1;
    }
    node->leaf = &name;
  }
  return root;
}

JsonValue one_of_types(std::initializer_list<const char*> types) {
  JsonValue value = JsonValue::object(), list = JsonValue::list();
  for (const char* type : types) list.push_back(type);
  value["type"] = list;
  return value;
}

JsonValue leaf_schema(const ResultName& name) {
  if (name.kind == "any") return JsonValue::object();
  if (name.kind == "text") return one_of_types({"string", "null"});
  if (name.kind == "flag") return one_of_types({"boolean", "null"});
  if (name.kind == "count") return one_of_types({"integer", "null"});
  JsonValue value = one_of_types({"number", "null"});
  if (name.kind != "1") value["x-unit"] = name.kind;
  return value;
}

/// `all_numbers`: of σ, which has the names of what it is the σ of.
JsonValue node_schema(const Node& node, bool all_numbers) {
  JsonValue value = JsonValue::object();
  if (!node.members.empty()) {
    value["type"] = "object";
    value["additionalProperties"] = false;
    for (const auto& [name, child] : node.members) {
      JsonValue& place = name == "*" ? value["additionalProperties"] : value["properties"][name];
      place = node_schema(*child, all_numbers);
    }
  } else if (node.leaf != nullptr) {
    value = all_numbers && node.leaf->kind != "any" ? one_of_types({"number", "null"}) : leaf_schema(*node.leaf);
  }
  if (node.leaf != nullptr) value["description"] = node.leaf->meaning;
  if (!node.is_list) return value;
  JsonValue list = JsonValue::object();
  list["type"] = "array";
  list["items"] = std::move(value);
  if (node.length > 0) list["minItems"] = list["maxItems"] = node.length;
  return list;
}

JsonValue object_schema(const std::vector<ResultName>& names, bool all_numbers = false) {
  if (!names.empty()) return node_schema(tree_of(names), all_numbers);
  JsonValue value = JsonValue::object();
  value["type"] = "object";
  value["additionalProperties"] = false;
  return value;
}

/// Tables: columns are lists of one length, beside `thinned` where rows were omitted.
JsonValue tables_schema(std::vector<ResultName> columns) {
  std::vector<ResultName> names;
  std::string table;
  for (ResultName& column : columns) {
    const std::string name = column.path.substr(0, column.path.find('.'));
    if (name != table) {
      names.push_back({name + ".thinned.from", "count", "rows of the whole table"});
      names.push_back({name + ".thinned.to", "count", "rows that are here"});
      names.push_back({name + ".thinned.how", "text", "which rows were kept"});
      table = name;
    }
    column.path += "[]";
    names.push_back(std::move(column));
  }
  return object_schema(names);
}

JsonValue grids_schema(std::vector<ResultName> values) {
  std::vector<ResultName> names;
  std::string grid;
  for (ResultName& value : values) {
    const std::string name = value.path.substr(0, value.path.find('.'));
    if (name != grid) {
      names.push_back({name + ".cols", "count", "values in a row"});
      names.push_back({name + ".rows", "count", "rows"});
      names.push_back({name + ".u0_px", "px", "column of the first value"});
      names.push_back({name + ".v0_px", "px", "row of the first value"});
      names.push_back({name + ".du_px", "px", "from column to column"});
      names.push_back({name + ".dv_px", "px", "from row to row"});
      grid = name;
    }
    value.path += "[]";
    names.push_back(std::move(value));
  }
  return object_schema(names);
}

/// What every document has, whatever the command.
const char* const common_names = R"(estimate:
schema              text   alidade-result/1
command             text   what ran
version             text   of alidade
argv[]              text   the command line
created_utc         text   2026-01-31T12:00:00Z
seed                count  of random numbers; null where none are drawn
seconds.*           s      total, and its parts
inputs[].role       text   photo, camera, log …
inputs[].name       text   as given
inputs[].bytes      count  size
inputs[].sha256     text   of the content
verdict.state       text   good, care, bad, refused or not_converged
verdict.exit_code   count  of the command
verdict.sentence    text   the answer, or why there is none
verdict.to_add      text   what to do
verdict.checks[].name    text  what was looked at
verdict.checks[].state   text  good, care or bad
verdict.checks[].text    text  what was seen
verdict.checks[].value   1     the figure
verdict.checks[].limit   1     from which on it is doubted
verdict.checks[].unit    text  of both
verdict.checks[].figure  text  of the page that shows it
counts.given        count  photos, rows or frames
counts.used         count  of them
counts.dropped      count  of them, as outliers
counts.skipped[].file    text   whose
counts.skipped[].line    count  null: the whole file
counts.skipped[].reason  text   why
assumed[].name      text   what was taken as given
assumed[].value     any    as it was given
assumed[].sigma     1      counted in the answer's; 0: exact; null: not given
assumed[].ordinary  1      the error supposed where there is no σ
assumed[].moves     1      how far the answer moves by it, in σ; null: `moved` says it
assumed[].moved     text   the value that moves most
assumed[].moved_by  1      how far, in its unit
covariance.names[]  text   the parameters
covariance.upper[]  1      upper triangle, row by row
files[]             text   written beside the document
)";

JsonValue files_schema(const std::vector<ResultName>& files) {
  JsonValue value = JsonValue::object();
  for (const ResultName& name : files) {
    const std::size_t dot = name.path.find('.', name.path.find('.') + 1);
    JsonValue& file = value[name.path.substr(0, dot)];
    if (dot == std::string::npos) {
      file["description"] = name.meaning;
      continue;
    }
    JsonValue& column = file["columns"][name.path.substr(dot + 1)];
    column["kind"] = name.kind;
    column["description"] = name.meaning;
  }
  return value;
}

}  // namespace

JsonValue result_schema(const std::string& command) {
  const ResultNames names = result_names(command), common = parse_result_names(common_names);
  JsonValue value = JsonValue::object();
  value["$schema"] = "https://json-schema.org/draft/2020-12/schema";
  value["title"] = "result.json of alidade " + command;
  const JsonValue described = object_schema(common.estimate);
  for (const auto& [key, member] : std::get<JsonValue::Object>(described.content())) value[key] = member;
  value["properties"]["estimate"] = object_schema(names.estimate);
  value["properties"]["stddev"] = object_schema(names.estimate, true);
  value["properties"]["stddev_model"] = object_schema(names.estimate, true);
  value["properties"]["data"] = tables_schema(names.data);
  value["properties"]["grids"] = grids_schema(names.grids);
  JsonValue required = JsonValue::list();
  for (const auto& [name, unused] : std::get<JsonValue::Object>(value["properties"].content()))
    required.push_back(name);
  value["required"] = required;
  value["x-files"] = files_schema(names.files);
  return value;
}

}  // namespace alidade
