//===- Parameters.cpp - Layout of a kernel's parameter block --------------===//
//
// Part of Warp on MLIR, under the Apache License v2.0.
//
//===----------------------------------------------------------------------===//

#include "Context.h"

#include "warp/Compile.h"

#include "WarpDialect/ParameterLayout.h"
#include "WarpDialect/Passes.h"
#include "WarpDialect/WarpDialect.h"
#include "WarpDialect/WarpOps.h"
#include "WarpDialect/WarpTypes.h"

#include "mlir/Dialect/Func/IR/FuncOps.h"

#include "llvm/Support/raw_ostream.h"

using namespace mlir;

static std::string textOf(mlir::Type type) {
  std::string text;
  llvm::raw_string_ostream(text) << type;
  return text;
}

static warp::Param describe(StringRef name, mlir::Type type, int64_t offset) {
  warp::Param param;
  param.name = name.str();
  param.type = textOf(type);
  param.offset = offset;
  param.size = warp::getByteSize(type);
  SmallVector<warp::Leaf> leaves;
  warp::collectLeaves(type, 0, leaves);
  for (warp::Leaf leaf : leaves)
    if (isa<warp::ArrayType>(leaf.type))
      param.arrays.push_back(leaf.offset);
  if (auto array = dyn_cast<warp::ArrayType>(type)) {
    param.kind = warp::Param::Kind::Array;
    param.rank = array.getRank();
    param.element = textOf(array.getElementType());
    param.elementSize = warp::getByteSize(array.getElementType());
  } else if (isa<warp::StructType>(type)) {
    param.kind = warp::Param::Kind::Struct;
  } else if (warp::isComposite(type)) {
    param.kind = warp::Param::Kind::Composite;
  }
  return param;
}

int warp::threadRank(const Module &module) {
  ContextLock lock;
  unsigned rank = 1;
  module.getImpl()->op->walk(
      [&](TidOp op) { rank = std::max(rank, op->getNumResults()); });
  return static_cast<int>(rank);
}

std::vector<warp::Param> warp::parameters(const Module &module) {
  ContextLock lock;
  func::FuncOp kernel = kernelOf(*module.getImpl()->op);
  auto names = kernel->getAttrOfType<ArrayAttr>(attr::argNames);
  ParameterLayout layout = layOutParameters(kernel.getArgumentTypes());
  std::vector<Param> params;
  for (auto [i, type] : llvm::enumerate(kernel.getArgumentTypes())) {
    if (!isValue(type))
      throw Error(Error::Kind::Compile, "'" + textOf(type) +
                                            "' cannot be the type of a "
                                            "kernel's argument");
    StringAttr name;
    if (names && i < names.size())
      name = dyn_cast<StringAttr>(names[i]);
    params.push_back(describe(name ? name.getValue().str()
                                   : "argument " + std::to_string(i),
                              type, layout.offsets[i]));
  }
  return params;
}
