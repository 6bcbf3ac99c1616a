//===- version-test.cpp - Version of the library --------------------------===//
//
// Part of Warp on MLIR, under the Apache License v2.0.
//
//===----------------------------------------------------------------------===//

#include "warp/Version.h"

#include <gtest/gtest.h>

namespace {

TEST(Version, StatesRelease) {
  EXPECT_STREQ(warp::version(), WARP_RELEASE);
}

// lld writes a SHA-1 build id: 20 bytes.
TEST(Version, ReadsBuildIdFromNotes) {
  EXPECT_EQ(warp::buildId().size(), 40u);
  EXPECT_EQ(warp::buildId().find_first_not_of("0123456789abcdef"),
            std::string::npos);
}

} // namespace
