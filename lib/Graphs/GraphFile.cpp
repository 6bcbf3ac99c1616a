//===- GraphFile.cpp - The file of a saved graph --------------------------===//
//
// Part of Warp on MLIR, under the Apache License v2.0.
//
// As for saved modules, reading trusts nothing: magic, version, length and
// hash come first, and every length is checked against what is left.
//
//===----------------------------------------------------------------------===//

#include "GraphFile.h"

#include "Runtime/Bytes.h"
#include "Runtime/Support.h"
#include "warp/Version.h"

using namespace warp;
using namespace warp::graphs;

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
}

static FileOperation readOperation(Reader &in) {
  FileOperation entry;
  GraphOperation &operation = entry.operation;
  operation.kind = static_cast<GraphOperation::Kind>(in.number<uint8_t>());
  entry.kernel = in.number<uint32_t>();
  entry.blockDim = in.number<int32_t>();
  operation.dim.rank = in.number<int32_t>();
  for (int64_t &extent : operation.dim.extent)
    extent = in.number<int64_t>();
  operation.arguments = in.string();
  auto pointers = in.number<uint64_t>();
  for (uint64_t i = 0; i < pointers && in.ok(); ++i)
    entry.blocks.push_back(in.number<uint32_t>());
  operation.constant = in.string();
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
  }
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
  file.target = in.string();
  file.module = in.string();
  file.moduleHash = in.number<uint64_t>();
  auto blocks = in.number<uint64_t>();
  for (uint64_t i = 0; i < blocks && in.ok(); ++i) {
    FileBlock block;
    block.lead = in.number<uint32_t>();
    block.bytes = in.number<uint64_t>();
    block.contents = in.string();
    file.blocks.push_back(std::move(block));
  }
  auto names = in.number<uint64_t>();
  for (uint64_t i = 0; i < names && in.ok(); ++i) {
    FileName name;
    name.name = in.string();
    name.block = in.number<uint32_t>();
    name.offset = in.number<uint64_t>();
    name.bytes = in.number<uint64_t>();
    file.names.push_back(std::move(name));
  }
  auto operations = in.number<uint64_t>();
  for (uint64_t i = 0; i < operations && in.ok(); ++i)
    file.operations.push_back(readOperation(in));
  return file;
}

/// Whether [offset, offset + bytes) lies in a block.
static bool isWithin(const FileBlock &block, uint64_t offset, uint64_t bytes) {
  return offset <= block.bytes && bytes <= block.bytes - offset;
}

static void checkMemory(const GraphFile &file, const std::string &origin) {
  for (const FileBlock &block : file.blocks)
    if (block.lead >= 4096 || block.bytes > uint64_t(1) << 47 ||
        (!block.contents.empty() && block.contents.size() != block.bytes))
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
    throw format.error(origin, "is damaged, it ends too early");
  checkMemory(file, origin);
  return file;
}
