//===- TypeText.cpp - Reading the text of native types --------------------===//
//
// Part of Warp on MLIR, under the Apache License v2.0.
//
// The runtime half of the module knows types by their text alone. Here is the
// little of the grammar that packing and messages need.
//
//===----------------------------------------------------------------------===//

#include "Pack.h"

#include <cctype>
#include <cstdlib>
#include <optional>

using namespace warp;
using namespace warp::python;

namespace {
struct ScalarName {
  const char *text, *python, *suffix;
  Scalar scalar;
};
} // namespace

static const ScalarName scalarNames[] = {
    {"i1", "bool", nullptr, Scalar::Bool},
    {"si8", "int8", "b", Scalar::I8},
    {"si16", "int16", "s", Scalar::I16},
    {"si32", "int32", "i", Scalar::I32},
    {"si64", "int64", "l", Scalar::I64},
    {"ui8", "uint8", "ub", Scalar::U8},
    {"ui16", "uint16", "us", Scalar::U16},
    {"ui32", "uint32", "ui", Scalar::U32},
    {"ui64", "uint64", "ul", Scalar::U64},
    {"f16", "float16", "h", Scalar::F16},
    {"bf16", "bfloat16", nullptr, Scalar::BF16},
    {"f32", "float32", "f", Scalar::F32},
    {"f64", "float64", "d", Scalar::F64},
};

static const ScalarName *findScalar(const std::string &text) {
  for (const ScalarName &name : scalarNames)
    if (text == name.text)
      return &name;
  return nullptr;
}

int64_t python::byteSize(Scalar scalar) {
  switch (scalar) {
  case Scalar::Bool:
  case Scalar::I8:
  case Scalar::U8:
    return 1;
  case Scalar::I16:
  case Scalar::U16:
  case Scalar::F16:
  case Scalar::BF16:
    return 2;
  case Scalar::I32:
  case Scalar::U32:
  case Scalar::F32:
    return 4;
  default:
    return 8;
  }
}

namespace {
/// "!warp.NAME<EXTENTS x REST>" in parts.
struct Parts {
  std::string name, rest;
  std::vector<int64_t> extents;
};
} // namespace

static std::optional<Parts> split(const std::string &text) {
  const std::string prefix = "!warp.";
  size_t open = text.find('<');
  if (text.rfind(prefix, 0) != 0 || open == std::string::npos ||
      text.back() != '>')
    return std::nullopt;
  Parts parts;
  parts.name = text.substr(prefix.size(), open - prefix.size());
  parts.rest = text.substr(open + 1, text.size() - open - 2);
  size_t cross = parts.rest.find(" x ");
  if (!std::isdigit(static_cast<unsigned char>(parts.rest[0])) ||
      cross == std::string::npos)
    return parts;
  const char *cursor = parts.rest.c_str();
  while (std::isdigit(static_cast<unsigned char>(*cursor))) {
    char *end;
    parts.extents.push_back(std::strtoll(cursor, &end, 10));
    cursor = *end == 'x' ? end + 1 : end;
  }
  parts.rest = parts.rest.substr(cross + 3);
  return parts;
}

TypeShape python::shapeOfType(const std::string &text) {
  TypeShape shape;
  if (const ScalarName *scalar = findScalar(text)) {
    shape.kind = TypeShape::Kind::Scalar;
    shape.scalar = scalar->scalar;
    return shape;
  }
  std::optional<Parts> parts = split(text);
  if (!parts)
    return shape;
  if (parts->name == "struct") {
    shape.kind = TypeShape::Kind::Struct;
    return shape;
  }
  const ScalarName *scalar = findScalar(parts->rest);
  if (!scalar || parts->name == "array")
    return shape;
  shape.kind = TypeShape::Kind::Composite;
  shape.scalar = scalar->scalar;
  shape.extents = parts->extents;
  if (parts->name == "quat")
    shape.extents = {4};
  else if (parts->name == "transform")
    shape.extents = {7};
  for (int64_t extent : shape.extents)
    shape.count *= extent;
  return shape;
}

/// A name without the escapes by which types write bytes that are not ASCII.
static std::string unescaped(const std::string &name) {
  std::string text;
  for (size_t i = 0; i < name.size(); ++i) {
    if (name[i] == '\\' && i + 2 < name.size()) {
      text += static_cast<char>(std::stoi(name.substr(i + 1, 2), nullptr, 16));
      i += 2;
    } else {
      text += name[i];
    }
  }
  return text;
}

std::string python::pythonTypeName(const std::string &text) {
  if (const ScalarName *scalar = findScalar(text))
    return scalar->python;
  std::optional<Parts> parts = split(text);
  if (!parts)
    return text;
  if (parts->name == "array")
    return "array(ndim=" +
           std::to_string(parts->extents.empty() ? 1 : parts->extents[0]) +
           ", dtype=" + pythonTypeName(parts->rest) + ")";
  if (parts->name == "struct") {
    size_t quote = parts->rest.find('"', 1);
    return unescaped(parts->rest.substr(1, quote - 1));
  }
  const ScalarName *scalar = findScalar(parts->rest);
  std::string name = parts->name;
  bool small = true;
  for (int64_t extent : parts->extents) {
    name += std::to_string(extent);
    small &= extent < 10;
  }
  if (scalar && scalar->suffix && small)
    return name + scalar->suffix;
  return text;
}
