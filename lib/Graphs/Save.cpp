//===- Save.cpp - From a captured graph to files --------------------------===//
//
// Part of Warp on MLIR, under the Apache License v2.0.
//
// Memory that operations reach, as far as it overlaps, becomes one block, so
// that arrays which share memory still do after loading. A block is saved with
// what is in it, unless the graph writes all of it before it looks.
//
//===----------------------------------------------------------------------===//

#include "GraphFile.h"
#include "Operations.h"

#include "Runtime/Bytes.h"
#include "Runtime/KernelImpl.h"
#include "Runtime/Support.h"
#include "warp/Handle.h"
#include "warp/SavedGraph.h"
#include "warp/SavedModule.h"

#include <algorithm>
#include <cstdio>
#include <set>

using namespace warp;
using namespace warp::graphs;
using Kind = GraphOperation::Kind;

namespace {

struct Block {
  AddressRange range;
  /// Whether the contents matter, once that is known.
  bool touched = false, needed = false;
};

class Saver {
public:
  Saver(const Graph &graph, const std::vector<NamedMemory> &names)
      : device(graph.device()), operations(graph.trace()->operations),
        names(names) {}

  GraphFiles save();

private:
  void collectKernels();
  void checkKernel(const Kernel &kernel, const SavedKernel &saved) const;
  void checkHandles(const GraphOperation &operation,
                    const SavedKernel &saved) const;
  void refuseHandle(const GraphOperation &operation, uint64_t word) const;
  void collectMemory();
  void chooseContents();
  size_t blockOf(const AddressRange &range) const;
  void readBlocks();
  FileOperation fileOperation(size_t number) const;
  void addNames();

  int device;
  const std::vector<GraphOperation> &operations;
  const std::vector<NamedMemory> &names;

  SavedModule module;
  /// Of each operation that is a launch.
  std::vector<uint32_t> kernels;
  std::vector<std::vector<Pointer>> pointers;
  std::vector<Block> blocks;
  GraphFile file;
};

} // namespace

static Error saveError(Error::Kind kind, const std::string &problem) {
  return Error(kind, "cannot save the graph: " + problem);
}

//===----------------------------------------------------------------------===//
// Kernels
//===----------------------------------------------------------------------===//

void Saver::checkKernel(const Kernel &kernel, const SavedKernel &saved) const {
  if (kernel.options().deterministic)
    throw saveError(Error::Kind::Runtime,
                    "kernel '" + kernel.name() + "' is deterministic");
  for (const Param &param : saved.params)
    if (param.kind == Param::Kind::Array &&
        param.element.find("!warp.array<") != std::string::npos)
      throw saveError(Error::Kind::Runtime,
                      "argument '" + param.name + "' of kernel '" +
                          kernel.name() +
                          "' is an array whose elements have arrays");
}

void Saver::refuseHandle(const GraphOperation &operation, uint64_t word) const {
  if (word == 0)
    return;
  std::string what = describeHandle(word, GeometryKind::HashGrid, device);
  if (what == "a number that is none")
    return;
  what = what.empty() ? "a HashGrid" : what.substr(sizeof("that of ") - 1);
  throw saveError(Error::Kind::Runtime, "the " + describe(operation) +
                                            " has the id of " + what +
                                            ", which no file holds");
}

/// Ids among the arguments and in arrays of them.
void Saver::checkHandles(const GraphOperation &operation,
                         const SavedKernel &saved) const {
  auto wordAt = [&](size_t at) {
    uint64_t word;
    std::memcpy(&word, operation.arguments.data() + at, sizeof(word));
    return word;
  };
  std::set<size_t> inArrays;
  for (const Access &access : saved.accesses)
    for (size_t at = 0; at < sizeof(ArrayDescriptor); at += 8)
      inArrays.insert(access.offset + at);
  for (size_t at = firstArgument; at + 8 <= operation.arguments.size(); at += 8)
    if (!inArrays.count(at))
      refuseHandle(operation, wordAt(at));
  for (const Param &param : saved.params) {
    if (param.kind != Param::Kind::Array || param.element != "ui64")
      continue;
    ArrayDescriptor array;
    std::memcpy(&array, operation.arguments.data() + param.offset,
                sizeof(array));
    AddressRange range = rangeOf(array.data, array, 8, 1);
    std::vector<uint64_t> ids((range.end - range.begin) / 8);
    copyMemory(ids.data(), cpuDevice,
               reinterpret_cast<const void *>(range.begin), device,
               ids.size() * 8);
    for (uint64_t id : ids)
      refuseHandle(operation, id);
  }
}

void Saver::collectKernels() {
  std::map<std::pair<Kernel *, Kernel::Variant *>, uint32_t> numbers;
  kernels.resize(operations.size());
  for (size_t i = 0; i < operations.size(); ++i) {
    const GraphOperation &operation = operations[i];
    if (operation.kind == Kind::Other)
      throw saveError(Error::Kind::Runtime,
                      "it has " + operation.constant + ", which no file holds");
    if (operation.kind != Kind::Launch)
      continue;
    auto [entry, isNew] = numbers.try_emplace(
        {operation.kernel, operation.plan.variant}, module.kernels.size());
    if (isNew) {
      module.kernels.push_back(operation.kernel->save(operation.plan));
      checkKernel(*operation.kernel, module.kernels.back());
    }
    kernels[i] = entry->second;
    checkHandles(operation, module.kernels[entry->second]);
  }
}

//===----------------------------------------------------------------------===//
// Memory
//===----------------------------------------------------------------------===//

void Saver::collectMemory() {
  static const std::vector<Access> none;
  std::vector<AddressRange> ranges;
  for (size_t i = 0; i < operations.size(); ++i) {
    bool isLaunch = operations[i].kind == Kind::Launch;
    pointers.push_back(pointersOf(
        operations[i], isLaunch ? module.kernels[kernels[i]].accesses : none));
    for (const Pointer &pointer : pointers.back())
      ranges.push_back(pointer.range);
  }
  for (const NamedMemory &memory : names) {
    auto start = reinterpret_cast<uint64_t>(memory.data);
    ranges.push_back({start, start + memory.bytes});
  }
  std::sort(ranges.begin(), ranges.end(),
            [](const AddressRange &a, const AddressRange &b) {
              return a.begin < b.begin;
            });
  for (const AddressRange &range : ranges) {
    if (range.begin == range.end)
      continue;
    if (!blocks.empty() && range.begin < blocks.back().range.end)
      blocks.back().range.end = std::max(blocks.back().range.end, range.end);
    else
      blocks.push_back({range});
  }
}

size_t Saver::blockOf(const AddressRange &range) const {
  auto after = std::upper_bound(blocks.begin(), blocks.end(), range.begin,
                                [](uint64_t address, const Block &block) {
                                  return address < block.range.begin;
                                });
  return after - blocks.begin() - 1;
}

/// Whether an operation writes all that its first pointer reaches, and reads
/// nothing of it.
static bool overwrites(const GraphOperation &operation) {
  return operation.kind == Kind::FillBytes || operation.kind == Kind::Upload ||
         operation.kind == Kind::CopyBytes;
}

void Saver::chooseContents() {
  auto touch = [&](const AddressRange &range, bool overwritten) {
    if (range.begin == range.end)
      return;
    Block &block = blocks[blockOf(range)];
    bool all = range.begin == block.range.begin && range.end == block.range.end;
    if (!std::exchange(block.touched, true))
      block.needed = !(overwritten && all);
  };
  for (const NamedMemory &memory : names) {
    auto start = reinterpret_cast<uint64_t>(memory.data);
    touch({start, start + memory.bytes}, false);
  }
  int depth = 0;
  for (size_t i = 0; i < operations.size(); ++i) {
    depth += operations[i].kind == Kind::BeginBody;
    depth -= operations[i].kind == Kind::EndBody;
    // What a copy reads comes before what it writes.
    for (size_t p = pointers[i].size(); p-- > 0;)
      touch(pointers[i][p].range,
            p == 0 && depth == 0 && overwrites(operations[i]));
  }
}

void Saver::readBlocks() {
  uint64_t alignment = device == cpuDevice ? 64 : 256;
  for (const Block &block : blocks) {
    FileBlock &saved = file.blocks.emplace_back();
    saved.lead = block.range.begin % alignment;
    saved.bytes = block.range.end - block.range.begin;
    if (!block.needed)
      continue;
    saved.contents.resize(saved.bytes);
    copyMemory(saved.contents.data(), cpuDevice,
               reinterpret_cast<const void *>(block.range.begin), device,
               saved.bytes);
    if (saved.contents.find_first_not_of('\0') == std::string::npos)
      saved.contents.clear();
  }
}

//===----------------------------------------------------------------------===//
// Files
//===----------------------------------------------------------------------===//

FileOperation Saver::fileOperation(size_t number) const {
  FileOperation entry;
  entry.operation = operations[number];
  std::string &arguments = entry.operation.arguments;
  if (entry.operation.kind == Kind::Launch) {
    entry.kernel = kernels[number];
    const Kernel::Plan &plan = entry.operation.plan;
    if (device != cpuDevice && !plan.openBlock)
      entry.blockDim = plan.variant->key.blockDim;
    std::memset(arguments.data() + offsetof(LaunchHeader, errorRecord), 0, 8);
  }
  for (const Pointer &pointer : pointers[number]) {
    uint64_t address;
    std::memcpy(&address, arguments.data() + pointer.slot, sizeof(address));
    uint32_t block = address ? spareBlock : nullBlock;
    if (pointer.range.begin != pointer.range.end) {
      block = blockOf(pointer.range);
      address -= blocks[block].range.begin;
    } else {
      address = 0;
    }
    std::memcpy(arguments.data() + pointer.slot, &address, sizeof(address));
    entry.blocks.push_back(block);
  }
  return entry;
}

void Saver::addNames() {
  std::set<std::string> known;
  for (const NamedMemory &memory : names) {
    if (memory.name.empty() || !known.insert(memory.name).second)
      throw saveError(Error::Kind::Value, "two arrays have the name '" +
                                              memory.name + "', or it is none");
    FileName &name = file.names.emplace_back();
    name.name = memory.name;
    name.bytes = memory.bytes;
    if (memory.bytes == 0)
      continue;
    auto start = reinterpret_cast<uint64_t>(memory.data);
    name.block = blockOf({start, start + memory.bytes});
    name.offset = start - blocks[name.block].range.begin;
  }
}

GraphFiles Saver::save() {
  int arch = device == cpuDevice ? 0 : deviceInfo(device).arch;
  file.target = arch == 0 ? "cpu" : "sm_" + std::to_string(arch);
  if (isCapturing(device))
    throw saveError(Error::Kind::Runtime, "another one is being captured");
  if (device != cpuDevice)
    synchronizeDevice(device);
  collectKernels();
  collectMemory();
  chooseContents();
  addNames();
  readBlocks();
  for (size_t i = 0; i < operations.size(); ++i)
    file.operations.push_back(fileOperation(i));
  GraphFiles files;
  if (!module.kernels.empty()) {
    module.name = "graph";
    std::string code = module.bytes();
    file.moduleHash = hashBytes(code.data(), code.size());
    char digits[17];
    std::snprintf(digits, sizeof(digits), "%016llx",
                  static_cast<unsigned long long>(file.moduleHash));
    file.module =
        std::string("kernels-") + digits + "." + file.target + ".warp";
    files.modules[file.module] = std::move(code);
  }
  files.graph = file.bytes();
  return files;
}

GraphFiles warp::graphFiles(const Graph &graph,
                            const std::vector<NamedMemory> &names) {
  if (!graph.trace())
    throw saveError(Error::Kind::Runtime, "it was not captured with apic=True");
  return Saver(graph, names).save();
}
