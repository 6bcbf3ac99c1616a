//===- GraphFile.cpp - File format of saved graphs ------------------------===//
//
// Part of Warp on MLIR, under the Apache License v2.0.
//
// As for saved modules, reading trusts nothing: magic, version, length and
// hash come first, and every length is checked against what is left.
//
//===----------------------------------------------------------------------===//

#include "GraphFile.h"

#include "Geometry/Slots.h"
#include "Runtime/Bytes.h"
#include "Runtime/Support.h"
#include "warp/Version.h"

using namespace warp;
using namespace warp::graphs;

static void writeWords(Writer &out, const std::vector<HandleWord> &words) {
  out.number<uint64_t>(words.size());
  for (const HandleWord &word : words) {
    out.number(word.at);
    out.number(word.handle);
  }
}

static std::vector<HandleWord> readWords(Reader &in) {
  std::vector<HandleWord> words;
  uint64_t count = in.count(12);
  for (uint64_t i = 0; i < count && in.ok(); ++i) {
    HandleWord word;
    word.at = in.number<uint64_t>();
    word.handle = in.number<uint32_t>();
    words.push_back(word);
  }
  return words;
}

static void writeHandle(Writer &out, const FileHandle &handle) {
  out.number(handle.kind);
  for (uint64_t word : handle.words)
    out.number(word);
  for (uint32_t block : handle.blocks)
    out.number(block);
}

/// `kind` is checked where it says how many addresses there are.
static FileHandle readHandle(Reader &in) {
  FileHandle handle;
  handle.kind = in.number<uint8_t>(1, lastGeometryKind, "the kind of geometry");
  for (uint64_t &word : handle.words)
    word = in.number<uint64_t>();
  if (in.ok())
    handle.blocks.resize(pointerWords(GeometryKind(handle.kind)).size());
  for (uint32_t &block : handle.blocks)
    block = in.number<uint32_t>();
  return handle;
}

static void writeOperation(Writer &out, const FileOperation &entry) {
  const GraphOperation &operation = entry.operation;
  out.number<uint8_t>(static_cast<uint8_t>(operation.kind));
  out.number<uint32_t>(entry.kernel);
  out.number<int32_t>(entry.blockDim);
  out.number<int32_t>(operation.dim.rank);
  for (int64_t extent : operation.dim.extent)
    out.number<int64_t>(extent);
  out.string(operation.arguments);
  out.number<uint64_t>(entry.blocks.size());
  for (uint32_t block : entry.blocks)
    out.number<uint32_t>(block);
  out.string(operation.constant);
  writeWords(out, entry.handles);
  writeWords(out, entry.constantHandles);
}

static FileOperation readOperation(Reader &in) {
  FileOperation entry;
  GraphOperation &operation = entry.operation;
  operation.kind = static_cast<GraphOperation::Kind>(in.number<uint8_t>(
      0, uint8_t(GraphOperation::Kind::MultiplyRows), "the kind of operation"));
  entry.kernel = in.number<uint32_t>();
  entry.blockDim = in.number<int32_t>(0, 1024, "the threads of a block");
  operation.dim.rank = in.number<int32_t>(1, maxRank, "the rank of a launch");
  for (int64_t &extent : operation.dim.extent)
    extent = in.number<int64_t>(0, INT32_MAX, "the extent of a launch");
  operation.arguments = in.string();
  uint64_t pointers = in.count(4);
  for (uint64_t i = 0; i < pointers && in.ok(); ++i)
    entry.blocks.push_back(in.number<uint32_t>());
  operation.constant = in.string();
  entry.handles = readWords(in);
  entry.constantHandles = readWords(in);
  return entry;
}

std::string GraphFile::bytes() const {
  Writer payload;
  payload.string(version());
  payload.string(target);
  payload.string(module);
  payload.number(moduleHash);
  payload.number<uint64_t>(blocks.size());
  for (const FileBlock &block : blocks) {
    payload.number(block.lead);
    payload.number(block.bytes);
    payload.string(block.contents);
    writeWords(payload, block.handles);
  }
  payload.number<uint64_t>(handles.size());
  for (const FileHandle &handle : handles)
    writeHandle(payload, handle);
  payload.number<uint64_t>(names.size());
  for (const FileName &name : names) {
    payload.string(name.name);
    payload.number(name.block);
    payload.number(name.offset);
    payload.number(name.bytes);
  }
  payload.number<uint64_t>(operations.size());
  for (const FileOperation &operation : operations)
    writeOperation(payload, operation);
  return format.wrap(payload.bytes);
}

static GraphFile readPayload(Reader &in) {
  GraphFile file;
  in.string();
  file.target = in.text();
  file.module = in.text();
  file.moduleHash = in.number<uint64_t>();
  uint64_t blocks = in.count(28);
  for (uint64_t i = 0; i < blocks && in.ok(); ++i) {
    FileBlock block;
    block.lead = in.number<uint32_t>(0, 4095, "the alignment of a block");
    block.bytes =
        in.number<uint64_t>(0, uint64_t(1) << 47, "the size of a block");
    block.contents = in.string();
    block.handles = readWords(in);
    file.blocks.push_back(std::move(block));
  }
  uint64_t handles = in.count(1);
  for (uint64_t i = 0; i < handles && in.ok(); ++i)
    file.handles.push_back(readHandle(in));
  uint64_t names = in.count(28);
  for (uint64_t i = 0; i < names && in.ok(); ++i) {
    FileName name;
    name.name = in.text();
    name.block = in.number<uint32_t>();
    name.offset = in.number<uint64_t>();
    name.bytes = in.number<uint64_t>();
    file.names.push_back(std::move(name));
  }
  uint64_t operations = in.count(1);
  for (uint64_t i = 0; i < operations && in.ok(); ++i)
    file.operations.push_back(readOperation(in));
  return file;
}

/// True if [offset, offset + bytes) lies in a block.
static bool isWithin(const FileBlock &block, uint64_t offset, uint64_t bytes) {
  return offset <= block.bytes && bytes <= block.bytes - offset;
}

/// Handles that are there, at places in `size` bytes.
static void checkWords(const GraphFile &file,
                       const std::vector<HandleWord> &words, uint64_t size,
                       const std::string &origin) {
  for (const HandleWord &word : words)
    if (word.handle >= file.handles.size() || word.at % 4 != 0 || size < 8 ||
        word.at > size - 8)
      throw format.error(origin, "is damaged, an id has no geometry");
}

static void checkHandles(const GraphFile &file, const std::string &origin) {
  for (const FileBlock &block : file.blocks)
    checkWords(file, block.handles, block.contents.size(), origin);
  for (const FileOperation &entry : file.operations) {
    checkWords(file, entry.handles, entry.operation.arguments.size(), origin);
    checkWords(file, entry.constantHandles, entry.operation.constant.size(),
               origin);
  }
  for (const FileHandle &handle : file.handles) {
    if (!geometry::isPossible(GeometryKind(handle.kind), handle.words))
      throw format.error(origin, "is damaged, geometry has impossible arrays");
    size_t i = 0;
    for (uint32_t word : pointerWords(GeometryKind(handle.kind))) {
      uint32_t block = handle.blocks[i++];
      if (block != nullBlock && block != spareBlock &&
          (block >= file.blocks.size() ||
           handle.words[word] > file.blocks[block].bytes))
        throw format.error(origin, "is damaged, geometry lacks its memory");
    }
  }
}

static void checkMemory(const GraphFile &file, const std::string &origin) {
  for (const FileBlock &block : file.blocks)
    if (!block.contents.empty() && block.contents.size() != block.bytes)
      throw format.error(origin,
                         "is damaged, a block of memory has no valid size");
  for (const FileName &name : file.names)
    if (name.bytes != 0 &&
        (name.block >= file.blocks.size() ||
         !isWithin(file.blocks[name.block], name.offset, name.bytes)))
      throw format.error(origin, "is damaged, '" + name.name +
                                     "' lies in no block of memory");
}

GraphFile GraphFile::fromBytes(const std::string &bytes,
                               const std::string &origin) {
  std::string_view payload = format.unwrap(bytes, origin);
  Reader in(payload.data(), payload.size());
  GraphFile file = readPayload(in);
  if (!in.atEnd())
    throw format.error(origin, "is damaged, " + in.problem());
  // A name, never a place elsewhere.
  if (file.module.find('/') != std::string::npos || file.module == "..")
    throw format.error(origin, "is damaged, '" + file.module +
                                   "' is no name of a file");
  checkMemory(file, origin);
  checkHandles(file, origin);
  return file;
}
