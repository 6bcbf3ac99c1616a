//===- builder-test.cpp - The kernel builder from C++ ---------------------===//
//
// Part of Warp on MLIR, under the Apache License v2.0.
//
//===----------------------------------------------------------------------===//

#include "warp/Builder.h"

#include "gtest/gtest.h"

using namespace warp;

namespace {

struct BuilderTest : testing::Test {
  Type f32 = Type::parse("f32"), i32 = Type::parse("si32");
  Type array = Type::parse("!warp.array<1 x f32>");
  Builder builder{"module"};

  /// The kind of the error that a call throws.
  template <typename Call> Error::Kind kindOf(Call call) {
    try {
      call();
    } catch (const Error &error) {
      return error.kind;
    }
    ADD_FAILURE() << "no error";
    return Error::Kind::Runtime;
  }
};

// A kernel built by hand is the text that one would write.
TEST_F(BuilderTest, saxpy) {
  Builder::Values args =
      builder.beginFunction("saxpy", {"a", "x"}, {f32, array}, true);
  Value i = builder.tid(1)[0];
  Value product =
      builder.builtin("mul", {args[0], builder.load(args[1], {i})}).values[0];
  builder.store(args[1], {i}, product);
  builder.endFunction({});
  Module module = builder.finish();
  EXPECT_EQ(module.kernelName(), "saxpy");
  std::string text = module.text();
  EXPECT_NE(text.find("warp.mul(%arg0, %1) : (f32, f32) -> f32"),
            std::string::npos)
      << text;
  EXPECT_EQ(Module::fromText(text).text(), text);
}

// Every misuse is an error of its kind at the place that was set.
TEST_F(BuilderTest, errorsCarryKindAndPlace) {
  Builder::Values args =
      builder.beginFunction("kernel", {"x", "n"}, {array, i32}, true);
  builder.setLocation("user.py", 12, 5);
  Value one = builder.constant(f32, 1.0);
  EXPECT_EQ(kindOf([&] { builder.builtin("add", {args[1], one}); }),
            Error::Kind::Type);
  EXPECT_EQ(kindOf([&] { builder.builtin("no_such", {one}); }),
            Error::Kind::Key);
  EXPECT_EQ(kindOf([&] { builder.load(args[0], {}); }), Error::Kind::Index);
  EXPECT_EQ(kindOf([&] { builder.constant(i32, int64_t(1) << 31); }),
            Error::Kind::Overflow);
  EXPECT_EQ(kindOf([&] { builder.tid(5); }), Error::Kind::Value);
  EXPECT_EQ(kindOf([&] { builder.endFor({}); }), Error::Kind::Value);
  EXPECT_EQ(kindOf([&] { builder.call("nobody", {}); }), Error::Kind::Key);
  EXPECT_EQ(kindOf([&] { builder.finish(); }), Error::Kind::Value);
  try {
    builder.store(args[0], {args[1]}, args[1]);
    FAIL() << "no error";
  } catch (const Error &error) {
    EXPECT_EQ(error.file, "user.py");
    EXPECT_EQ(error.line, 12);
    EXPECT_EQ(error.column, 5);
  }
}

// A builder that is dropped half way leaves nothing behind.
TEST_F(BuilderTest, openControlFlowCanBeDropped) {
  Builder::Values args =
      builder.beginFunction("kernel", {"x", "n"}, {array, i32}, true);
  Value zero = builder.zero(i32), one = builder.constant(i32, int64_t(1));
  builder.beginFor(zero, args[1], one, {zero});
  builder.beginIf(builder.builtin("lt", {zero, args[1]}).values[0]);
  builder.beginWhile({one});
}

// A loop-carried value may become known while its body is built.
TEST_F(BuilderTest, valuesCarriedLate) {
  Builder::Values args =
      builder.beginFunction("kernel", {"x", "n"}, {array, i32}, true);
  Value zero = builder.zero(i32), one = builder.constant(i32, int64_t(1));
  builder.beginFor(zero, args[1], one, {});
  Value old = builder.carry(0, builder.zero(f32));
  Value next =
      builder.builtin("add", {old, builder.constant(f32, 2.0)}).values[0];
  Builder::Values results = builder.endFor({next}, {one});
  ASSERT_EQ(results.size(), 2u);
  EXPECT_EQ(results[0].type(), f32);
  EXPECT_EQ(results[1].type(), i32);
  builder.store(args[0], {results[1]}, results[0]);
  builder.endFunction({});
  EXPECT_EQ(builder.finish().kernelName(), "kernel");
}

// Malformed text names the line and column of the text.
TEST_F(BuilderTest, malformedText) {
  try {
    Module::fromText("module {\n  func.func @f() { warp.nope }\n}");
    FAIL() << "no error";
  } catch (const Error &error) {
    EXPECT_EQ(error.kind, Error::Kind::Parse);
    EXPECT_EQ(error.line, 2);
  }
  for (const char *text : {"", "module {", "%", "!warp.vec<0 x f32>", "\0x"})
    try {
      Module::fromText(text);
    } catch (const Error &error) {
      EXPECT_EQ(error.kind, Error::Kind::Parse);
    }
  EXPECT_EQ(kindOf([] { Type::parse("!warp.vec<3 x"); }), Error::Kind::Parse);
  EXPECT_EQ(kindOf([] { Type::parse("f32 f32"); }), Error::Kind::Parse);
}

} // namespace
