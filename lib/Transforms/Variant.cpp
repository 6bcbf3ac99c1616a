//===- Variant.cpp - The options of a compilation -------------------------===//
//
// Part of Warp on MLIR, under the Apache License v2.0.
//
//===----------------------------------------------------------------------===//

#include "Variant.h"

#include "WarpDialect/Passes.h"

#include "llvm/Support/raw_ostream.h"

#include <algorithm>

using namespace mlir;
using warp::CompileOptions;

//===----------------------------------------------------------------------===//
// Text
//===----------------------------------------------------------------------===//

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
  std::string name = key.str();
  std::replace(name.begin(), name.end(), '-', '_');
  bool isSet = false;
  CompileOptions::visit(options, [&](const FactInfo &fact, auto &member) {
    if (name == fact.name)
      isSet = parse(value, member);
  });
  return isSet;
}

std::string warp::describeBadOption(StringRef key, StringRef value) {
  std::string name = key.str(), known;
  std::replace(name.begin(), name.end(), '-', '_');
  bool isKnown = false;
  CompileOptions options;
  CompileOptions::visit(options, [&](const FactInfo &fact, auto &) {
    isKnown |= name == fact.name;
    known += (known.empty() ? "" : ", ") + std::string(fact.name);
  });
  if (isKnown)
    return ("option '" + key + "' has no value '" + value + "'").str();
  return ("no option '" + key + "', there are: " + known).str();
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
  CompileOptions::visit(options, [&](const FactInfo &fact, const auto &member) {
    stream << fact.name << '=' << member << ' ';
  });
  return text;
}

//===----------------------------------------------------------------------===//
// Attributes
//===----------------------------------------------------------------------===//

template <typename Number> static void assign(Number &member, Number value) {
  member = value;
}
static void assign(int &member, int64_t value) { member = int(value); }
static void assign(double &member, int64_t value) { member = double(value); }

static void assign(warp::CopiedArrays &copied, warp::CopiedAttr found) {
  if (!found)
    return;
  for (auto array : found.getArrays().getAsRange<warp::CopiedArrayAttr>())
    copied.list.push_back(
        {array.getDescriptor(), array.getGradient(), array.getElementSize(),
         array.getNumbers(), array.getWidth(), array.getFloating(),
         array.getIsUnsigned(), warp::CopyKind(array.getKind())});
  copied.plainTime = double(found.getPlainTime()) / 1e3;
  copied.atomicTime = double(found.getAtomicTime()) / 1e3;
}

static void assign(std::vector<warp::SummedArray> &sums, ArrayAttr found) {
  if (!found)
    return;
  for (auto array : found.getAsRange<warp::SummedArrayAttr>())
    sums.push_back({array.getWidth(), array.getDescriptor(),
                    array.getGradient(), array.getElementSize(),
                    array.getStrideScale()});
}

#define GET_LAUNCH_CONVERSIONS
#include "warp/LaunchContract.h.inc"

warp::Schedule warp::readSchedule(ScheduleAttr schedule) {
  return convert(schedule);
}

warp::VariantAttr
warp::getVariant(MLIRContext *context, const CompileOptions &options,
                 function_ref<InFlightDiagnostic()> emitError) {
  // An error names the target if there is none of that name.
  StringRef name = options.target;
  auto target =
      TargetAttr::getChecked(emitError, context, name, getVectorBits(name));
  if (!target)
    return {};
  return convert(target, options, emitError);
}

bool warp::setVariant(FunctionOpInterface kernel,
                      const CompileOptions &options) {
  VariantAttr variant = getVariant(kernel->getContext(), options,
                                   [&] { return kernel.emitError(); });
  if (!variant)
    return false;
  kernel->setAttr(attr::variant, variant);
  return true;
}
