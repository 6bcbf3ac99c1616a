//===- SaveMemory.cpp - Reachable memory of a saved graph -----------------===//
//
// Part of Warp on MLIR, under the Apache License v2.0.
//
// Memory that operations reach, as far as it overlaps, becomes one block, so
// that arrays which share memory still do after loading. A block is saved with
// what is in it, unless the graph writes all of it before it looks.
//
//===----------------------------------------------------------------------===//

#include "Saver.h"

#include <algorithm>

using namespace warp;
using namespace warp::graphs;
using Kind = GraphOperation::Kind;

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
  findIds();
  for (const HandleContents &found : handles.all())
    for (const HandleContents::Pointer &pointer : found.pointers) {
      if (found.words[pointer.word] && pointer.begin == pointer.end &&
          found.kind == GeometryKind::Volume)
        throw saveError(Error::Kind::Runtime,
                        "it has a Volume in memory that nobody knows of");
      ranges.push_back({pointer.begin, pointer.end});
    }
  std::sort(ranges.begin(), ranges.end(),
            [](const AddressRange &a, const AddressRange &b) {
              return a.begin < b.begin;
            });
  for (const AddressRange &range : ranges) {
    if (range.begin == range.end || handles.around(range))
      continue;
    // The parts of a block stay as aligned as they are, see `packedAlignment`.
    uint64_t begin = range.begin - (isHost(device) ? 0 : range.begin % 16);
    if (!blocks.empty() && begin < blocks.back().range.end)
      blocks.back().range.end = std::max(blocks.back().range.end, range.end);
    else
      blocks.push_back({{begin, range.end}});
  }
}

/// Behind the numbers of blocks come those of handles, whose words are memory
/// that kernels may reach, too.
uint32_t Saver::blockOf(const AddressRange &range) const {
  if (std::optional<uint32_t> handle = handles.around(range))
    return uint32_t(blocks.size()) + *handle;
  auto after = std::upper_bound(blocks.begin(), blocks.end(), range.begin,
                                [](uint64_t address, const Block &block) {
                                  return address < block.range.begin;
                                });
  return uint32_t(after - blocks.begin() - 1);
}

uint64_t Saver::startOf(uint32_t block) const {
  return block < blocks.size() ? blocks[block].range.begin
                               : handles.addressOf(block - blocks.size());
}

/// True if an operation writes all that its first pointer reaches, and reads
/// nothing of it.
static bool overwrites(const GraphOperation &operation) {
  return operation.kind == Kind::FillBytes || operation.kind == Kind::Upload ||
         operation.kind == Kind::CopyBytes;
}

void Saver::chooseContents() {
  auto touch = [&](const AddressRange &range, bool overwritten) {
    if (range.begin == range.end || handles.around(range))
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
  for (const HandleContents &found : handles.all())
    for (const HandleContents::Pointer &pointer : found.pointers) {
      AddressRange range{pointer.begin, pointer.end};
      touch(range, false);
      if (range.begin != range.end && !handles.around(range))
        blocks[blockOf(range)].ofGeometry = true;
    }
  for (size_t i = 0; i < operations.size(); ++i)
    // An object is made of them when the graph is loaded.
    if (operations[i].kind == Kind::UpdateGeometry)
      for (const Pointer &pointer : pointers[i])
        touch(pointer.range, false);
  int depth = 0;
  for (size_t i = 0; i < operations.size(); ++i) {
    depth += operations[i].kind == Kind::BeginBody;
    depth -= operations[i].kind == Kind::EndBody;
    // The source of a copy comes before its destination.
    for (size_t p = pointers[i].size(); p-- > 0;)
      touch(pointers[i][p].range,
            p == 0 && depth == 0 && overwrites(operations[i]));
  }
}

void Saver::readBlocks() {
  uint64_t alignment = isHost(device) ? 64 : 256;
  for (const Block &block : blocks) {
    FileBlock &saved = file.blocks.emplace_back();
    saved.lead = block.range.begin % alignment;
    saved.bytes = block.range.end - block.range.begin;
    if (!block.needed)
      continue;
    saved.contents.resize(saved.bytes);
    download(saved.contents.data(),
             reinterpret_cast<const void *>(block.range.begin), device,
             saved.bytes);
    saved.handles = idsIn(block.range, saved.contents);
    if (saved.handles.empty() && !block.ofGeometry &&
        saved.contents.find_first_not_of('\0') == std::string::npos)
      saved.contents.clear();
  }
}
