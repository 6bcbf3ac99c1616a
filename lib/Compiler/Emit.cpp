//===- Emit.cpp - Entry points of the compiler ----------------------------===//
//
// Part of Warp on MLIR, under the Apache License v2.0.
//
//===----------------------------------------------------------------------===//

#include "Compilation.h"

#include "Transforms/Variant.h"

#include "warp/FirstCode.h"
#include "warp/Translation.h"
#include "warp/Version.h"

#include "WarpDialect/Passes.h"
#include "WarpDialect/WarpDialect.h"
#include "WarpDialect/WarpTypes.h"

#include "mlir/Dialect/Func/IR/FuncOps.h"

#include "llvm/ADT/StringExtras.h"
#include "llvm/Support/BLAKE3.h"
#include "llvm/Support/MathExtras.h"
#include "llvm/Support/raw_ostream.h"

#include "llvm/IR/Module.h"

#include <algorithm>

using namespace mlir;

/// From LLVM IR to bytes.
static warp::Code finish(warp::Compilation &run) {
  run.optimizeModule();
  llvm::SmallVector<char, 0> bytes = run.emitCode(/*asText=*/false);
  run.code.binary.assign(bytes.begin(), bytes.end());
  return std::move(run.code);
}

warp::Code warp::compile(const Module &module, const CompileOptions &options) {
  Compilation run(module, options);
  run.lowerTo(Phase::LLVM);
  run.translate();
  return finish(run);
}

/// Operations of the largest launch that begins with quickly compiled code: it
/// is over before tier-1 code would be there.
static constexpr double mostQuickWork = 4e6;

bool warp::isQuickEnough(const Code &code, int64_t items) {
  const Schedule &schedule = code.schedule;
  if (!schedule.isExact)
    return false;
  if (schedule.isLong && !schedule.exclusive && items != anyItems)
    return true;
  return std::max(schedule.cost, 1.0) * static_cast<double>(items) <= mostQuickWork;
}

warp::CompileOptions warp::quickOptions(CompileOptions wanted) {
  if (getTarget(wanted).isSimt())
    wanted.linked = true;
  else
    wanted.optLevel = quickLevel;
  return wanted;
}

warp::FirstCode warp::compileFirst(const Module &module,
                                   const CompileOptions &options,
                                   int64_t items) {
  Compilation run(module, options);
  run.lowerTo(Phase::LLVM);
  run.translate();
  bool isQuick =
      getTarget(options).isSimt() ? run.callsAssembled()
                                  : isQuickEnough(run.code, items);
  if (isQuick)
    run.compileQuickly();
  return {finish(run), isQuick};
}

std::string warp::emitText(const Module &module, const CompileOptions &options,
                           const std::string &stage) {
  Compilation run(module, options);
  if (std::optional<Phase> phase = parsePhase(stage);
      phase && *phase != Phase::LLVM) {
    run.lowerTo(*phase);
    return run.moduleText();
  }
  if (stage != "llvm" && stage != "ptx" && stage != "asm")
    throw Error(
        Error::Kind::Value,
        "no stage '" + stage +
            "'; there are warp, thread, launch, gpu, llvm, ptx and asm");
  if (stage == "ptx" && !getTarget(options).isSimt())
    throw Error(Error::Kind::Value,
                "stage 'ptx' needs a GPU target, but the target is '" +
                    options.target + "'");
  run.lowerTo(Phase::LLVM);
  run.translate();
  run.optimizeModule();
  if (stage == "llvm")
    return run.llvmText();
  llvm::SmallVector<char, 0> bytes = run.emitCode(/*asText=*/true);
  return std::string(bytes.begin(), bytes.end());
}

/// The text of all that code depends on besides its module.
static std::string describe(const warp::CompileOptions &options) {
  std::string text = warp::toText(options);
  text += warp::getTarget(options).describeProcessor();
  return text + "\n";
}

static std::string hashOf(const std::string &text) {
  llvm::BLAKE3 hash;
  hash.update(text);
  return llvm::toHex(hash.final<32>(), /*LowerCase=*/true);
}

std::string warp::sourceHash(const Module &module) {
  return hashOf(module.text());
}

/// The text of a module as it is printed without locations, which takes as long
/// again as to print it with them.
static std::string withoutLocations(StringRef text) {
  return warp::replaceLocations(text, [](StringRef, std::string &) {});
}

warp::SourceHashes warp::sourceHashes(const Module &module, std::string *text) {
  std::string located = module.text(/*locations=*/true);
  SourceHashes hashes{hashOf(withoutLocations(located)), hashOf(located)};
  if (text)
    *text = std::move(located);
  return hashes;
}

std::string warp::hostProcessor() {
  return getTarget(CompileOptions()).describeProcessor();
}

std::string warp::fingerprint(const SourceHashes &hashes,
                              const CompileOptions &options) {
  bool located = options.debug || options.lineinfo;
  return hashOf(buildId() + describe(options) +
                (located ? hashes.located : hashes.plain));
}

std::string warp::fingerprint(const Module &module,
                              const CompileOptions &options) {
  return fingerprint(sourceHashes(module), options);
}
