//===- EmitMain.cpp - Text output of the library's emitters ---------------===//
//
// Part of Warp on MLIR, under the Apache License v2.0.
//
// Compiles as a user of the library does:
//
//   warp-opt in.mlir --warp-emit=STAGE [--warp-options=KEY[=VALUE],...]
//
// STAGE is warp, thread, launch, gpu, llvm, ptx, asm, times (milliseconds by
// phase), parameters, fingerprint, regions (what the kernel touches of its
// arrays), or adjoint or tangent: the derivative's warp IR, and as comments
// what goes with it.
//
//===----------------------------------------------------------------------===//

#include "EmitMain.h"

#include "warp/Autodiff.h"
#include "warp/Compile.h"
#include "warp/Regions.h"

#include "Transforms/Variant.h"

#include <fstream>
#include <iostream>
#include <iterator>

static bool consumePrefix(std::string &text, const std::string &prefix) {
  if (text.rfind(prefix, 0) != 0)
    return false;
  text.erase(0, prefix.size());
  return true;
}

static constexpr char derivationOptions[] =
    "; of derivatives: active, apart, singular, unique, width, tape, "
    "max-local-tape";

/// Sets one option of a derivative; `active` and `apart` are one digit per
/// array.
static bool setOption(warp::AutodiffOptions &options, const std::string &key,
                      const std::string &value) {
  if (key == "active")
    for (char digit : value)
      options.active.push_back(digit != '0');
  else if (key == "apart")
    for (char digit : value)
      options.apart.push_back(digit != '0');
  else if (key == "singular")
    options.singular = value;
  else if (key == "unique")
    options.unique = value != "0";
  else if (key == "width")
    options.width = std::atoi(value.c_str());
  else if (key == "tape")
    options.tape = value;
  else if (key == "max-local-tape")
    options.maxLocalTape = std::atoi(value.c_str());
  else
    return false;
  return true;
}

/// Compiles repeatedly and prints the best time of each phase.
static void printTimes(const warp::Module &module,
                       const warp::CompileOptions &options) {
  std::map<std::string, double> best;
  for (int i = 0; i < 20; ++i)
    for (auto &[phase, ms] : warp::compile(module, options).phaseMs) {
      auto found = best.try_emplace(phase, ms).first;
      found->second = std::min(found->second, ms);
    }
  double sum = 0;
  for (auto &[phase, ms] : best) {
    std::cout << phase << ' ' << ms << '\n';
    sum += ms;
  }
  std::cout << "sum " << sum << '\n';
}

static void printParameters(const warp::Module &module) {
  for (const warp::Param &param : warp::parameters(module)) {
    std::cout << param.name << ' ' << param.type << " offset " << param.offset
              << " size " << param.size;
    if (param.kind == warp::Param::Kind::Array)
      std::cout << " element " << param.element << " of " << param.elementSize;
    for (int64_t offset : param.arrays)
      std::cout << " array at " << offset;
    std::cout << '\n';
  }
}

static void printDerivative(const warp::Module &module,
                            const warp::AutodiffOptions &options) {
  warp::Derivative derivative = warp::differentiate(module, options);
  std::cout << derivative.module.text();
  if (derivative.augmented)
    std::cout << "// augmented\n" << derivative.augmented->text();
  if (derivative.counting)
    std::cout << "// counting\n" << derivative.counting->text();
  if (derivative.sizing)
    std::cout << "// sizing\n" << derivative.sizing->text();
  if (derivative.recording)
    std::cout << "// recording\n" << derivative.recording->text();
  for (const warp::HiddenArgument &hidden : derivative.hidden)
    std::cout << "// hidden "
              << stringifyHiddenKind(warp::HiddenKind(hidden.kind)).str()
              << " of array " << hidden.leaf << ", " << hidden.type << '\n';
  for (int leaf : derivative.needed)
    std::cout << "// needs array " << leaf << '\n';
  if (!derivative.oneThread.empty())
    std::cout << "// one thread: " << derivative.oneThread << '\n';
  for (const std::string &line : derivative.notices)
    std::cout << "// notice " << line << '\n';
  for (auto &[name, number] : derivative.metrics)
    std::cout << "// " << name << ' ' << number << '\n';
}

static int emitStage(const std::string &input, const std::string &stage,
                     const warp::CompileOptions &options,
                     warp::AutodiffOptions &derivation) {
  std::ifstream file;
  if (input != "-") {
    file.open(input);
    if (!file) {
      std::cerr << "warp-opt: cannot open '" << input << "'\n";
      return 1;
    }
  }
  std::istream &stream = input == "-" ? std::cin : file;
  std::string text{std::istreambuf_iterator<char>(stream), {}};
  try {
    warp::Module module = warp::Module::fromText(text);
    if (stage == "times")
      printTimes(module, options);
    else if (stage == "parameters")
      printParameters(module);
    else if (stage == "fingerprint")
      std::cout << warp::fingerprint(module, options) << '\n';
    else if (stage == "regions")
      std::cout << warp::regionText(module);
    else if (stage == "adjoint" || stage == "tangent") {
      derivation.forward = stage == "tangent";
      printDerivative(module, derivation);
    } else
      std::cout << warp::emitText(module, options, stage);
  } catch (const warp::Error &error) {
    if (error.file.empty())
      std::cerr << "warp-opt: ";
    else
      std::cerr << error.file << ':' << error.line << ':' << error.column
                << ": ";
    std::cerr << "error: " << error.what() << '\n';
    return 1;
  }
  return 0;
}

std::optional<int> emitMain(int argc, char **argv) {
  std::string stage, input = "-";
  warp::CompileOptions options;
  warp::AutodiffOptions derivation;
  for (int i = 1; i < argc; ++i) {
    std::string argument = argv[i];
    if (consumePrefix(argument, "--warp-emit="))
      stage = argument;
    else if (argument == "-" || argument[0] != '-')
      input = argument; // Other options, as --verify-roundtrip, have no say.
  }
  if (stage.empty())
    return std::nullopt;
  for (int i = 1; i < argc; ++i) {
    std::string argument = argv[i];
    if (!consumePrefix(argument, "--warp-options="))
      continue;
    auto set = [&](llvm::StringRef key, llvm::StringRef value) {
      bool isSet = warp::setOption(options, key, value) ||
                   setOption(derivation, key.str(), value.str());
      if (!isSet) {
        std::string problem = warp::describeBadOption(key, value);
        bool isUnknown = problem.rfind("no ", 0) == 0;
        std::cerr << "warp-opt: " << problem
                  << (isUnknown ? derivationOptions : "") << '\n';
      }
      return llvm::success(isSet);
    };
    if (llvm::failed(warp::parseOptions(argument, set)))
      return 1;
  }
  return emitStage(input, stage, options, derivation);
}
