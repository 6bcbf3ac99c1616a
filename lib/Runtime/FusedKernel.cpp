//===- FusedKernel.cpp - One kernel for several launches ------------------===//
//
// Part of Warp on MLIR, under the Apache License v2.0.
//
// A fused kernel is made of the modules of its parts, once for each choice of
// arguments that are the same array. The process keeps it, and the cache on
// disk has its translation under a hash of those of the parts: a later process
// reads no module. Its code is compiled with the capture's end, since the graph
// keeps it. Code that is worse than that of the parts is not used: fewer lanes,
// or more registers than leave room for half of the threads.
//
//===----------------------------------------------------------------------===//

#include "FusedKernel.h"

#include "KernelImpl.h"
#include "warp/Fusion.h"
#include "warp/Translation.h"

#include <algorithm>
#include <cstring>
#include <map>

using namespace warp;

/// Bytes of arguments that every GPU takes.
static constexpr size_t mostBytes = 4096;
/// Registers of a GPU's thread with which half of the threads that a
/// multiprocessor may have fit.
static constexpr int mostRegisters = 64;
/// The same for blocks of rows, which wait for each other, and of which a
/// launch has few.
static constexpr int mostRowRegisters = 128;
/// Kernels that a process keeps.
static constexpr size_t mostKernels = 512;

/// True if updates of an array may have another plan in a fused kernel: their
/// order does not matter, or is nobody's anyway.
static bool mayMoveUpdates(const GraphOperation &launch, const Access &access) {
  if (launch.kernel->options().deterministic)
    return false;
  // Threads of a GPU come in no order, also where results are used.
  if (!isHost(launch.plan.device))
    return true;
  if (access.fetched)
    return false;
  // Small launches on CPUs add floats in one order.
  for (const Param &param : launch.kernel->parameters())
    if (param.offset == access.offset)
      return param.element.starts_with("si") || param.element.starts_with("ui");
  return false;
}

int64_t warp::rowThreads(const LaunchDim &dim) {
  int64_t count = 1;
  for (int i = 1; i < dim.rank; ++i)
    count *= dim.extent[i];
  return count;
}

bool warp::hasBlocksOfRows(const GraphOperation &launch) {
  const Kernel::Variant *variant = launch.plan.variant;
  if (!variant)
    return false;
  const Schedule &schedule = variant->code.schedule;
  const LaunchDim &dim = launch.dim;
  int64_t row = rowThreads(dim);
  bool isRow = dim.rank > 1 && row == dim.extent[dim.rank - 1];
  return schedule.cooperative && !schedule.ragged && isRow &&
         (isHost(launch.plan.device) || row == variant->key.blockDim);
}

bool warp::worksTogether(const GraphOperation &launch) {
  if (!launch.plan.variant)
    return false;
  const Schedule &schedule = launch.plan.variant->code.schedule;
  return schedule.cooperative || schedule.fixedBlock || schedule.dynamicBytes ||
         schedule.splitReduction > 1 || schedule.singleBlock ||
         !schedule.tensorMaps.empty();
}

std::string warp::whyApart(const GraphOperation &launch) {
  if (!launch.plan.variant)
    return "it has no threads";
  const Kernel &kernel = *launch.kernel;
  const Schedule &schedule = launch.plan.variant->code.schedule;
  if (Kernel::reports(launch.plan))
    return "it reports failed checks";
  // Other code is made for blocks of rows, if the kernel leaves that open.
  if (schedule.cooperative && !hasBlocksOfRows(launch))
    return "threads of its blocks work together";
  if (schedule.usesPrintf && isHost(launch.plan.device))
    return "it prints";
  if (kernel.options().fastMath)
    return "its arithmetic may be reassociated";
  if (kernel.regionFormula().isOpen)
    return "it may reach memory that no argument names";
  for (const Access &access : kernel.arrayAccesses()) {
    if (access.combined && !mayMoveUpdates(launch, access))
      return "it updates elements";
    if (access.gradientSize)
      return "it uses gradients";
  }
  return "";
}

namespace {
/// The arguments of several launches, each array once.
class Arguments {
public:
  void add(const GraphOperation &launch);

  /// By launch and argument, the number of the fused kernel's.
  std::vector<std::vector<int>> numbers;
  /// Bytes by that number.
  std::vector<std::string> values;

private:
  std::vector<std::string> types;
};
} // namespace

void Arguments::add(const GraphOperation &launch) {
  std::vector<int> &list = numbers.emplace_back();
  for (const Param &param : launch.kernel->parameters()) {
    std::string value = launch.arguments.substr(param.offset, param.size);
    size_t number = 0;
    // Numbers that happen to be equal stay apart: one kernel serves all.
    while (number < values.size() &&
           !(values[number] == value && types[number] == param.type &&
             !param.arrays.empty()))
      ++number;
    if (number == values.size()) {
      values.push_back(std::move(value));
      types.push_back(param.type);
    }
    list.push_back(int(number));
  }
}

//===----------------------------------------------------------------------===//
// Kernels
//===----------------------------------------------------------------------===//

static std::string nameOf(const std::vector<const GraphOperation *> &launches) {
  std::string name;
  for (const GraphOperation *launch : launches)
    name += (name.empty() ? "" : "__") + launch->kernel->name();
  return name.substr(0, 200);
}

/// The extents of a launch behind the first one.
static std::vector<int64_t> innerOf(const GraphOperation &launch) {
  const LaunchDim &dim = launch.dim;
  return std::vector<int64_t>(dim.extent + 1, dim.extent + dim.rank);
}

static std::shared_ptr<Kernel> makeKernel(const FusionPlan &plan,
                                          const Arguments &arguments,
                                          const std::string &key) {
  KernelOptions options = plan.launches.front()->kernel->options();
  // Registers of the whole code decide if a fused launch is worth it.
  options.quickFirst = false;
  options.linkedFirst = true;
  std::string cached = fingerprint(SourceHashes{key, key}, CompileOptions());
  std::string name = nameOf(plan.launches);
  if (std::optional<Translation> found = findTranslation(cached))
    return std::make_shared<Kernel>(std::move(*found), name, options);
  std::vector<FusionPart> parts;
  for (size_t i = 0; i < plan.launches.size(); ++i) {
    const GraphOperation &launch = *plan.launches[i];
    FusionPart &part = parts.emplace_back();
    part.module = &launch.kernel->module();
    part.arguments = arguments.numbers[i];
    if (plan.blockThreads) {
      part.inner = innerOf(launch);
      part.waits = plan.waits[i];
    }
  }
  auto kernel = std::make_shared<Kernel>(
      fuseKernels(name, parts, plan.blockThreads), name, options);
  storeTranslation(cached, kernel->translation());
  return kernel;
}

/// Names a fused kernel by those of its parts, and how they are put together.
static std::string keyOf(const FusionPlan &plan, const Arguments &arguments) {
  std::string key;
  for (size_t i = 0; i < plan.launches.size(); ++i) {
    key += plan.launches[i]->kernel->sourceHashes().located;
    for (int number : arguments.numbers[i])
      key += ',' + std::to_string(number);
    if (plan.blockThreads) {
      key += plan.waits[i] ? '|' : '&';
      for (int64_t extent : innerOf(*plan.launches[i]))
        key += std::to_string(extent) + 'x';
    }
    key += ';';
  }
  if (plan.blockThreads)
    key += " rows of " + std::to_string(plan.blockThreads);
  KernelOptions options = plan.launches.front()->kernel->options();
  for (int64_t option :
       {int64_t(options.deterministic), int64_t(options.sameOnDevices),
        options.orderedSlots, int64_t(options.lineinfo),
        int64_t(options.optLevel), int64_t(options.blockDim),
        int64_t(options.maxRegisters), int64_t(options.maxThreads),
        int64_t(options.minBlocks), int64_t(options.lanes)})
    key += ' ' + std::to_string(option);
  return key;
}

static std::shared_ptr<Kernel> kernelFor(const FusionPlan &plan,
                                         const Arguments &arguments) {
  struct Known {
    ForkMutex mutex;
    std::map<std::string, std::shared_ptr<Kernel>> kernels;
  };
  static auto *known = new Known;
  std::string key = keyOf(plan, arguments);
  std::lock_guard lock(known->mutex);
  if (auto found = known->kernels.find(key); found != known->kernels.end())
    return found->second;
  if (known->kernels.size() >= mostKernels)
    known->kernels.clear();
  return known->kernels[key] = makeKernel(plan, arguments, key);
}

//===----------------------------------------------------------------------===//
// Launches
//===----------------------------------------------------------------------===//

/// Why the code of a fused launch is worse than that of its parts.
static std::string whyWorse(const FusionPlan &plan, const FusedLaunch &fused) {
  GraphOperation one = *plan.launches.front();
  one.kernel = fused.kernel.get();
  one.plan = fused.plan;
  const Kernel::Variant &variant = *fused.plan.variant;
  // Threads of rows wait for each other.
  if (plan.blockThreads) {
    if (!isHost(fused.plan.device) &&
        (!variant.code.schedule.cooperative ||
         variant.key.blockDim != plan.blockThreads))
      return "its code is for other blocks";
  } else if (std::string why = whyApart(one); !why.empty()) {
    return why;
  } else if (worksTogether(one)) {
    return "threads of its blocks work together";
  }
  auto [registers, bytes] = variant.current.load()->threadResources();
  int most = plan.blockThreads ? mostRowRegisters : mostRegisters;
  int mostLocal = 0;
  for (const GraphOperation *launch : plan.launches) {
    const Kernel::Variant &part = *launch->plan.variant;
    if (!plan.blockThreads &&
        part.code.schedule.lanes > variant.code.schedule.lanes)
      return "its code would have fewer lanes";
    auto [own, local] = part.current.load()->threadResources();
    most = std::max(most, own);
    mostLocal = std::max(mostLocal, local);
  }
  if (registers > most || bytes > mostLocal)
    return "it would need " + std::to_string(registers) + " registers and " +
           std::to_string(bytes) + " bytes of local memory";
  return "";
}

/// The kernel and the arguments of a fused launch. Says why not if there is no
/// kernel.
static FusedLaunch assemble(const FusionPlan &plan, std::string &whyNot) {
  FusedLaunch fused;
  Arguments arguments;
  for (const GraphOperation *launch : plan.launches)
    arguments.add(*launch);
  fused.kernel = kernelFor(plan, arguments);
  size_t size = fused.kernel->parameterSize();
  if (size > mostBytes) {
    whyNot = "it would have too many arguments";
    return {};
  }
  fused.params.resize(size / 8);
  auto *bytes = reinterpret_cast<char *>(fused.params.data());
  const std::vector<Param> &params = fused.kernel->parameters();
  for (size_t i = 0; i < params.size(); ++i)
    std::memcpy(bytes + params[i].offset, arguments.values[i].data(),
                arguments.values[i].size());
  return fused;
}

/// Threads of a block that the launches asked for, 0 if they left it open.
static int blockDimOf(const FusionPlan &plan) {
  const Kernel::Plan &first = plan.launches.front()->plan;
  if (plan.blockThreads)
    return plan.blockThreads;
  return first.openBlock ? 0 : first.variant->key.blockDim;
}

static LaunchDim dimOf(const FusionPlan &plan) {
  LaunchDim dim = plan.launches.front()->dim;
  if (plan.blockThreads) {
    dim.rank = 2;
    dim.extent[1] = plan.blockThreads;
  }
  return dim;
}

void warp::prepareCode(const std::vector<FusionPlan> &plans) {
  std::vector<FusedLaunch> missing;
  std::vector<Kernel::CodeRequest> requests;
  for (const FusionPlan &plan : plans) {
    int device = plan.launches.front()->plan.device;
    std::string whyNot;
    try {
      FusedLaunch fused = assemble(plan, whyNot);
      if (!fused.kernel ||
          fused.kernel
              ->tryPrepare(device, dimOf(plan), fused.params.data(),
                           blockDimOf(plan))
              .variant)
        continue;
      missing.push_back(std::move(fused));
      FusedLaunch &made = missing.back();
      requests.push_back({made.kernel.get(), device, dimOf(plan),
                          made.params.data(), blockDimOf(plan)});
    } catch (const Error &) {
      // `fuse` has it again.
    }
  }
  if (requests.size() < 2)
    return;
  try {
    Kernel::makeCode(requests);
  } catch (const Error &) {
  }
}

FusedLaunch warp::fuse(const FusionPlan &plan, std::string &whyNot) {
  try {
    FusedLaunch fused = assemble(plan, whyNot);
    if (!fused.kernel)
      return {};
    fused.plan =
        fused.kernel->prepare(plan.launches.front()->plan.device, dimOf(plan),
                              fused.params.data(), blockDimOf(plan));
    // The graph runs later.
    bool isForNow =
        fused.plan.readsMemory && fused.plan.variant->key.zeros != 0;
    whyNot =
        isForNow ? "memory decides what it leaves out" : whyWorse(plan, fused);
    if (whyNot.empty())
      return fused;
  } catch (const Error &error) {
    whyNot = error.message;
  }
  return {};
}
