//===- Kernel.cpp - CUDA kernels: load, occupancy, launch -----------------===//
//
// Part of Warp on MLIR, under the Apache License v2.0.
//
// Loads the code of a variant and queues its launches, each by the grid that
// its schedule asks for (Grid.cpp).
//
//===----------------------------------------------------------------------===//

#include "Kernel.h"

#include "Assembler.h"
#include "GraphDriver.h"
#include "GraphImpl.h"
#include "Grid.h"
#include "KernelClaim.h"
#include "MachineCode.h"
#include "Support.h"
#include "TensorMaps.h"

#include <algorithm>

using namespace warp;

int warp::chooseBlock(const CudaEntry &entry, int blockDim, int64_t threads,
                      int smCount) {
  int whole = blockDim, half = whole / 2;
  if (entry.residentHalves == 0)
    return whole;
  int64_t blocks = ceilDivide(threads, whole);
  if (blocks > int64_t(entry.residentBlocks) * smCount) {
    int spared = entry.residentHalves - 2 * entry.residentBlocks;
    return spared > 0 || (spared == 0 && entry.keepsStack) ? half : whole;
  }
  // All blocks run at a time. The share of the busiest multiprocessor decides.
  int64_t busiest = ceilDivide(blocks, smCount) * whole;
  int64_t halves = ceilDivide(ceilDivide(threads, half), smCount) * half;
  return halves < busiest ? half : whole;
}

/// Bytes of stack of a thread that searches a hierarchy; others spill less.
static constexpr int stackBytes = 512;

/// Blocks of a variant's size that a multiprocessor runs at a time.
static int residentBlocks(const Kernel::Variant &variant,
                          cuda::Function function) {
  int blocks = 0;
  WARP_CUDA(occupancyMaxActiveBlocks, &blocks, function, variant.key.blockDim,
            variant.code.schedule.dynamicBytes);
  return blocks;
}

static void setDynamicBytes(const Kernel::Variant &variant,
                            cuda::Function function) {
  if (variant.code.schedule.dynamicBytes)
    WARP_CUDA(funcSetAttribute, function, cuda::functionMostDynamicShared,
              variant.code.schedule.dynamicBytes);
}

/// Loads code, and finds what launches need to know of it.
static void finish(CudaEntry &entry, const Kernel::Variant &variant, Code &code,
                   bool programmatic) {
  entry.programmatic = programmatic;
  entry.loaded.load(code);
  entry.function = entry.loaded.function(code.entry);
  if (!variant.code.sites.empty())
    entry.record = std::make_unique<DeviceErrorRecord>(entry.owner.index,
                                                       variant.code.sites);
  setDynamicBytes(variant, entry.function);
  int threads = variant.key.blockDim;
  if (variant.code.schedule.fixedBlock || threads % 64 != 0)
    return;
  WARP_CUDA(occupancyMaxActiveBlocks, &entry.residentBlocks, entry.function,
            threads, 0);
  WARP_CUDA(occupancyMaxActiveBlocks, &entry.residentHalves, entry.function,
            threads / 2, 0);
  entry.keepsStack =
      attributeOf(entry.function, cuda::functionLocalSize) >= stackBytes;
}

static bool mayWaitForPredecessor(const Code &code) {
  return cuda::driver()->hasProgrammaticLaunches && waitsForPredecessor(code);
}

bool warp::waitsFirst(const Kernel::Plan &plan) {
  auto waits = [](const Kernel::Variant *variant) {
    auto *code = static_cast<const CudaEntry *>(variant->current.load());
    return code && code->programmatic;
  };
  const Kernel::Variant *plain =
      plan.variant ? plan.variant->replacement.load() : nullptr;
  return plan.variant && waits(plan.variant) && (!plain || waits(plain));
}

std::unique_ptr<DeviceCode> CudaDevice::load(const Kernel::Variant &variant,
                                             Code &code) {
  BehindNothing exempt;
  cuda::ContextScope scope(index);
  cuda::RelaxedCaptures relaxed;
  auto entry = std::make_unique<CudaEntry>(*this);
  bool programmatic = mayWaitForPredecessor(code);
  if (callsLibrary(code)) {
    std::string key = machineCodeKey(code, info.arch);
    assemble(code);
    if (isElf(code.binary))
      storeMachineCode(key, {code.entry, code.binary, /*isBest=*/true});
  }
  finish(*entry, variant, code, programmatic);
  return entry;
}

//===----------------------------------------------------------------------===//
// Machine code on disk
//===----------------------------------------------------------------------===//

/// Loads machine code of a program. If the driver does not take it, it goes
/// from the cache, and the result is null.
static std::unique_ptr<CudaEntry> loadMachine(CudaDevice &device,
                                              const Kernel::Variant &variant,
                                              const Code &ptx,
                                              MachineCode machine) {
  BehindNothing exempt;
  cuda::ContextScope scope(device.index);
  cuda::RelaxedCaptures relaxed;
  auto entry = std::make_unique<CudaEntry>(device);
  entry->provisional = !machine.isBest;
  Code code;
  code.entry = std::move(machine.entry);
  code.binary = std::move(machine.binary);
  try {
    finish(*entry, variant, code, mayWaitForPredecessor(ptx));
    return entry;
  } catch (const Error &) {
    // For another card than its name says, say.
    removeMachineCode(machineCodeKey(ptx, device.info.arch));
    return nullptr;
  }
}

std::unique_ptr<DeviceCode> CudaDevice::loadKept(const Kernel::Variant &variant,
                                                 const Code &code) {
  if (isElf(code.binary))
    return nullptr;
  std::string key = machineCodeKey(code, info.arch);
  std::optional<MachineCode> found = findMachineCode(key);
  if (!found || found->entry != code.entry)
    return nullptr;
  return loadMachine(*this, variant, code, std::move(*found));
}

std::unique_ptr<DeviceCode>
CudaDevice::loadAssembled(const Kernel::Variant &variant, const Code &code,
                          bool mayBeWorse) {
  if (isElf(code.binary) || callsLibrary(code) || !hasAssembler(mayBeWorse))
    return nullptr;
  std::string target = targetOf(code);
  if (target.find(std::to_string(info.arch)) == target.npos)
    return nullptr;
  std::string key = machineCodeKey(code, info.arch);
  // Ranks that start together need the same.
  KernelClaim claim(key);
  std::optional<MachineCode> machine;
  if (claim.hasWaited())
    machine = findMachineCode(key);
  if (!machine || machine->entry != code.entry ||
      !(machine->isBest || mayBeWorse)) {
    std::optional<AssembledProgram> made = assembleApart(
        {code.binary.data(), code.binary.size()}, target, mayBeWorse);
    if (!made)
      return nullptr;
    machine = {code.entry, std::move(made->binary), made->isBest};
    storeMachineCode(key, *machine);
  }
  return loadMachine(*this, variant, code, std::move(*machine));
}

std::unique_ptr<DeviceCode>
CudaDevice::loadLinked(const Kernel::Variant &variant, const Code &code) {
  if (code.binary.size() < longProgram || isElf(code.binary) ||
      callsLibrary(code))
    return nullptr;
  std::string key = machineCodeKey(code, info.arch);
  try {
    Code machine = code;
    assemble(machine);
    if (!isElf(machine.binary))
      return nullptr;
    MachineCode linked{code.entry, std::move(machine.binary), false};
    storeMachineCode(key, linked);
    // Parts of programs may take more registers than such blocks have.
    auto entry = loadMachine(*this, variant, code, std::move(linked));
    if (entry && entry->maxThreads() >= variant.key.blockDim)
      return entry;
  } catch (const Error &) {
    // The whole program says what is wrong, or is right.
  }
  removeMachineCode(key);
  return nullptr;
}

void CudaDevice::keep(const Kernel::Variant &variant, Code code,
                      const DeviceCode &loaded) {
  if (callsLibrary(code))
    return;
  BehindNothing exempt;
  cuda::ContextScope scope(index);
  cuda::RelaxedCaptures relaxed;
  std::string key = machineCodeKey(code, info.arch);
  std::optional<MachineCode> known = findMachineCode(key);
  if (known && known->entry != code.entry)
    known.reset();
  std::optional<AssembledProgram> apart;
  if (known)
    code.binary = known->binary;
  else if ((apart = assembleApart({code.binary.data(), code.binary.size()},
                                  targetOf(code), /*mayBeWorse=*/false)))
    code.binary = std::move(apart->binary);
  else
    assemble(code);
  if (!isElf(code.binary))
    return;
  cuda::Function whole = functionOf(loaded);
  struct Trial : CudaCode {
    ~Trial() { unload(); }
  } trial;
  MachineCode machine{code.entry, code.binary, false};
  trial.load(code);
  cuda::Function linked = trial.function(code.entry);
  setDynamicBytes(variant, linked);
  // Only stacks and registers can differ.
  machine.isBest =
      residentBlocks(variant, linked) >= residentBlocks(variant, whole) &&
      attributeOf(linked, cuda::functionLocalSize) <=
          attributeOf(whole, cuda::functionLocalSize);
  if (!known || known->isBest != machine.isBest)
    storeMachineCode(key, machine);
}

/// Unloads code; while a graph is recorded that may use it, later.
static void unload(int device, CudaCode loaded) {
  if (keepForCapture(device, [=] { unload(device, loaded); }))
    return;
  try {
    // Launches that wait keep their kernel.
    BehindNothing exempt;
    cuda::ContextScope scope(device);
    // The code must not go while it runs.
    cuda::driver()->ctxSynchronize();
    loaded.unload();
  } catch (const Error &) {
  }
}

CudaEntry::~CudaEntry() {
  if (loaded)
    unload(owner.index, loaded);
}

int CudaEntry::maxThreads() const {
  BehindNothing exempt;
  cuda::ContextScope scope(owner.index);
  return attributeOf(function, cuda::functionMaxThreads);
}

std::pair<int, int> CudaEntry::threadResources() const {
  BehindNothing exempt;
  cuda::ContextScope scope(owner.index);
  return {attributeOf(function, cuda::functionRegisters),
          attributeOf(function, cuda::functionLocalSize)};
}

/// Threads that work together on tiles are whole rows of the launch.
static void checkRows(const int32_t *dim, const VariantKey &key,
                      const char *name) {
  int last = dim[key.rank - 1];
  if (key.rank == 1 ? last % key.blockDim == 0 : last == key.blockDim)
    return;
  throw Error(Error::Kind::LaunchValue,
              std::string("launch('") + name +
                  "'): tiles belong to blocks of " +
                  std::to_string(key.blockDim) +
                  " threads, but the last extent of the launch is " +
                  std::to_string(last));
}

static cuda::Result queue(const Kernel::Variant &variant,
                          const CudaEntry &entry, const Grid &grid,
                          cuda::StreamHandle stream, void *params) {
  void *arguments[] = {params};
  const Extent &blocks = grid.blocks, &block = grid.block;
  cuda::LaunchConfig config{
      {unsigned(blocks.x), unsigned(blocks.y), unsigned(blocks.z)},
      {unsigned(block.x), unsigned(block.y), unsigned(block.z)},
      unsigned(variant.code.schedule.dynamicBytes),
      stream};
  return queueKernel(entry.function, config, arguments, entry.programmatic);
}

/// True for every other launch whose arrays do not fit into the cache: it finds
/// there what the launch before touched last.
static bool isReversed(CudaDevice &device, int64_t bytes) {
  if (bytes <= device.info.cacheBytes)
    return false;
  std::atomic<bool> &last = device.isReversed;
  bool now = !last.load(std::memory_order_relaxed);
  last.store(now, std::memory_order_relaxed);
  return now;
}

void CudaEntry::queueLaunch(const Kernel::Plan &plan, void *params,
                            const Stream *stream) const {
  const Kernel::Variant &variant = *plan.variant;
  const VariantKey &key = variant.key;
  const Schedule &schedule = variant.code.schedule;
  auto &header = *static_cast<LaunchHeader *>(params);
  if (schedule.cooperative && !schedule.ragged)
    checkRows(header.dim, key, variant.label);
  LaunchDim dim;
  dim.rank = key.rank;
  std::copy(header.dim, header.dim + key.rank, dim.extent);
  int blockDim = key.blockDim;
  if (plan.openBlock)
    blockDim = chooseBlock(*this, blockDim, coarsenedThreads(schedule, dim),
                           owner.info.smCount);
  Grid grid = gridFor(schedule, dim, blockDim, variant.flat);
  if (!grid.fits({}))
    grid = gridFor(schedule, dim, key.blockDim, variant.flat);
  if (!grid.fits({}))
    throw Error(Error::Kind::LaunchValue,
                std::string("launch('") + variant.label +
                    "'): expects at most 2^31 - 1 blocks of " +
                    std::to_string(key.blockDim) + " threads, but got " +
                    std::to_string(grid.blocks.x));
  // Code of merged blocks knows no others.
  if (schedule.blockCoarsening > 1)
    header.dim[key.rank - 2] /= schedule.blockCoarsening;
  QueuedWork work(owner.index, stream);
  if (schedule.reverseOrder)
    header.reversed = isReversed(owner, plan.bytes);
  cuda::Result result = queue(variant, *this, grid, work.stream(), params);
  if (result == cuda::success) {
    if (variant.isQuick.load(std::memory_order_relaxed)) {
      noteProvisional(owner.index, {&variant, this});
      variant.quick->spendLaunch(grid.threads() * schedule.blockCoarsening,
                                 warp::isCapturing(owner.index));
    }
    owner.lastKernel.store(variant.label, std::memory_order_relaxed);
    return;
  }
  try {
    cuda::raise(result, "launchKernel");
  } catch (const Error &error) {
    throw Error(error.kind, std::string("launch('") + variant.label +
                                "', device='" + owner.info.alias +
                                "'): " + error.message);
  }
}

void CudaEntry::launchOnce(const Kernel::Plan &plan, void *params,
                           size_t paramSize, const Stream *stream) const {
  const Schedule &schedule = plan.variant->code.schedule;
  if (record)
    setErrorRecord(params, record->address());
  // Maps, and other extents, are for this launch alone.
  if (schedule.tensorMaps.empty() && schedule.blockCoarsening == 1)
    return queueLaunch(plan, params, stream);
  MappedParameters mapped(schedule.tensorMaps, params, paramSize);
  queueLaunch(plan, mapped.get(), stream);
}

/// Launches code with the plain mapping in place of a variant's.
static void launchPlain(const Kernel::Variant &plain, Kernel::Plan plan,
                        void *params, size_t paramSize, const Stream *stream) {
  plan.variant = const_cast<Kernel::Variant *>(&plain);
  plain.current.load(std::memory_order_acquire)
      ->launch(plan, params, paramSize, stream);
}

void CudaEntry::launch(const Kernel::Plan &plan, void *params, size_t paramSize,
                       const Stream *stream) const {
  const Kernel::Variant &variant = *plan.variant;
  if (const auto *plain = variant.replacement.load(std::memory_order_acquire))
    return launchPlain(*plain, plan, params, paramSize, stream);
  LaunchTrial *trial = variant.launchTrial.get();
  if (!trial || !trial->isOpen() || capturesInProgress != 0 ||
      variant.isQuick.load(std::memory_order_relaxed))
    return launchOnce(plan, params, paramSize, stream);
  const int32_t *dim = static_cast<LaunchHeader *>(params)->dim;
  bool isMade = trial->measure(
      {dim[0], dim[1], dim[2], dim[3]}, stream, [&](bool byPlain) {
        if (byPlain)
          launchPlain(*variant.plain, plan, params, paramSize, stream);
        else
          launchOnce(plan, params, paramSize, stream);
      });
  if (!isMade)
    launchOnce(plan, params, paramSize, stream);
}

//===----------------------------------------------------------------------===//
// Resources
//===----------------------------------------------------------------------===//

void CudaEntry::describe(const VariantKey &key,
                         std::vector<Choice> &choices) const {
  cuda::ContextScope scope(owner.index);
  int registers = attributeOf(function, cuda::functionRegisters);
  int local = attributeOf(function, cuda::functionLocalSize);
  choices.push_back({"registers", std::to_string(registers),
                     std::to_string(local) + " bytes of local memory"});
  int whole = key.blockDim;
  std::string block = std::to_string(whole);
  if (residentHalves == 0) {
    choices.push_back({"block", block, "its threads wait for each other"});
    return;
  }
  choices.push_back(
      {"block", block + " or " + std::to_string(whole / 2),
       "what keeps more of the card at work; a multiprocessor holds " +
           std::to_string(residentBlocks) + " or " +
           std::to_string(residentHalves)});
}

CudaProperties Kernel::cudaProperties(int device, int blockDim) {
  CudaDevice &owner = cudaDevice(device);
  const Variant &variant = impl->loaded(device, blockDim);
  cuda::ContextScope scope(device);
  CudaProperties result;
  cuda::Function function = functionOf(*variant.current.load());
  result.registers = attributeOf(function, cuda::functionRegisters);
  result.localMemory = attributeOf(function, cuda::functionLocalSize);
  result.sharedMemory = attributeOf(function, cuda::functionSharedSize) +
                        variant.code.schedule.dynamicBytes;
  result.constantMemory = attributeOf(function, cuda::functionConstantSize);
  result.maxThreads = attributeOf(function, cuda::functionMaxThreads);
  result.binaryVersion = attributeOf(function, cuda::functionBinaryVersion);
  result.blockDim = variant.key.blockDim;
  WARP_CUDA(occupancyMaxActiveBlocks, &result.blocksPerMultiprocessor, function,
            result.blockDim, variant.code.schedule.dynamicBytes);
  int threads = 0;
  WARP_CUDA(deviceGetAttribute, &threads, cuda::maxThreadsPerMultiprocessor,
            owner.ordinal);
  if (threads > 0)
    result.occupancy =
        double(result.blocksPerMultiprocessor) * result.blockDim / threads;
  return result;
}

/// Registers of a thread that a kernel is taken for that has no code yet.
static constexpr int likelyRegisters = 64;

/// Blocks that a kernel's bounds promise, or that are likely without any. All
/// kernels can have blocks of the usual size.
static std::pair<int, int> likelyBlocks(CudaDevice &device,
                                        const KernelOptions &options) {
  // A question about the device, which comes behind no launch.
  BehindNothing exempt;
  cuda::ContextScope scope(device.index);
  int threads = options.maxThreads > 0
                    ? std::min(options.blockDim, options.maxThreads)
                    : options.blockDim;
  int most = 0, registers = 0;
  WARP_CUDA(deviceGetAttribute, &most, cuda::maxThreadsPerMultiprocessor,
            device.ordinal);
  WARP_CUDA(deviceGetAttribute, &registers, cuda::maxRegistersPerMultiprocessor,
            device.ordinal);
  int blocks = options.minBlocks > 0 && options.maxThreads > 0
                   ? options.minBlocks
                   : registers / (likelyRegisters * threads);
  blocks = std::max(1, std::min(blocks, most / threads));
  return {threads, blocks * device.info.smCount};
}

std::pair<int, int> Kernel::suggestedBlock(int device) {
  CudaDevice &owner = cudaDevice(device);
  // The launch that follows asks for its code: other code than that of its
  // arguments would only delay it, and all launches behind it. Bounds answer at
  // once, and while launches wait for their code, the program's next ones would
  // come late.
  const KernelOptions &options = impl->options;
  bool isBound = options.minBlocks > 0 && options.maxThreads > 0;
  if (isLazyCompile() && !options.debug && (isBound || warp::mustQueue()) &&
      !impl->findOn(device))
    return likelyBlocks(owner, options);
  const Variant &variant = impl->launched(device);
  BehindNothing exempt;
  cuda::ContextScope scope(device);
  int blocks = 0, threads = 0;
  WARP_CUDA(occupancyMaxPotentialBlockSize, &blocks, &threads,
            functionOf(*variant.current.load()), nullptr,
            variant.code.schedule.dynamicBytes, variant.key.blockDim);
  return {threads, blocks};
}
