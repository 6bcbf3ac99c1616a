//===- type-layout-test.cpp - Memory layout of values ---------------------===//
//
// Part of Warp on MLIR, under the Apache License v2.0.
//
//===----------------------------------------------------------------------===//

#include "WarpDialect/WarpDialect.h"
#include "WarpDialect/WarpTypes.h"

#include "mlir/AsmParser/AsmParser.h"
#include "mlir/IR/MLIRContext.h"

#include "gtest/gtest.h"

using namespace mlir;

namespace {

class TypeLayoutTest : public ::testing::Test {
protected:
  TypeLayoutTest() { context.loadDialect<warp::WarpDialect>(); }
  mlir::Type parse(StringRef text) { return parseType(text, &context); }
  MLIRContext context;
};

TEST_F(TypeLayoutTest, ScalarsAndComposites) {
  struct Case {
    StringRef text;
    int64_t size, align, components;
  };
  for (const Case &c :
       {Case{"i1", 1, 1, 1}, Case{"ui8", 1, 1, 1}, Case{"bf16", 2, 2, 1},
        Case{"si64", 8, 8, 1}, Case{"!warp.vec<3 x i1>", 3, 1, 3},
        Case{"!warp.vec<3 x f64>", 24, 8, 3},
        Case{"!warp.mat<2x3 x f16>", 12, 2, 6},
        Case{"!warp.quat<f32>", 16, 4, 4},
        Case{"!warp.transform<f64>", 56, 8, 7},
        Case{"!warp.array<3 x f32>", 56, 8, 1}}) {
    mlir::Type type = parse(c.text);
    EXPECT_EQ(warp::getByteSize(type), c.size) << c.text.str();
    EXPECT_EQ(warp::getByteAlign(type), c.align) << c.text.str();
    EXPECT_EQ(warp::getComponentCount(type), c.components) << c.text.str();
  }
}

struct Inner {
  bool flag;
  double number;
};
struct Outer {
  float v[3];
  Inner inner;
  uint8_t byte;
  struct alignas(8) {
    char bytes[56];
  } array;
  uint16_t last;
};

TEST_F(TypeLayoutTest, StructsAreThoseOfC) {
  auto inner = cast<warp::StructType>(
      parse("!warp.struct<\"Inner\", {flag: i1, number: f64}>"));
  EXPECT_EQ(warp::getByteSize(inner), int64_t(sizeof(Inner)));
  auto outer = cast<warp::StructType>(
      parse("!warp.struct<\"Outer\", {v: !warp.vec<3 x f32>, inner: "
            "!warp.struct<\"Inner\", {flag: i1, number: f64}>, byte: ui8, "
            "array: !warp.array<1 x f32>, last: ui16}>"));
  EXPECT_EQ(warp::getByteSize(outer), int64_t(sizeof(Outer)));
  EXPECT_EQ(warp::getByteAlign(outer), int64_t(alignof(Outer)));
  EXPECT_EQ(warp::getFieldOffset(outer, 1), int64_t(offsetof(Outer, inner)));
  EXPECT_EQ(warp::getFieldOffset(outer, 2), int64_t(offsetof(Outer, byte)));
  EXPECT_EQ(warp::getFieldOffset(outer, 3), int64_t(offsetof(Outer, array)));
  EXPECT_EQ(warp::getFieldOffset(outer, 4), int64_t(offsetof(Outer, last)));
  SmallVector<mlir::Type> flat;
  warp::flatten(outer, flat);
  EXPECT_EQ(flat.size(), 8u);
  EXPECT_EQ(flat[3], parse("i1"));
  EXPECT_EQ(flat[6], parse("!warp.array<1 x f32>"));
}

TEST_F(TypeLayoutTest, EmptyStruct) {
  mlir::Type empty = parse("!warp.struct<\"E\", {}>");
  EXPECT_EQ(warp::getByteSize(empty), 0);
  EXPECT_EQ(warp::getByteAlign(empty), 1);
  EXPECT_EQ(warp::getComponentCount(empty), 0);
}

TEST_F(TypeLayoutTest, PythonNames) {
  for (auto [text, name] :
       {std::pair("i1", "bool"), std::pair("ui16", "uint16"),
        std::pair("bf16", "bfloat16"), std::pair("!warp.vec<3 x f32>", "vec3f"),
        std::pair("!warp.vec<2 x ui64>", "vec2ul"),
        std::pair("!warp.vec<5 x f32>", "vector(length=5, dtype=float32)"),
        std::pair("!warp.mat<3x3 x f16>", "mat33h"),
        std::pair("!warp.mat<2x3 x f64>",
                  "matrix(shape=(2, 3), dtype=float64)"),
        std::pair("!warp.transform<f64>", "transformd"),
        std::pair("!warp.array<2 x !warp.vec<3 x f32>>",
                  "array(dtype=vec3f, ndim=2)"),
        std::pair("!warp.struct<\"Particle\", {}>", "Particle")})
    EXPECT_EQ(warp::getPythonName(parse(text)), name);
}

} // namespace
