//===- GraphDriver.cpp - Graph calls of the CUDA driver -------------------===//
//
// Part of Warp on MLIR, under the Apache License v2.0.
//
//===----------------------------------------------------------------------===//

#include "GraphDriver.h"

#include "GraphImpl.h"
#include "Support.h"

#include <dlfcn.h>

using namespace warp;

static cuda::GraphDriver findGraphSymbols() {
  cuda::GraphDriver table{};
  if (!cuda::driver())
    return table;
  std::string library = environment("WARP_CUDA_DRIVER");
  void *handle = dlopen(library.empty() ? "libcuda.so.1" : library.c_str(),
                        RTLD_NOW | RTLD_LOCAL);
  if (!handle)
    return table;
#define WARP_FIND(member, symbol, parameters)                                  \
  table.member =                                                               \
      reinterpret_cast<cuda::Result(*) parameters>(dlsym(handle, #symbol));
  using namespace cuda;
  WARP_CUDA_GRAPH_SYMBOLS(WARP_FIND)
#undef WARP_FIND
  table.supportsGraphs = table.beginCapture && table.endCapture &&
                         table.exchangeMode && table.instantiate &&
                         table.launch && table.destroyExec && table.destroy &&
                         table.getNodes;
  table.supportsConditions = table.supportsGraphs &&
                             driver()->version >= 12040 && table.captureInfo &&
                             table.updateDependencies && table.beginCaptureTo &&
                             table.createCondition && table.addNode;
  return table;
}

const cuda::GraphDriver &cuda::graphDriver() {
  static const GraphDriver table = findGraphSymbols();
  return table;
}

const char *cuda::graphSymbol(const std::string &member) {
#define WARP_NAME(name, symbol, parameters)                                    \
  if (member == #name)                                                         \
    return #symbol;
  WARP_CUDA_GRAPH_SYMBOLS(WARP_NAME)
#undef WARP_NAME
  return "the driver";
}

cuda::RelaxedCaptures::RelaxedCaptures() {
  if (capturesInProgress.load(std::memory_order_relaxed) == 0 ||
      !graphDriver().exchangeMode)
    return;
  changed = graphDriver().exchangeMode(&mode) == success;
}

cuda::RelaxedCaptures::~RelaxedCaptures() {
  if (changed)
    graphDriver().exchangeMode(&mode);
}

bool warp::supportsConditionalGraphs() {
  return cuda::graphDriver().supportsConditions;
}
