//===- array-origins-test.cpp - Underlying memory of array values ---------===//
//
// Part of Warp on MLIR, under the Apache License v2.0.
//
//===----------------------------------------------------------------------===//

#include "Analysis/ArrayOrigins.h"
#include "Compiler/Context.h"

#include "WarpDialect/WarpOps.h"

#include "mlir/Dialect/Func/IR/FuncOps.h"
#include "mlir/Parser/Parser.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

using namespace mlir;
using testing::ElementsAre;
using testing::IsEmpty;
using warp::ArrayMemory;

/// Arrays: x is leaf 0; s.y is 1, s.in.z is 2; w is 3.
static const char *const text = R"(
!a = !warp.array<2 x f32>
!inner = !warp.struct<"I", {z: !a}>
!s = !warp.struct<"S", {n: f32, y: !a, in: !inner}>
module {
  func.func private @pick(%p: !a, %q: !a) -> !a {
    return %q : !a
  }
  func.func private @use(%u: !a, %i: si32) {
    %v = warp.load %u[%i, %i] : !a, si32, si32 -> f32
    return
  }
  func.func private @outside(!a) -> !a
  func.func @k(%x: !a, %s: !s, %w: !a, %c: i1, %i: si32)
      attributes {warp.kernel} {
    %row = warp.view %x[%i] : !a, si32 -> !warp.array<1 x f32>
    %0 = warp.load %row[%i] : !warp.array<1 x f32>, si32 -> f32
    %y = warp.struct_get %s["y"] : !s -> !a
    warp.store %0, %y[%i, %i] : f32, !a, si32, si32
    %in = warp.struct_get %s["in"] : !s -> !inner
    %z = warp.struct_get %in["z"] : !inner -> !a
    %old = warp.atomic add %0, %z[%i, %i] : f32, !a, si32, si32 -> f32
    %g = warp.grad %w : !a -> !a
    warp.accumulate %0, %g[%i, %i] : f32, !a, si32, si32
    %e = arith.select %c, %x, %w : !a
    %1 = warp.load %e[%i, %i] : !a, si32, si32 -> f32
    %c0 = arith.constant 0 : index
    %c1 = arith.constant 1 : index
    %c8 = arith.constant 8 : index
    %f = scf.for %k = %c0 to %c8 step %c1 iter_args(%m = %z) -> (!a) {
      %2 = warp.load %m[%i, %i] : !a, si32, si32 -> f32
      scf.yield %y : !a
    }
    %t = warp.struct_set %w, %s["y"] : !a, !s
    %ty = warp.struct_get %t["y"] : !s -> !a
    %3 = warp.load %ty[%i, %i] : !a, si32, si32 -> f32
    %r = func.call @pick(%x, %w) : (!a, !a) -> !a
    %4 = warp.load %r[%i, %i] : !a, si32, si32 -> f32
    func.call @use(%y, %i) : (!a, si32) -> ()
    %o = func.call @outside(%x) : (!a) -> !a
    %5 = warp.load %o[%i, %i] : !a, si32, si32 -> f32
    return
  }
})";

namespace {

struct ArrayOriginsTest : testing::Test {
  ArrayOriginsTest() {
    module = parseSourceString<ModuleOp>(text, &warp::compilerContext());
    module->walk([&](warp::AccessOp op) { arrays.push_back(op.getArray()); });
    kernel = module->lookupSymbol<func::FuncOp>("k");
  }
  ~ArrayOriginsTest() { module = nullptr; }

  warp::ArrayOrigin of(unsigned access) {
    return warp::ArrayOrigins(kernel).of(arrays[access]);
  }

  warp::ContextLock lock;
  OwningOpRef<ModuleOp> module;
  func::FuncOp kernel;
  /// The origins of all accesses, in the order of the text; the first is that
  /// of @use.
  SmallVector<Value> arrays;
};

} // namespace

namespace warp {
static void PrintTo(const ArrayMemory &memory, std::ostream *stream) {
  *stream << memory.leaf << (memory.isGradient ? "'" : "");
}
} // namespace warp

TEST_F(ArrayOriginsTest, ViewsAndFieldsLeadToLeaves) {
  EXPECT_THAT(of(1).memories, ElementsAre(ArrayMemory{0, false}));
  EXPECT_THAT(of(2).memories, ElementsAre(ArrayMemory{1, false}));
  EXPECT_THAT(of(3).memories, ElementsAre(ArrayMemory{2, false}));
  EXPECT_THAT(of(4).memories, ElementsAre(ArrayMemory{3, true}));
  EXPECT_EQ(warp::gradientOwner(arrays[4]), kernel.getArgument(2));
  EXPECT_FALSE(warp::gradientOwner(arrays[1]));
}

TEST_F(ArrayOriginsTest, ChoicesAndLoopsGiveAllThatMayBe) {
  EXPECT_THAT(of(5).memories,
              ElementsAre(ArrayMemory{0, false}, ArrayMemory{3, false}));
  EXPECT_THAT(of(6).memories,
              ElementsAre(ArrayMemory{1, false}, ArrayMemory{2, false}));
  EXPECT_TRUE(of(6).isComplete);
}

TEST_F(ArrayOriginsTest, StructsAndCallsAreFollowed) {
  EXPECT_THAT(of(7).memories, ElementsAre(ArrayMemory{3, false}));
  EXPECT_THAT(of(8).memories, ElementsAre(ArrayMemory{3, false}));
  EXPECT_THAT(of(0).memories, ElementsAre(ArrayMemory{1, false}));
}

TEST_F(ArrayOriginsTest, WhatComesFromOutsideIsNotKnown) {
  EXPECT_FALSE(of(9).isComplete);
  warp::ArrayOrigins origins(kernel, /*disjoint=*/true);
  EXPECT_TRUE(origins.mayAlias(arrays[9], arrays[2]));
}

TEST_F(ArrayOriginsTest, LeavesAloneDoNotGuess) {
  warp::ArrayLeaves leaves(kernel);
  EXPECT_EQ(leaves.size(), 4u);
  EXPECT_THAT(leaves.of(arrays[3]), ElementsAre(2));
  EXPECT_THAT(leaves.of(arrays[5]), IsEmpty());
  EXPECT_THAT(leaves.of(arrays[4]), IsEmpty());
  EXPECT_EQ(leaves.getName(2), "argument 1.in.z");
}

TEST_F(ArrayOriginsTest, OnlyDisjointArraysAreApart) {
  warp::ArrayOrigins any(kernel), apart(kernel, /*disjoint=*/true);
  EXPECT_TRUE(any.mayAlias(arrays[1], arrays[2]));
  EXPECT_FALSE(apart.mayAlias(arrays[1], arrays[2]));
  // Elements of w and gradients of w; x or w; a view and its array.
  EXPECT_FALSE(apart.mayAlias(arrays[4], kernel.getArgument(2)));
  EXPECT_TRUE(apart.mayAlias(arrays[5], kernel.getArgument(2)));
  EXPECT_TRUE(apart.mayAlias(arrays[1], kernel.getArgument(0)));
}
