//===- Emit.cpp - The compiler's door -------------------------------------===//
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

/// All that passes found out on the way to LLVM IR.
static warp::Code describe(warp::Compilation &run) {
  warp::Code code;
  code.entry = run.entry;
  code.sites = std::move(run.sites);
  code.cost = run.cost;
  code.usesPrintf = run.usesPrintf;
  code.exclusive = run.exclusive;
  code.atomics = run.atomics;
  code.isLong = run.isLong;
  code.isExact = run.hasExactFloats();
  code.copied = std::move(run.copied);
  code.coarsening = run.coarsening;
  code.singleBlock = run.singleBlock;
  code.fixedBlock = run.fixedBlock;
  code.cooperative = run.cooperative;
  code.ragged = run.ragged;
  code.dynamicBytes = run.dynamicBytes;
  code.tensorMaps = std::move(run.tensorMaps);
  code.rowCoarsening = run.rowCoarsening;
  code.transposeTile = run.transposeTile;
  code.splitReduction = run.splitReduction;
  code.blockCoarsening = run.blockCoarsening;
  code.reverseOrder = run.reverseOrder;
  code.sizeFacts = run.sizeFacts;
  code.sums = std::move(run.sums);
  return code;
}

/// From LLVM IR to bytes.
static warp::Code finish(warp::Compilation &run, warp::Code code) {
  run.optimizeModule();
  llvm::SmallVector<char, 0> bytes = run.emitCode(/*asText=*/false);
  code.binary.assign(bytes.begin(), bytes.end());
  code.phaseMs = std::move(run.phaseMs);
  return code;
}

warp::Code warp::compile(const Module &module, const CompileOptions &options) {
  Compilation run(module, options);
  run.lowerTo(Phase::LLVM);
  run.translate();
  return finish(run, describe(run));
}

/// Operations of the largest launch that begins with quickly compiled code: it
/// is over before better code would be there.
static constexpr double mostQuickWork = 4e6;

bool warp::isQuickEnough(const Code &code, int64_t items) {
  if (!code.isExact)
    return false;
  if (code.isLong && !code.exclusive && items != anyItems)
    return true;
  return std::max(code.cost, 1.0) * static_cast<double>(items) <= mostQuickWork;
}

warp::CompileOptions warp::quickOptions(CompileOptions wanted) {
  if (isGpu(wanted))
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
  Code code = describe(run);
  bool isQuick =
      isGpu(options) ? run.callsAssembled() : isQuickEnough(code, items);
  if (isQuick)
    run.compileQuickly();
  return {finish(run, std::move(code)), isQuick};
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
  if (stage == "ptx" && !isGpu(options))
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

/// What code depends on besides its module.
static std::string describe(const warp::CompileOptions &options) {
  std::string text = warp::toText(options);
  if (!warp::isGpu(options))
    text += warp::describeCpu(options);
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

warp::SourceHashes warp::sourceHashes(const Module &module, std::string *text) {
  std::string located = module.text(/*locations=*/true);
  SourceHashes hashes{hashOf(module.text()), hashOf(located)};
  if (text)
    *text = std::move(located);
  return hashes;
}

std::string warp::hostProcessor() { return describeCpu(CompileOptions()); }

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
