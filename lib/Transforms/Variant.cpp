//===- Variant.cpp - The options of a compilation -------------------------===//
//
// Part of Warp on MLIR, under the Apache License v2.0.
//
//===----------------------------------------------------------------------===//

#include "Variant.h"

#include "Choices.h"
#include "Updates/Atomics.h"
#include "WarpDialect/Passes.h"

#include "llvm/Support/raw_ostream.h"
#include "llvm/TargetParser/Host.h"
#include "llvm/TargetParser/X86TargetParser.h"

using namespace mlir;
using warp::CompileOptions;

//===----------------------------------------------------------------------===//
// Text
//===----------------------------------------------------------------------===//

/// Calls `visit` with the name of each option and its member.
template <typename Options, typename Visitor>
static void visitOptions(Options &options, Visitor visit) {
  visit("target", options.target);
  visit("rank", options.rank);
  visit("contiguous", options.contiguous);
  visit("index32", options.index32);
  visit("flat", options.flat);
  visit("large", options.large);
  visit("underfilled", options.underfilled);
  visit("skinny", options.skinny);
  visit("max-block-coarsening", options.maxBlockCoarsening);
  visit("disjoint", options.disjoint);
  visit("debug", options.debug);
  visit("fast-math", options.fastMath);
  visit("deterministic", options.deterministic);
  visit("ordered", options.ordered);
  visit("thread-order", options.threadOrder);
  visit("lineinfo", options.lineinfo);
  visit("opt-level", options.optLevel);
  visit("block-dim", options.blockDim);
  visit("threads", options.threads);
  visit("driver-version", options.driverVersion);
  visit("max-registers", options.maxRegisters);
  visit("min-blocks", options.minBlocks);
  visit("lanes", options.lanes);
  visit("inner-extent", options.innerExtent);
  visit("linked", options.linked);
}

static bool parse(StringRef text, std::string &value) {
  value = text.str();
  return !text.empty();
}

static bool parse(StringRef text, bool &value) {
  value = text.empty() || text == "1" || text == "true";
  return value || text == "0" || text == "false";
}

template <typename Integer> static bool parse(StringRef text, Integer &value) {
  return !text.getAsInteger(0, value);
}

bool warp::setOption(CompileOptions &options, StringRef key, StringRef value) {
  bool isSet = false;
  visitOptions(options, [&](StringRef name, auto &member) {
    if (name == key)
      isSet = parse(value, member);
  });
  return isSet;
}

LogicalResult
warp::parseOptions(StringRef text,
                   function_ref<LogicalResult(StringRef, StringRef)> set) {
  while (!text.empty()) {
    size_t end = std::min(text.find_first_of(", "), text.size());
    auto [key, value] = text.take_front(end).split('=');
    text = text.drop_front(std::min(end + 1, text.size()));
    if (!key.empty() && failed(set(key, value)))
      return failure();
  }
  return success();
}

std::string warp::toText(const CompileOptions &options) {
  std::string text;
  llvm::raw_string_ostream stream(text);
  visitOptions(options, [&](StringRef name, const auto &member) {
    stream << name << '=' << member << ' ';
  });
  return text;
}

//===----------------------------------------------------------------------===//
// The attribute
//===----------------------------------------------------------------------===//

/// Vectors of 512 bits lower the clock before Ice Lake and Zen 4, but still pay
/// there: 1.16x in the mean of 35 kernels on Cascade Lake.
static int64_t chooseVectorBits(function_ref<bool(StringRef)> has) {
  if (has("avx512bw") && has("avx512dq") && has("avx512vl"))
    return 512;
  return has("avx2") && has("fma") ? 256 : 128;
}

static int64_t getHostBits() {
  static const int64_t bits = [] {
    llvm::StringMap<bool> found = llvm::sys::getHostCPUFeatures();
    return chooseVectorBits([&](StringRef name) { return found.lookup(name); });
  }();
  return bits;
}

int64_t warp::getVectorBits(StringRef target) {
  if (!target.consume_front("cpu:"))
    return getHostBits();
  SmallVector<StringRef> features;
  if (llvm::X86::parseArchX86(target) != llvm::X86::CK_None)
    llvm::X86::getFeaturesForCPU(target, features);
  return chooseVectorBits(
      [&](StringRef name) { return llvm::is_contained(features, name); });
}

/// The target of a name; null if there is none.
static warp::TargetAttr getTarget(MLIRContext *context, StringRef name) {
  using warp::Platform;
  unsigned version;
  StringRef rest = name;
  if (name == "cpu" || rest.consume_front("cpu:"))
    return warp::TargetAttr::get(context, Platform::cpu, 0,
                                 name == "cpu" ? "" : rest,
                                 warp::getVectorBits(name));
  // With an `a`, code may use what no other architecture has.
  if (rest.consume_front("sm_")) {
    StringRef own = rest.consume_back("a") ? name : "";
    if (!rest.getAsInteger(10, version) && version)
      return warp::TargetAttr::get(context, Platform::cuda, version, own, 0);
  }
  return {};
}

warp::VariantAttr
warp::getVariant(MLIRContext *context, const CompileOptions &options,
                 function_ref<InFlightDiagnostic()> emitError) {
  TargetAttr target = getTarget(context, options.target);
  if (!target) {
    emitError() << "expects the target 'cpu' or 'sm_<number>', but got '"
                << options.target << "'";
    return {};
  }
  auto deterministic = !options.deterministic ? Determinism::none
                       : options.ordered      ? Determinism::ordered
                                              : Determinism::exact;
  return VariantAttr::getChecked(
      emitError, context, target, int64_t(options.rank), options.contiguous,
      options.index32, options.flat, options.large, options.underfilled,
      options.skinny, int64_t(options.maxBlockCoarsening), options.disjoint,
      int64_t(options.blockDim), int64_t(options.threads),
      int64_t(options.minBlocks), int64_t(options.lanes),
      int64_t(options.innerExtent), options.debug, options.fastMath,
      deterministic);
}

bool warp::setVariant(FunctionOpInterface kernel,
                      const CompileOptions &options) {
  VariantAttr variant = getVariant(kernel->getContext(), options,
                                   [&] { return kernel.emitError(); });
  if (!variant)
    return false;
  kernel->setAttr(attr::variant, variant);
  if (options.threadOrder && !variant.isGpu())
    kernel->setAttr(attr::inTurn, UnitAttr::get(kernel->getContext()));
  else
    kernel->removeAttr(attr::inTurn);
  return true;
}
