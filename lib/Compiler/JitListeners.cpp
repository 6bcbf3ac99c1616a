//===- JitListeners.cpp - JIT listeners: profilers, debuggers -------------===//
//
// Part of Warp on MLIR, under the Apache License v2.0.
//
// The map of perf is text, a line per function: address and size in
// hexadecimal digits, name. Lines of code that has been unloaded stay, as perf
// takes the last one of an address.
//
//===----------------------------------------------------------------------===//

#include "JitListeners.h"

#include "llvm/ADT/StringExtras.h"
#include "llvm/ExecutionEngine/Orc/Debugging/ELFDebugObjectPlugin.h"

#include <cerrno>
#include <cstring>
#include <fcntl.h>
#include <string>
#include <unistd.h>

using namespace llvm;

namespace {
class PerfMap : public orc::LinkGraphLinkingLayer::Plugin {
public:
  void modifyPassConfig(orc::MaterializationResponsibility &,
                        jitlink::LinkGraph &,
                        jitlink::PassConfiguration &config) override {
    // Addresses are known from here on.
    config.PostFixupPasses.push_back(write);
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
  static llvm::Error write(jitlink::LinkGraph &graph) {
    std::string lines;
    for (jitlink::Symbol *symbol : graph.defined_symbols())
      if (symbol->isCallable() && symbol->hasName() && symbol->getSize())
        lines +=
            utohexstr(symbol->getAddress().getValue(), /*LowerCase=*/true) +
            " " + utohexstr(symbol->getSize(), /*LowerCase=*/true) + " " +
            (*symbol->getName()).str() + "\n";
    std::string path = "/tmp/perf-" + std::to_string(getpid()) + ".map";
    // In a folder that all may write to, a link may be somebody else's.
    int file =
        open(path.c_str(),
             O_WRONLY | O_CREAT | O_APPEND | O_NOFOLLOW | O_CLOEXEC, 0644);
    if (file < 0)
      return createStringError("cannot write '%s': %s", path.c_str(),
                               strerror(errno));
    ssize_t written = ::write(file, lines.data(), lines.size());
    close(file);
    if (written != ssize_t(lines.size()))
      return createStringError("cannot write '%s'", path.c_str());
    return llvm::Error::success();
  }
};
} // namespace

std::shared_ptr<orc::LinkGraphLinkingLayer::Plugin> warp::makePerfMap() {
  return std::make_shared<PerfMap>();
}

Expected<std::shared_ptr<orc::LinkGraphLinkingLayer::Plugin>>
warp::makeDebuggerListener(orc::ExecutionSession &session) {
  llvm::Error error = llvm::Error::success();
  auto plugin = std::make_shared<orc::ELFDebugObjectPlugin>(
      session, /*RequireDebugSections=*/false, /*AutoRegisterCode=*/true,
      error);
  if (error)
    return std::move(error);
  return plugin;
}
