//===- Load.cpp - Deserialisation of saved graphs -------------------------===//
//
// Part of Warp on MLIR, under the Apache License v2.0.
//
// Blocks of memory are allocated and filled, pointers put back among the
// arguments, and each operation is done again while a capture records. That an
// operation stays within its blocks is worked out anew from its arguments.
//
//===----------------------------------------------------------------------===//

#include "Loader.h"

#include "Runtime/Support.h"

using namespace warp;
using namespace warp::graphs;
using Kind = GraphOperation::Kind;

LoadedGraph::LoadedGraph(std::unique_ptr<Impl> impl) : impl(std::move(impl)) {}
LoadedGraph::~LoadedGraph() = default;

//===----------------------------------------------------------------------===//
// Loading
//===----------------------------------------------------------------------===//

void Loader::checkTarget() const {
  bool forCpu = file.target == "cpu";
  if (forCpu != isHost(device))
    throw format.error(origin, "was made for '" + file.target +
                                   "' and cannot run on '" +
                                   deviceInfo(device).alias + "'");
}

void Loader::loadKernels(const std::map<std::string, std::string> &modules) {
  if (file.module.empty())
    return;
  auto found = modules.find(file.module);
  if (found == modules.end())
    throw format.error(origin, "needs the code in '" + file.module +
                                   "', which was not provided");
  const std::string &code = found->second;
  if (hashBytes(code.data(), code.size()) != file.moduleHash)
    throw format.error(origin, "does not belong to the code in '" +
                                   file.module + "', or that is damaged");
  module = SavedModule::fromBytes(code, file.module);
  for (const SavedKernel &saved : module.kernels) {
    if (saved.target == "cpu")
      checkProcessor(saved);
    kernels.push_back(std::make_shared<Kernel>(saved));
  }
}

void Loader::checkRoom(uint64_t mostBytes) const {
  uint64_t needed = 0;
  // The count of blocks is bounded by the length of the file.
  for (const FileBlock &block : file.blocks)
    needed = std::min(needed + block.lead + block.bytes, uint64_t(1) << 62);
  auto refuse = [&](const std::string &why) {
    throw Error(Error::Kind::Memory,
                "saved graph '" + origin + "' needs " + formatBytes(needed) +
                    " on '" + deviceInfo(device).alias + "', " + why);
  };
  if (needed > mostBytes)
    refuse("but is to have at most " + formatBytes(mostBytes));
  size_t free = deviceMemory(device).first;
  if (needed > free)
    refuse("free " + formatBytes(free));
}

void Loader::allocate(const Stream *stream) {
  for (FileBlock &block : file.blocks) {
    auto buffer = std::make_unique<Buffer>(device, block.lead + block.bytes,
                                           false, stream);
    char *start = static_cast<char *>(buffer->data()) + block.lead;
    buffers.push_back(std::move(buffer));
    if (block.contents.empty())
      setMemory(start, device, 0, block.bytes, stream);
    else
      upload(start, device, block.contents.data(), block.bytes, stream);
  }
  buffers.push_back(std::make_unique<Buffer>(device, 256, false, stream));
  spare = reinterpret_cast<uint64_t>(buffers.back()->data());
  isAllocated = true;
  if (stream)
    stream->synchronize();
}

/// Ids in arrays, once they are known.
void Loader::writeIds(const Stream *stream) {
  for (size_t i = 0; i < file.blocks.size(); ++i) {
    FileBlock &block = file.blocks[i];
    for (const HandleWord &word : block.handles) {
      uint64_t id = geometry.id(word.handle);
      upload(reinterpret_cast<void *>(rangeOf(uint32_t(i)).begin + word.at),
             device, &id, sizeof id, stream);
    }
    if (stream && !block.handles.empty())
      stream->synchronize();
    std::string().swap(block.contents);
  }
}

AddressRange Loader::rangeOf(uint32_t block) const {
  bool isHandle = block >= file.blocks.size();
  if (!isAllocated)
    return {nowhere, nowhere + (isHandle ? sizeof(FileHandle::words)
                                         : file.blocks[block].bytes)};
  if (isHandle) {
    uint64_t start = geometry.address(block - uint32_t(file.blocks.size()));
    return {start, start + sizeof(FileHandle::words)};
  }
  uint64_t start = reinterpret_cast<uint64_t>(buffers[block]->data()) +
                   file.blocks[block].lead;
  return {start, start + file.blocks[block].bytes};
}

uint64_t Loader::addressOf(uint32_t block, uint64_t offset) const {
  return block == nullBlock    ? 0
         : block == spareBlock ? spare
                               : rangeOf(block).begin + offset;
}

void Loader::writeIds(const std::vector<HandleWord> &words,
                      std::string &bytes) {
  for (const HandleWord &word : words) {
    uint64_t id = geometry.id(word.handle);
    std::memcpy(bytes.data() + word.at, &id, sizeof id);
  }
}

/// Objects for geometry that the graph updates, made of the arrays that it has
/// for that; what follows knows only their ids.
void Loader::prepareGeometry() {
  for (const FileOperation &entry : file.operations) {
    const GraphOperation &operation = entry.operation;
    if (operation.kind != Kind::UpdateGeometry)
      continue;
    if (entry.handles.size() != 1 || entry.handles[0].at != 0)
      throw damaged("the " + describe(operation) + " lacks its geometry");
    // It is not known yet whose it is.
    FileOperation known = copyWithPointers(entry);
    uint32_t number = entry.handles[0].handle;
    geometry.prepare(number, file.handles[number],
                     known.operation.read<UpdateGeometry>());
  }
}

void Loader::writeGeometry() {
  for (uint32_t i = 0; i < file.handles.size(); ++i) {
    restorePointers(file.handles[i]);
    geometry.write(i, file.handles[i].words);
  }
}

void Loader::makeGeometry(const Stream *stream) {
  geometry.make(file, device);
  prepareGeometry();
  writeGeometry();
  writeIds(stream);
}

std::shared_ptr<Graph> Loader::capture(std::shared_ptr<Stream> stream) {
  std::unique_ptr<Capture> capture = Capture::begin(device, stream);
  Conditions conditions;
  for (FileOperation &entry : file.operations)
    repeat(entry.operation, device, entry.blockDim, stream.get(), *capture,
           conditions, geometry);
  return capture->end();
}

/// True if it says already what is wrong with a saved graph.
static bool isAboutFile(const Error &error) {
  return error.message.starts_with(format.name);
}

std::shared_ptr<LoadedGraph> LoadedGraph::fromFiles(const GraphFiles &files,
                                                    int device,
                                                    const std::string &origin,
                                                    uint64_t mostBytes) {
  auto impl = std::make_unique<Impl>();
  impl->file = GraphFile::fromBytes(files.graph, origin);
  Loader loader(impl->file, impl->kernels, impl->buffers, impl->geometry,
                device, origin);
  loader.checkTarget();
  if (isHost(device) && isCapturing(device))
    throw format.error(origin,
                       "cannot be loaded while this thread captures a graph");
  std::shared_ptr<Stream> stream;
  if (!isHost(device))
    stream = std::make_shared<Stream>(device);
  loader.loadKernels(files.modules);
  try {
    loader.checkReach();
    loader.checkRoom(mostBytes);
    loader.allocate(stream.get());
    loader.makeGeometry(stream.get());
    loader.restorePointers();
    impl->graph = loader.capture(stream);
  } catch (const Error &error) {
    // On a GPU the driver may have a reason of its own.
    if (error.kind == Error::Kind::Memory || isAboutFile(error) ||
        (error.kind == Error::Kind::Runtime && !isHost(device)))
      throw;
    throw format.error(origin, "is damaged, " + error.message);
  }
  for (const FileName &name : impl->file.names)
    impl->names[name.name] = &name;
  return std::shared_ptr<LoadedGraph>(new LoadedGraph(std::move(impl)));
}

//===----------------------------------------------------------------------===//
// Names
//===----------------------------------------------------------------------===//

Graph &LoadedGraph::graph() const { return *impl->graph; }

const FileName &LoadedGraph::Impl::find(const std::string &name) const {
  auto found = names.find(name);
  if (found != names.end())
    return *found->second;
  std::string known;
  for (const auto &[other, place] : names)
    known += (known.empty() ? "'" : ", '") + other + "'";
  throw Error(Error::Kind::Key,
              "the graph has no array '" + name +
                  "', it has: " + (known.empty() ? "none" : known));
}

const FileName &LoadedGraph::Impl::checked(const std::string &name,
                                           size_t bytes) const {
  const FileName &place = find(name);
  if (place.bytes != bytes)
    throw Error(Error::Kind::Value, "the graph's array '" + name + "' has " +
                                        std::to_string(place.bytes) +
                                        " bytes, but got " +
                                        std::to_string(bytes));
  return place;
}

std::vector<std::string> LoadedGraph::names() const {
  std::vector<std::string> list;
  for (const FileName &name : impl->file.names)
    list.push_back(name.name);
  return list;
}

bool LoadedGraph::has(const std::string &name) const {
  return impl->names.count(name) != 0;
}

void *LoadedGraph::data(const std::string &name) const {
  const FileName &place = impl->find(name);
  return place.bytes ? impl->startOf(place.block) + place.offset : nullptr;
}

size_t LoadedGraph::bytes(const std::string &name) const {
  return impl->find(name).bytes;
}

void LoadedGraph::set(const std::string &name, const void *source, size_t bytes,
                      int from, const Stream *stream) {
  impl->checked(name, bytes);
  copyMemory(data(name), device(), source, from, bytes, stream);
}

void LoadedGraph::get(const std::string &name, void *target, size_t bytes,
                      int to, const Stream *stream) const {
  impl->checked(name, bytes);
  copyMemory(target, to, data(name), device(), bytes, stream);
}
