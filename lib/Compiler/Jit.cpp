//===- Jit.cpp - JIT linking of CPU objects -------------------------------===//
//
// Part of Warp on MLIR, under the Apache License v2.0.
//
// One JITLink session per process. Every object gets a library of its own, so
// names never clash and one kernel's code can go when its owner does. An object
// may call what Support/RuntimeSymbols.h lists, and the device library, which
// is linked when the first object needs it. lib/Loader does the same without
// LLVM.
//
//===----------------------------------------------------------------------===//

#include "JitListeners.h"
#include "warp/Compile.h"
#include "warp/Forks.h"
#include "warp/JitListener.h"

#include "Support/LibraryObjects.h"
#include "Support/RuntimeSymbols.h"

#ifdef __aarch64__
#include "llvm/ExecutionEngine/JITLink/aarch64.h"
#else
#include "llvm/ExecutionEngine/JITLink/x86_64.h"
#endif
#include "llvm/ExecutionEngine/Orc/AbsoluteSymbols.h"
#include "llvm/ExecutionEngine/Orc/Core.h"
#include "llvm/ExecutionEngine/Orc/ObjectFileInterface.h"
#include "llvm/ExecutionEngine/Orc/ObjectLinkingLayer.h"
#include "llvm/ExecutionEngine/Orc/SelfExecutorProcessControl.h"
#include "llvm/Support/MemoryBuffer.h"

#include <atomic>
#include <map>

using namespace llvm;

//===----------------------------------------------------------------------===//
// The session
//===----------------------------------------------------------------------===//

static warp::Error toError(llvm::Error error) {
  return warp::Error(warp::Error::Kind::Compile,
                     "cannot load compiled code: " +
                         llvm::toString(std::move(error)));
}

namespace {
/// Refuses relocations beyond what they are in: JITLink takes them as they
/// come, and an object may be from a file.
class FixupCheck : public orc::LinkGraphLinkingLayer::Plugin {
public:
  void modifyPassConfig(orc::MaterializationResponsibility &,
                        jitlink::LinkGraph &graph,
                        jitlink::PassConfiguration &config) override {
    config.PreFixupPasses.push_back(check);
  }
  llvm::Error notifyFailed(orc::MaterializationResponsibility &) override {
    return llvm::Error::success();
  }
  llvm::Error notifyRemovingResources(orc::JITDylib &,
                                      orc::ResourceKey) override {
    return llvm::Error::success();
  }
  void notifyTransferringResources(orc::JITDylib &, orc::ResourceKey,
                                   orc::ResourceKey) override {}

private:
  /// Bytes that a relocation writes.
  static size_t sizeOf(jitlink::Edge::Kind kind) {
    switch (kind) {
#ifdef __aarch64__
    case jitlink::aarch64::Pointer64:
    case jitlink::aarch64::Delta64:
    case jitlink::aarch64::NegDelta64:
      return 8;
#else
    case jitlink::x86_64::Pointer64:
    case jitlink::x86_64::Delta64:
    case jitlink::x86_64::NegDelta64:
    case jitlink::x86_64::Delta64FromGOT:
      return 8;
    case jitlink::x86_64::Pointer16:
      return 2;
    case jitlink::x86_64::Pointer8:
    case jitlink::x86_64::Delta8:
      return 1;
#endif
    default:
      return 4;
    }
  }

  static llvm::Error check(jitlink::LinkGraph &graph) {
    for (jitlink::Block *block : graph.blocks())
      for (const jitlink::Edge &edge : block->edges())
        if (edge.isRelocation() &&
            (block->isZeroFill() ||
             uint64_t(edge.getOffset()) + sizeOf(edge.getKind()) >
                 block->getSize()))
          return createStringError("a relocation lies outside of its section");
    return llvm::Error::success();
  }
};
} // namespace

static std::atomic<warp::JitListener> wanted = warp::JitListener::None;
static std::atomic<bool> isMade = false;

struct warp::Jit::Impl {
  Impl()
      : session(cantFail(orc::SelfExecutorProcessControl::Create())),
        layer(session), runtime(session.createBareJITDylib("runtime")),
        device(session.createBareJITDylib("device library")) {
    isMade = true;
    layer.addPlugin(std::make_shared<FixupCheck>());
    if (wanted == warp::JitListener::Perf)
      layer.addPlugin(warp::makePerfMap());
    if (wanted == warp::JitListener::Debugger)
      layer.addPlugin(cantFail(warp::makeDebuggerListener(session)));
    session.setErrorReporter([this](llvm::Error error) {
      reported += llvm::toString(std::move(error));
    });
    orc::SymbolMap map;
    for (warp::RuntimeSymbol symbol : warp::runtimeSymbols())
      if (symbol.address)
        map[session.intern(symbol.name)] = {
            orc::ExecutorAddr::fromPtr(symbol.address),
            JITSymbolFlags::Exported};
    cantFail(runtime.define(orc::absoluteSymbols(std::move(map))));
    for (const LibraryObject &object : libraryObjects())
      addLibrary(object);
  }

  /// Makes an object's functions known by their names with its level. It is
  /// linked when the first of them is asked for.
  void addLibrary(const LibraryObject &object) {
    orc::JITDylib &own = session.createBareJITDylib("device library " +
                                                    std::string(object.level));
    own.addToLinkOrder(runtime);
    auto buffer = MemoryBuffer::getMemBuffer(object.bytes, object.level,
                                             /*RequiresNullTerminator=*/false);
    orc::SymbolAliasMap names;
    auto known = cantFail(
        orc::getObjectFileInterface(session, buffer->getMemBufferRef()));
    for (auto &[name, flags] : known.SymbolFlags)
      if (flags.isExported())
        names[session.intern((*name + "." + StringRef(object.level)).str())] = {
            name, flags};
    cantFail(layer.add(own, std::move(buffer)));
    cantFail(device.define(orc::reexports(own, std::move(names))));
  }

  warp::ForkMutex mutex;
  orc::ExecutionSession session;
  orc::ObjectLinkingLayer layer;
  orc::JITDylib &runtime, &device;
  std::string reported;
  unsigned count = 0;
  std::map<void *, orc::JITDylib *> loaded;
};

warp::Jit::Jit() : impl(new Impl) {}

warp::Jit &warp::Jit::get() {
  // It takes milliseconds to make.
  ForkSection section;
  // Never destroyed: kernels may run while the process exits.
  static auto *jit = new Jit;
  return *jit;
}

void warp::setJitListener(JitListener listener) {
  if (listener == wanted)
    return;
  if (isMade)
    throw Error(Error::Kind::Runtime,
                "profilers and debuggers are chosen before the first kernel "
                "for the CPU is loaded, which has happened");
  wanted = listener;
}

void *warp::Jit::load(const Code &code) {
  std::lock_guard guard(impl->mutex);
  impl->reported.clear();
  std::string name = code.entry + "." + std::to_string(impl->count++);
  orc::JITDylib &library = impl->session.createBareJITDylib(name);
  library.addToLinkOrder(impl->runtime);
  library.addToLinkOrder(impl->device);
  auto fail = [&](llvm::Error error) {
    Error thrown = toError(std::move(error));
    thrown.message += impl->reported;
    llvm::consumeError(impl->session.removeJITDylib(library));
    return thrown;
  };
  auto object = MemoryBuffer::getMemBufferCopy(
      StringRef(code.binary.data(), code.binary.size()), name);
  if (llvm::Error error = impl->layer.add(library, std::move(object)))
    throw fail(std::move(error));
  auto symbol = impl->session.lookup(
      orc::JITDylibSearchOrder{
          {&library, orc::JITDylibLookupFlags::MatchExportedSymbolsOnly}},
      impl->session.intern(code.entry));
  if (!symbol)
    throw fail(symbol.takeError());
  void *address = symbol->getAddress().toPtr<void *>();
  impl->loaded[address] = &library;
  return address;
}

void warp::Jit::unload(void *entry) {
  std::lock_guard guard(impl->mutex);
  auto found = impl->loaded.find(entry);
  if (found == impl->loaded.end())
    return;
  llvm::consumeError(impl->session.removeJITDylib(*found->second));
  impl->loaded.erase(found);
}
