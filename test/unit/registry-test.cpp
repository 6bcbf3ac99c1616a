//===- registry-test.cpp - Every record of the registry -------------------===//
//
// Part of Warp on MLIR, under the Apache License v2.0.
//
// Instantiates the letters of every overload of every builtin with types that
// it allows, and checks that the operation can be created, verifies and
// survives printing. A new record is covered without a line here.
//
//===----------------------------------------------------------------------===//

#include "WarpDialect/Registry.h"
#include "Dialect/OverloadMatcher.h"
#include "WarpDialect/Signature.h"
#include "WarpDialect/WarpDialect.h"
#include "WarpDialect/WarpOps.h"

#include "mlir/AsmParser/AsmParser.h"
#include "mlir/Dialect/Func/IR/FuncOps.h"
#include "mlir/IR/Builders.h"
#include "mlir/IR/BuiltinOps.h"
#include "mlir/IR/OwningOpRef.h"
#include "mlir/IR/Verifier.h"
#include "mlir/Parser/Parser.h"

#include "gmock/gmock.h"
#include "gtest/gtest.h"

using namespace mlir;
using Kind = warp::TypePattern::Kind;
using ::testing::HasSubstr;

namespace {

class RegistryTest : public ::testing::Test {
protected:
  RegistryTest() {
    context.loadDialect<warp::WarpDialect, func::FuncDialect>();
  }

  mlir::Type parse(StringRef text) { return parseType(text, &context); }

  /// Matches operands written as `f32 si32`, separated by single spaces.
  std::optional<warp::BuiltinMatch> match(StringRef name, StringRef operands) {
    SmallVector<StringRef> texts;
    operands.split(texts, ';', -1, false);
    SmallVector<mlir::Type> types;
    for (StringRef text : texts)
      types.push_back(parse(text.trim()));
    return warp::matchBuiltin(*warp::lookupBuiltin(name), &context, types,
                              &why);
  }

  /// A type that fits a pattern; `variant` chooses among them.
  mlir::Type instantiate(const warp::TypePattern &pattern, int variant) {
    warp::OverloadMatcher matcher(&context);
    static constexpr StringLiteral numbers[] = {"f32",  "f64",  "f16",
                                                "bf16", "si32", "ui8"};
    switch (pattern.kind) {
    case Kind::AnyValue:
      return parse(variant % 2 ? "!warp.struct<\"S\", {x: f32}>" : "f32");
    case Kind::AnyNumber:
      return parse(numbers[variant % 6]);
    case Kind::AnyFloat:
      return parse(numbers[variant % 4]);
    case Kind::AnyInteger:
      return parse(numbers[4 + variant % 2]);
    case Kind::Scalar:
      return matcher.build(pattern);
    default:
      break;
    }
    auto extent = [&](unsigned i) {
      const warp::TypePattern::Extent &wanted = pattern.extents[i];
      return wanted.letter ? 2 + wanted.letter % 3 : wanted.number;
    };
    mlir::Type element = instantiate(pattern.element.front(), variant);
    if (pattern.kind == Kind::Vec)
      return warp::VecType::get(&context, extent(0), element);
    if (pattern.kind == Kind::Mat)
      return warp::MatType::get(&context, extent(0), extent(1), element);
    if (pattern.kind == Kind::Quat)
      return warp::QuatType::get(&context, element);
    if (pattern.kind == Kind::Transform)
      return warp::TransformType::get(&context, element);
    return warp::ArrayType::get(&context, 1, element);
  }

  MLIRContext context;
  std::string why;
};

TEST_F(RegistryTest, TableIsSortedAndFound) {
  ArrayRef<warp::BuiltinSpec> table = warp::getBuiltins();
  ASSERT_GT(table.size(), 100u);
  for (const warp::BuiltinSpec &spec : table) {
    EXPECT_EQ(warp::lookupBuiltin(spec.pythonName), &spec);
    EXPECT_FALSE(spec.doc.empty());
    if (!spec.isSpecial) {
      EXPECT_EQ(warp::lookupBuiltinOp(spec.opName), &spec);
    }
  }
  EXPECT_EQ(warp::lookupBuiltin(""), nullptr);
  EXPECT_EQ(warp::lookupBuiltin("zzz"), nullptr);
  EXPECT_EQ(warp::lookupBuiltin("si"), nullptr);
  EXPECT_EQ(warp::lookupBuiltinOp("warp.load"), nullptr);
}

TEST_F(RegistryTest, EveryOverloadGivesAVerifiedOperation) {
  for (const warp::BuiltinSpec &spec : warp::getBuiltins()) {
    ArrayRef<warp::Signature> signatures = warp::getSignatures(spec);
    for (auto [index, signature] : llvm::enumerate(signatures))
      for (int variant = 0; variant < 6; ++variant) {
        SCOPED_TRACE(spec.pythonName.str() + spec.overloads[index].str());
        SmallVector<mlir::Type> types;
        for (const warp::Parameter &parameter : signature.parameters)
          types.push_back(instantiate(parameter.type, variant));

        Location loc = UnknownLoc::get(&context);
        OwningOpRef<ModuleOp> module = ModuleOp::create(loc);
        OpBuilder builder = OpBuilder::atBlockEnd(module->getBody());
        auto function = func::FuncOp::create(
            builder, loc, "f", builder.getFunctionType(types, {}));
        builder.setInsertionPointToStart(function.addEntryBlock());
        Operation *op =
            warp::createBuiltin(builder, loc, spec, function.getArguments());
        ASSERT_NE(op, nullptr);
        func::ReturnOp::create(builder, loc);
        ASSERT_TRUE(succeeded(verify(*module)));
        EXPECT_EQ(op->getName().getStringRef(), spec.opName.str());
        EXPECT_TRUE(isa<warp::BuiltinOp>(op));

        std::string text;
        llvm::raw_string_ostream(text) << *module;
        OwningOpRef<ModuleOp> again =
            parseSourceString<ModuleOp>(text, &context);
        ASSERT_TRUE(again);
        std::string textAgain;
        llvm::raw_string_ostream(textAgain) << *again;
        EXPECT_EQ(text, textAgain);
      }
  }
}

TEST_F(RegistryTest, ResultsFollowFromOperands) {
  EXPECT_EQ(match("outer", "!warp.vec<2 x f64>;!warp.vec<5 x f64>")->results[0],
            parse("!warp.mat<2x5 x f64>"));
  EXPECT_EQ(
      match("mul", "!warp.mat<2x3 x f32>;!warp.mat<3x4 x f32>")->results[0],
      parse("!warp.mat<2x4 x f32>"));
  EXPECT_EQ(match("argmax", "!warp.vec<7 x si8>")->results[0], parse("ui32"));
  EXPECT_EQ(match("lt", "f16;f16")->results[0], parse("i1"));
}

TEST_F(RegistryTest, InoutOperandsAreAlsoResults) {
  auto found = match("randf", "ui32;f32;f32");
  ASSERT_TRUE(found);
  EXPECT_THAT(found->inout, ::testing::ElementsAre(0u));
  EXPECT_THAT(found->results,
              ::testing::ElementsAre(parse("f32"), parse("ui32")));
  EXPECT_EQ(found->overload, 1u);
}

TEST_F(RegistryTest, MismatchNamesTheFix) {
  EXPECT_FALSE(match("add", "f32;si32"));
  EXPECT_THAT(why, HasSubstr("no overload of '+' takes (float32, int32); use "
                             "`float(...)` for operand 2"));
  EXPECT_FALSE(match("pow", "si32;si32"));
  EXPECT_THAT(why, HasSubstr("use `float(...)` for operand 1, `float(...)` "
                             "for operand 2"));
  EXPECT_FALSE(match("bit_and", "f32;si32"));
  EXPECT_THAT(why, HasSubstr("use `int(...)` for operand 1"));
  EXPECT_FALSE(match("mul", "!warp.quat<f64>;f32"));
  EXPECT_THAT(why, HasSubstr("use `float64(...)` for operand 2"));
  EXPECT_FALSE(match("cross", "!warp.vec<2 x f32>;!warp.vec<2 x f32>"));
  EXPECT_THAT(why, Not(HasSubstr("use `")));
  EXPECT_THAT(why, HasSubstr("cross(a: vec<3, S>, b: vec<3, S>)"));
}

TEST_F(RegistryTest, ABooleanIsNoNumber) {
  EXPECT_FALSE(match("add", "i1;i1"));
  EXPECT_TRUE(match("bit_and", "i1;i1"));
  EXPECT_TRUE(match("where", "i1;f32;f32"));
}

TEST_F(RegistryTest, UnknownNamesAreReported) {
  std::string message;
  ScopedDiagnosticHandler handler(
      &context, [&](Diagnostic &diagnostic) { message = diagnostic.str(); });
  OpBuilder builder(&context);
  Location loc = UnknownLoc::get(&context);
  EXPECT_EQ(warp::createBuiltin(builder, loc, "nothing", {}), nullptr);
  EXPECT_EQ(message, "there is no builtin 'nothing'");
  EXPECT_EQ(warp::createBuiltin(builder, loc, "tid", {}), nullptr);
  EXPECT_EQ(warp::createBuiltin(builder, loc, "sin", {}), nullptr);
  EXPECT_THAT(message, HasSubstr("no overload of 'sin' takes ()"));
}

//===----------------------------------------------------------------------===//
// The overload language
//===----------------------------------------------------------------------===//

TEST(SignatureTest, ParsesAndPrints) {
  for (StringRef text :
       {"(a: S) -> S", "() -> ()", "(a: inout vec<n, F>, b: f16 = 0.5) -> F",
        "(m: mat<3, c, bool>) -> (array<k, A>, transform<G>)",
        "(x: bfloat16) -> uint64"}) {
    std::string error, source = text.str();
    // Scalars are shown by their Python names.
    for (auto [from, to] :
         {std::pair("bfloat16", "bf16"), std::pair("uint64", "u64")})
      if (size_t at = source.find(from); at != std::string::npos)
        source.replace(at, strlen(from), to);
    auto signature = warp::parseSignature(source, error);
    ASSERT_TRUE(signature) << error;
    std::string shown = warp::printSignature("", *signature);
    if (text.contains("f16 ="))
      shown.replace(shown.find("float16"), 7, "f16");
    EXPECT_EQ(shown, text.str());
  }
}

TEST(SignatureTest, SaysWhatIsWrong) {
  for (auto [text, expected] :
       {std::pair("a", "expects '(' at column 1"),
        std::pair("(a) -> S", "expects ':'"),
        std::pair("(a: Q) -> S", "expects one of the letters"),
        std::pair("(a: vec<S>) -> S", "expects an extent"),
        std::pair("(a: vec<0,S>) -> S", "expects an extent"),
        std::pair("(a: f8) -> S", "expects a type"),
        std::pair("(a: i128) -> S", "expects a type"),
        std::pair("(a: S =) -> S", "expects a default value"),
        std::pair("(a: S)", "expects '->'"),
        std::pair("(a: S) -> (S", "expects ')'"),
        std::pair("(a: S) -> S S", "expects the end")}) {
    std::string error;
    EXPECT_FALSE(warp::parseSignature(text, error)) << text;
    EXPECT_THAT(error, HasSubstr(expected));
  }
}

} // namespace
