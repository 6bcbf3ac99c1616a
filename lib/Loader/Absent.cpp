//===- Absent.cpp - Refusals of a library without a compiler --------------===//
//
// Part of Warp on MLIR, under the Apache License v2.0.
//
// The runtime compiles a kernel with source when a launch needs a variant that
// it does not have. In libwarp_runtime.so no kernel has source, but for a few
// of the runtime's own: copies of strided arrays and exact sums on GPUs.
//
//===----------------------------------------------------------------------===//

#include "Compiler/Abandon.h"
#include "Compiler/Apart.h"
#include "Runtime/ExactSums.h"

#include "warp/Builder.h"
#include "warp/Compile.h"
#include "warp/Error.h"
#include "warp/FirstCode.h"
#include "warp/Fusion.h"
#include "warp/Regions.h"
#include "warp/Translation.h"

using namespace warp;

[[noreturn]] static void refuse() {
  throw Error(Error::Kind::Compile,
              "this launch or copy needs code that was not saved, and "
              "libwarp_runtime.so has no compiler; link libwarp.so in its "
              "place");
}

Module Module::fromText(std::string_view) { refuse(); }
std::string Module::text(bool) const { refuse(); }
Module warp::fuseKernels(const std::string &, const std::vector<FusionPart> &,
                         int64_t) {
  refuse();
}
Code warp::compile(const Module &, const CompileOptions &) { refuse(); }
FirstCode warp::compileFirst(const Module &, const CompileOptions &, int64_t) {
  refuse();
}
CompileOptions warp::quickOptions(CompileOptions wanted) { return wanted; }
bool warp::isQuickEnough(const Code &, int64_t) { return true; }
Decisions warp::schedule(const Module &, const CompileOptions &) { refuse(); }
std::string warp::emitText(const Module &, const CompileOptions &,
                           const std::string &) {
  refuse();
}
std::vector<Param> warp::parameters(const Module &) { refuse(); }
std::vector<Access> warp::accesses(const Module &) { refuse(); }
std::vector<IdFlow> warp::idFlows(const Module &) { refuse(); }
RegionFormula warp::regionFormula(const Module &) { refuse(); }
int warp::threadRank(const Module &) { refuse(); }
SourceHashes warp::sourceHashes(const Module &, std::string *) { refuse(); }
std::string warp::fingerprint(const SourceHashes &, const CompileOptions &) {
  refuse();
}
Kernel &warp::roundingKernel(int) { refuse(); }

// Nothing is compiled, so nothing is abandoned, or done apart.
Abandonable::Abandonable(const std::atomic<bool> &) {}
Abandonable::~Abandonable() = default;
bool warp::isAbandoned() { return false; }
namespace warp {
class OwnContext {};
} // namespace warp
Apart::Apart() = default;
Apart::~Apart() = default;
