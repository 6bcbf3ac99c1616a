//===- tile-models-test.cpp - Each tile operation has a model -------------===//
//
// Part of Warp on MLIR, under the Apache License v2.0.
//
//===----------------------------------------------------------------------===//

#include "Compiler/Context.h"

#include "WarpDialect/TileOps.h"
#include "WarpDialect/WarpDialect.h"

#include <gtest/gtest.h>

using namespace mlir;

namespace {

/// Passes ask TileOpInterface: an operation without a model would stop them.
TEST(TileModels, ModelsEveryOperation) {
  auto *dialect = warp::compilerContext().getLoadedDialect<warp::WarpDialect>();
  int count = 0;
  for (RegisteredOperationName name :
       warp::compilerContext().getRegisteredOperationsByDialect(
           dialect->getNamespace())) {
    bool isTileOp = name.stripDialect().starts_with("tile_") &&
                    name.stripDialect() != "tile_yield";
    EXPECT_EQ(name.hasInterface<warp::TileOpInterface>(), isTileOp)
        << name.getStringRef().str();
    count += isTileOp;
  }
  EXPECT_GT(count, 25);
}

/// Accesses of arrays are tile operations, too.
TEST(TileModels, ModelsEveryAccess) {
  for (RegisteredOperationName name :
       warp::compilerContext().getRegisteredOperationsByDialect("warp"))
    if (name.hasInterface<warp::TileAccessOp>())
      EXPECT_TRUE(name.hasInterface<warp::TileOpInterface>())
          << name.getStringRef().str();
}

} // namespace
