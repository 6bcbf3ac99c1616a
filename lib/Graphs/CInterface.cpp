//===- CInterface.cpp - Saved kernels and graphs from C -------------------===//
//
// Part of Warp on MLIR, under the Apache License v2.0.
//
// The functions of warp/warp.h over the C++ classes. Each catches what those
// throw and keeps the message for its thread.
//
//===----------------------------------------------------------------------===//

#include "warp/Device.h"
#include "warp/Error.h"
#include "warp/Kernel.h"
#include "warp/Memory.h"
#include "warp/SavedGraph.h"
#include "warp/SavedModule.h"
#include "warp/Version.h"
#include "warp/warp.h"

#include <cstring>
#include <exception>
#include <memory>
#include <string>
#include <vector>

struct warp_module {
  warp::SavedModule module;
};
struct warp_kernel {
  std::shared_ptr<warp::Kernel> kernel;
};
struct warp_graph {
  std::shared_ptr<warp::LoadedGraph> graph;
};
struct warp_memory {
  warp::Buffer buffer;
};

static_assert(WARP_MAX_RANK == warp::maxRank && warp::isHost(WARP_CPU));

static thread_local std::string lastError;

template <typename Function> static int guarded(Function function) {
  try {
    function();
    return 0;
  } catch (const std::exception &error) {
    lastError = error.what();
  } catch (...) {
    lastError = "unknown error";
  }
  return 1;
}

[[noreturn]] static void reject(const warp::Kernel &kernel,
                                const warp::Param &param,
                                const std::string &got) {
  throw warp::Error(warp::Error::Kind::LaunchType,
                    "launch('" + kernel.name() + "'): argument '" + param.name +
                        "' expects " + param.type + ", but got " + got);
}

/// The descriptor of an array argument.
static warp::ArrayDescriptor describe(const warp_argument &argument) {
  warp::ArrayDescriptor array;
  array.data = const_cast<void *>(argument.data);
  array.ndim = argument.rank;
  bool packed = true;
  for (int i = 0; i < argument.rank; ++i)
    packed &= argument.strides[i] == 0;
  int64_t stride = int64_t(argument.bytes);
  for (int i = argument.rank - 1; i >= 0; --i) {
    int64_t extent = argument.shape[i];
    int64_t own = packed ? stride : argument.strides[i];
    if (extent < 0 || extent > INT32_MAX || own != int32_t(own))
      throw warp::Error(warp::Error::Kind::Value,
                        "extents and strides of an array are below 2^31");
    array.shape[i] = int32_t(extent);
    array.strides[i] = int32_t(own);
    stride *= extent;
  }
  return array;
}

/// Writes an argument to its place in the block.
static void pack(const warp::Kernel &kernel, const warp::Param &param,
                 const warp_argument &argument, char *block) {
  bool isArray = param.kind == warp::Param::Kind::Array;
  if (isArray != (argument.rank != 0))
    reject(kernel, param, isArray ? "a value" : "an array");
  const std::string &type = isArray ? param.element : param.type;
  int64_t size = isArray ? param.elementSize : param.size;
  std::string of = isArray ? "an array with elements of " : "";
  if (argument.type && type != argument.type)
    reject(kernel, param, of + argument.type);
  if (int64_t(argument.bytes) != size)
    reject(kernel, param,
           of + std::to_string(argument.bytes) + " bytes instead of " +
               std::to_string(size));
  if (!isArray) {
    std::memcpy(block + param.offset, argument.data, argument.bytes);
    return;
  }
  if (argument.rank != param.rank)
    reject(kernel, param,
           "an array of " + std::to_string(argument.rank) + " dimensions");
  warp::ArrayDescriptor array = describe(argument);
  std::memcpy(block + param.offset, &array, sizeof array);
}

extern "C" {

const char *warp_last_error(void) { return lastError.c_str(); }

const char *warp_version(void) { return warp::version(); }

int warp_memory_allocate(int device, size_t bytes, warp_memory **memory) {
  return guarded(
      [&] { *memory = new warp_memory{warp::Buffer(device, bytes)}; });
}

void *warp_memory_data(const warp_memory *memory) {
  return memory->buffer.data();
}

void warp_memory_free(warp_memory *memory) { delete memory; }

int warp_copy(void *target, int to, const void *source, int from,
              size_t bytes) {
  return guarded([&] {
    warp::copyMemory(target, to, source, from, bytes);
    for (int device : {to, from})
      if (!warp::isHost(device))
        warp::synchronizeDevice(device);
  });
}

int warp_synchronize(int device) {
  return guarded([&] { warp::synchronizeDevice(device); });
}

int warp_module_load(const char *path, warp_module **module) {
  return guarded(
      [&] { *module = new warp_module{warp::SavedModule::load(path)}; });
}

void warp_module_free(warp_module *module) { delete module; }

int warp_module_kernel(warp_module *module, const char *name,
                       warp_kernel **kernel) {
  return guarded(
      [&] { *kernel = new warp_kernel{module->module.kernel(name)}; });
}

void warp_kernel_free(warp_kernel *kernel) { delete kernel; }

int warp_kernel_launch(warp_kernel *handle, int device, int rank,
                       const int64_t *extents, int count,
                       const warp_argument *arguments) {
  return guarded([&] {
    warp::Kernel &kernel = *handle->kernel;
    const std::vector<warp::Param> &params = kernel.parameters();
    if (count < 0 || params.size() != size_t(count))
      throw warp::Error(warp::Error::Kind::LaunchType,
                        "launch('" + kernel.name() + "'): expects " +
                            std::to_string(params.size()) +
                            " arguments, but got " + std::to_string(count));
    warp::LaunchDim dim;
    dim.rank = rank;
    for (int i = 0; i < rank && i < warp::maxRank; ++i)
      dim.extent[i] = extents[i];
    std::vector<uint64_t> block(kernel.parameterSize() / 8);
    auto *bytes = reinterpret_cast<char *>(block.data());
    for (int i = 0; i < count; ++i)
      pack(kernel, params[i], arguments[i], bytes);
    kernel.launch(device, dim, bytes);
  });
}

int warp_graph_load(const char *path, int device, warp_graph **graph) {
  return guarded(
      [&] { *graph = new warp_graph{warp::LoadedGraph::load(path, device)}; });
}

int warp_graph_set(warp_graph *graph, const char *name, const void *source,
                   size_t bytes) {
  return guarded([&] { graph->graph->set(name, source, bytes); });
}

int warp_graph_get(warp_graph *graph, const char *name, void *target,
                   size_t bytes) {
  return guarded([&] { graph->graph->get(name, target, bytes); });
}

int warp_graph_launch(warp_graph *graph) {
  return guarded([&] { graph->graph->launch(); });
}

void warp_graph_free(warp_graph *graph) { delete graph; }

} // extern "C"
