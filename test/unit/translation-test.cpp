//===- translation-test.cpp - Kernels made from their translation ---------===//
//
// Part of Warp on MLIR, under the Apache License v2.0.
//
//===----------------------------------------------------------------------===//

#include "warp/Array.h"
#include "warp/Kernel.h"
#include "warp/Translation.h"

#include <gtest/gtest.h>
#include <string>
#include <vector>

using namespace warp;

namespace {

const char *const text = R"mlir(
module @scale {
  func.func @scale(%x: !warp.array<1 x f32>, %s: f32)
      attributes {warp.arg_names = ["x", "s"], warp.kernel} {
    %i = warp.tid : si32
    %v = warp.load %x[%i] : !warp.array<1 x f32>, si32 -> f32
    %p = warp.mul(%v, %s) : (f32, f32) -> f32
    warp.store %p, %x[%i] : f32, !warp.array<1 x f32>, si32
    return
  }
}
)mlir";

Translation sample() {
  Kernel kernel(Module::fromText(text), "scale");
  Translation made = kernel.translation();
  made.notes = std::string("no\0tes", 6);
  return made;
}

const std::string name(64, 'a');

} // namespace

// Whatever looks like a location in a string is none.
TEST(Translation, HashIsOfTheTextWithoutLocations) {
  const char *const printing = R"mlir(
#first = loc("a \"b\" (c.py":3:4)
module @print {
  func.func @print(%x: f32 loc("y.py":1:2)) attributes {warp.kernel} {
    warp.printf "%f loc(#loc1) \"\n#loc = loc(unknown)"(%x) : f32 loc(#first)
    %c = warp.constant 1 : si32 loc(callsite("f"("g.py":1:1) at #first))
    return loc(fused["h.py":2:2, #first])
  } loc("k":5:6)
}
)mlir";
  for (const char *source : {text, printing}) {
    Module module = Module::fromText(source);
    EXPECT_EQ(sourceHashes(module).plain, sourceHash(module));
    EXPECT_NE(sourceHashes(module).located, sourceHash(module));
  }
}

// A location of two operations is written once, and each operation has its own.
TEST(Translation, TextNamesEachLocationOnce) {
  const char *const twice = R"mlir(
module {
  func.func @k() attributes {warp.kernel} {
    %a = warp.constant 1 : si32 loc("k.py":7:3)
    %b = warp.constant 2 : si32 loc("k.py":7:3)
    return loc("k.py":8:3)
  }
}
)mlir";
  std::string located = Module::fromText(twice).text(/*locations=*/true);
  size_t first = located.find("\"k.py\":7:3");
  EXPECT_NE(first, std::string::npos);
  EXPECT_EQ(located.find("\"k.py\":7:3", first + 1), std::string::npos);
  Module read = Module::fromText(located);
  EXPECT_EQ(read.text(/*locations=*/true), located);
  EXPECT_EQ(read.text(), Module::fromText(twice).text());
}

TEST(Translation, IsReadAsItWasWritten) {
  Translation made = sample();
  std::optional<Translation> read =
      deserializeTranslation(name, serialize(name, made));
  ASSERT_TRUE(read);
  EXPECT_EQ(read->hashes.plain, made.hashes.plain);
  EXPECT_EQ(read->hashes.located, made.hashes.located);
  EXPECT_EQ(read->text, made.text);
  EXPECT_EQ(read->notes, made.notes);
  EXPECT_EQ(read->rank, 1);
  ASSERT_EQ(read->params.size(), 2u);
  EXPECT_EQ(read->params[0].name, "x");
  EXPECT_EQ(read->params[1].offset, made.params[1].offset);
  ASSERT_EQ(read->accesses.size(), 1u);
  EXPECT_TRUE(read->accesses[0].loaded);
  EXPECT_TRUE(read->accesses[0].stored);
}

TEST(Translation, DamageIsSeen) {
  std::string bytes = serialize(name, sample());
  EXPECT_FALSE(deserializeTranslation(std::string(64, 'b'), bytes));
  EXPECT_FALSE(deserializeTranslation(name, ""));
  for (size_t place = 0; place < bytes.size(); place += 37) {
    std::string damaged = bytes;
    damaged[place] ^= 0x55;
    EXPECT_FALSE(deserializeTranslation(name, damaged)) << place;
    EXPECT_FALSE(deserializeTranslation(name, bytes.substr(0, place)));
  }
}

TEST(Translation, KernelHasTheSameModule) {
  Translation made = sample();
  Kernel kernel(made, "scale");
  EXPECT_EQ(kernel.parameters().size(), 2u);
  EXPECT_EQ(fingerprint(made.hashes, {}), fingerprint(kernel.module(), {}));
  EXPECT_EQ(kernel.translation().text, made.text);
  SourceHashes again = sourceHashes(kernel.module());
  EXPECT_EQ(again.plain, made.hashes.plain);
  EXPECT_EQ(again.located, made.hashes.located);
}

TEST(Translation, NameOfCodeDependsOnLocationsInDebugModeOnly) {
  Translation made = sample();
  SourceHashes moved = made.hashes;
  moved.located = std::string(64, '0');
  CompileOptions options;
  EXPECT_EQ(fingerprint(made.hashes, options), fingerprint(moved, options));
  options.debug = true;
  EXPECT_NE(fingerprint(made.hashes, options), fingerprint(moved, options));
}
