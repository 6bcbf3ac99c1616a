//===- Save.cpp - Serialisation of captured graphs ------------------------===//
//
// Part of Warp on MLIR, under the Apache License v2.0.
//
// Kernels are found first, then ids of geometry among what launches reach
// (SaveIds.cpp), then memory (SaveMemory.cpp), then all is put into files.
//
//===----------------------------------------------------------------------===//

#include "Saver.h"

#include "Runtime/Bytes.h"
#include "Runtime/KernelImpl.h"
#include "Runtime/Support.h"

#include <algorithm>
#include <cstdio>
#include <set>

using namespace warp;
using namespace warp::graphs;
using Kind = GraphOperation::Kind;

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

/// The id of geometry that an operation updates.
void Saver::findUpdated(size_t number) {
  const GraphOperation &operation = operations[number];
  std::string where = describe(operation);
  std::optional<uint32_t> handle =
      handles.find(operation.read<UpdateGeometry>().handle, where);
  if (!handle)
    throw saveError(Error::Kind::Runtime,
                    "the " + where + " is of one that is gone");
  handleWords[number].push_back({0, *handle});
}

void Saver::collectKernels() {
  std::map<Kernel::Variant *, uint32_t> numbers;
  kernels.resize(operations.size());
  handleWords.resize(operations.size());
  for (size_t i = 0; i < operations.size(); ++i) {
    const GraphOperation &operation = operations[i];
    if (operation.kind == Kind::Other)
      throw saveError(Error::Kind::Runtime,
                      "it has " + operation.constant + ", which no file holds");
    if (operation.kind == Kind::UpdateGeometry)
      findUpdated(i);
    if (operation.kind != Kind::Launch)
      continue;
    auto [entry, isNew] =
        numbers.try_emplace(operation.plan.variant, module.kernels.size());
    if (isNew) {
      module.kernels.push_back(operation.kernel->save(operation.plan));
      checkKernel(*operation.kernel, module.kernels.back());
    }
    kernels[i] = entry->second;
  }
}

//===----------------------------------------------------------------------===//
// Files
//===----------------------------------------------------------------------===//

void Saver::addHandles() {
  for (const HandleContents &found : handles.all()) {
    FileHandle &saved = file.handles.emplace_back();
    saved.kind = uint8_t(found.kind);
    saved.words = found.words;
    saved.words[0] = 0;
    for (const HandleContents::Pointer &pointer : found.pointers) {
      uint64_t &word = saved.words[pointer.word];
      uint32_t block = word ? spareBlock : nullBlock;
      if (pointer.begin != pointer.end) {
        block = blockOf({pointer.begin, pointer.end});
        word -= startOf(block);
      } else {
        word = 0;
      }
      saved.blocks.push_back(block);
    }
  }
}

FileOperation Saver::fileOperation(size_t number) {
  FileOperation entry;
  entry.operation = operations[number];
  std::string &arguments = entry.operation.arguments;
  if (entry.operation.kind == Kind::Launch) {
    entry.kernel = kernels[number];
    const Kernel::Plan &plan = entry.operation.plan;
    if (!isHost(device) && !plan.openBlock)
      entry.blockDim = plan.variant->key.blockDim;
    std::memset(arguments.data() + offsetof(LaunchHeader, errorRecord), 0, 8);
  }
  for (const Pointer &pointer : pointers[number]) {
    uint64_t address;
    std::memcpy(&address, arguments.data() + pointer.slot, sizeof(address));
    uint32_t block = address ? spareBlock : nullBlock;
    if (pointer.range.begin != pointer.range.end) {
      block = blockOf(pointer.range);
      address -= startOf(block);
    } else {
      address = 0;
    }
    std::memcpy(arguments.data() + pointer.slot, &address, sizeof(address));
    entry.blocks.push_back(block);
  }
  entry.handles = handleWords[number];
  for (const HandleWord &word : entry.handles)
    std::memset(arguments.data() + word.at, 0, sizeof(uint64_t));
  entry.constantHandles = idsOfConstant(number, entry.operation.constant);
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
  int arch = deviceInfo(device).arch;
  file.target = arch == 0 ? "cpu" : "sm_" + std::to_string(arch);
  if (isCapturing(device))
    throw saveError(Error::Kind::Runtime, "another one is being captured");
  synchronizeDevice(device);
  collectKernels();
  collectMemory();
  chooseContents();
  addNames();
  readBlocks();
  addHandles();
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
