//===- LoadPointers.cpp - Pointer relocation of loaded graphs -------------===//
//
// Part of Warp on MLIR, under the Apache License v2.0.
//
// Pointers are put back twice: first to memory that there is not yet, so that
// no file is trusted to need more than its operations reach, and then to
// what was allocated.
//
//===----------------------------------------------------------------------===//

#include "Loader.h"

#include "Geometry/Slots.h"

#include <algorithm>
#include <cstring>

using namespace warp;
using namespace warp::graphs;
using Kind = GraphOperation::Kind;

/// The host runs bodies within bodies by calls within calls.
static constexpr int mostBodies = 256;

void Loader::restorePointers(FileHandle &handle) {
  std::vector<uint32_t> words = pointerWords(GeometryKind(handle.kind));
  for (size_t k = 0; k < words.size(); ++k)
    handle.words[words[k]] =
        addressOf(handle.blocks[k], handle.words[words[k]]);
  HandleContents reached{GeometryKind(handle.kind), handle.words, {}};
  warp::geometry::findPointers(reached, {});
  for (size_t k = 0; k < words.size(); ++k) {
    const HandleContents::Pointer &pointer = reached.pointers[k];
    if (pointer.begin == pointer.end)
      continue;
    AddressRange memory;
    if (exists(handle.blocks[k]))
      memory = rangeOf(handle.blocks[k]);
    if (pointer.begin < memory.begin || pointer.end > memory.end)
      throw damaged("geometry reaches beyond its memory");
    noteReach(handle.blocks[k], pointer.end - memory.begin);
  }
}

void Loader::restorePointers(FileOperation &entry) {
  static const std::vector<Access> none;
  GraphOperation &operation = entry.operation;
  bool isLaunch = operation.kind == Kind::Launch;
  if (isLaunch) {
    if (entry.kernel >= kernels.size())
      throw damaged("a launch has no kernel");
    operation.kernel = kernels[entry.kernel].get();
  }
  checkArguments(operation, isLaunch ? operation.kernel->parameterSize() : 0);
  const std::vector<Access> &accesses =
      isLaunch ? module.kernels[entry.kernel].accesses : none;
  // The places of pointers depend on no pointer.
  std::vector<size_t> slots = slotsOf(operation, accesses);
  if (slots.size() != entry.blocks.size())
    throw damaged("the " + describe(operation) + " lacks a pointer");
  for (size_t i = 0; i < slots.size(); ++i) {
    uint64_t address = 0;
    std::memcpy(&address, operation.arguments.data() + slots[i], 8);
    uint32_t block = entry.blocks[i];
    if (block != nullBlock && block != spareBlock && !exists(block))
      throw damaged("the " + describe(operation) + " lacks its memory");
    address = addressOf(block, address);
    std::memcpy(operation.arguments.data() + slots[i], &address, 8);
  }
  for (const HandleWord &word : entry.handles)
    for (size_t slot : slots)
      if (word.at < slot + 8 && slot < word.at + 8)
        throw damaged("the " + describe(operation) + " has ids for pointers");
  writeIds(entry.handles, operation.arguments);
  writeIds(entry.constantHandles, operation.constant);
  std::vector<Pointer> pointers = pointersOf(operation, accesses);
  for (size_t i = 0; i < pointers.size(); ++i) {
    const AddressRange &range = pointers[i].range;
    if (range.begin == range.end)
      continue;
    AddressRange memory;
    if (exists(entry.blocks[i]))
      memory = rangeOf(entry.blocks[i]);
    if (range.begin < memory.begin || range.end > memory.end ||
        range.begin > range.end)
      throw damaged("the " + describe(operation) +
                    " reaches beyond its memory");
    noteReach(entry.blocks[i], range.end - memory.begin);
  }
}

/// An operation that knows where its arrays are, and no ids.
FileOperation Loader::copyWithPointers(const FileOperation &entry) {
  FileOperation known = entry;
  known.handles.clear();
  known.constantHandles.clear();
  restorePointers(known);
  return known;
}

void Loader::restorePointers() {
  for (FileOperation &entry : file.operations)
    restorePointers(entry);
}

void Loader::checkDepth() const {
  int depth = 0;
  for (const FileOperation &entry : file.operations) {
    depth += entry.operation.kind == Kind::BeginBody;
    depth -= entry.operation.kind == Kind::EndBody;
    if (depth < 0 || depth > mostBodies)
      break;
  }
  if (depth != 0)
    throw damaged("branches and loops do not end where they should");
}

void Loader::noteReach(uint32_t block, uint64_t end) {
  if (!isAllocated && block < reach.size())
    reach[block] = std::max(reach[block], end);
}

void Loader::checkReach() {
  checkDepth();
  reach.resize(file.blocks.size());
  for (FileHandle handle : file.handles)
    restorePointers(handle);
  for (const FileName &name : file.names)
    noteReach(name.block, name.bytes ? name.offset + name.bytes : 0);
  for (const FileOperation &entry : file.operations)
    copyWithPointers(entry);
  for (size_t i = 0; i < file.blocks.size(); ++i) {
    // Contents are in the file.
    const FileBlock &block = file.blocks[i];
    if (block.contents.empty() && block.bytes != reach[i])
      throw damaged("block " + std::to_string(i) + " of memory has '" +
                    std::to_string(block.bytes) +
                    "' bytes, but operations reach '" +
                    std::to_string(reach[i]) + "'");
  }
}
