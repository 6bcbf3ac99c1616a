//===- forms-test.cpp - Forms and ranges of integers ----------------------===//
//
// Part of Warp on MLIR, under the Apache License v2.0.
//
//===----------------------------------------------------------------------===//

#include "Analysis/Ranges.h"
#include "WarpDialect/WarpDialect.h"
#include "WarpDialect/WarpOps.h"

#include "mlir/Dialect/Arith/IR/Arith.h"
#include "mlir/Dialect/Func/IR/FuncOps.h"
#include "mlir/Dialect/SCF/IR/SCF.h"
#include "mlir/Parser/Parser.h"

#include "gtest/gtest.h"

using namespace mlir;

namespace {

/// Operations whose results are i32, put into a kernel of one argument.
class FormsTest : public testing::Test {
protected:
  FormsTest() {
    context.loadDialect<warp::WarpDialect, arith::ArithDialect,
                        func::FuncDialect, scf::SCFDialect>();
  }

  /// The last operation's first result.
  Value parse(const std::string &body) {
    module = parseSourceString<ModuleOp>(
        "func.func @k(%n: i32) {\n" + body + "\nreturn\n}", &context);
    EXPECT_TRUE(module);
    auto function = *module->getOps<func::FuncOp>().begin();
    Operation *last = function.getBody().front().getTerminator();
    return last->getPrevNode()->getResult(0);
  }

  MLIRContext context;
  OwningOpRef<ModuleOp> module;
};

} // namespace

// 2^60 paths lead from the last sum to the first: each value is looked at once.
TEST_F(FormsTest, LooksAtSharedValuesOnce) {
  std::string body = "%v0 = warp.tid : i32";
  for (int i = 0; i < 60; ++i) {
    std::string from = "%v" + std::to_string(i);
    body += "\n%v" + std::to_string(i + 1) + " = arith.addi " + from + ", " +
            from + " : i32";
  }
  Value last = parse(body + "\n%e = arith.extsi %v60 : i32 to i64");
  warp::Forms forms;
  // 2^60 i is 0 in 32 bits.
  EXPECT_EQ(forms.of(last.getDefiningOp()->getOperand(0)).getConstant(), 0);
  EXPECT_EQ(forms.of(last).getConstant(), 0);
}

TEST_F(FormsTest, LooksAtSharedOpaqueValuesOnce) {
  std::string body = "%v0 = warp.tid : i32";
  for (int i = 0; i < 60; ++i) {
    std::string from = "%v" + std::to_string(i);
    body += "\n%v" + std::to_string(i + 1) + " = arith.xori " + from + ", " +
            from + " : i32";
  }
  Value last = parse(body);
  warp::Forms forms;
  warp::Ranges ranges(forms);
  EXPECT_TRUE(forms.of(last).getSymbol() == warp::Symbol::opaque(last));
  EXPECT_TRUE(ranges.of(last).low == 0);
  EXPECT_TRUE(warp::isNonNegative(last, last.getParentBlock()));
}

// Long programs are not deep recursions.
TEST_F(FormsTest, FollowsLongChains) {
  std::string body = "%v0 = warp.tid : i32\n%c = arith.constant 1 : i32";
  for (int i = 0; i < 50000; ++i)
    body += "\n%v" + std::to_string(i + 1) + " = arith.addi %v" +
            std::to_string(i) + ", %c : i32";
  Value last = parse(body);
  warp::Forms forms;
  EXPECT_EQ(forms.of(last).constant, 50000);
  EXPECT_TRUE(warp::isNonNegative(last, nullptr));
}

TEST_F(FormsTest, CountsTrips) {
  auto count = [&](const std::string &bounds) {
    parse("%c0 = arith.constant 0 : i32\n%c2 = arith.constant 2 : i32\n"
          "%c3 = arith.constant 3 : i32\n%c7 = arith.constant 7 : i32\n"
          "%m = arith.muli %n, %c2 : i32\nscf.for %k = " +
          bounds + " : i32 {\n}\n%e = warp.tid : i32");
    Operation *loop = nullptr;
    module->walk([&](scf::ForOp op) { loop = op; });
    return warp::Forms().countTrips(loop);
  };
  EXPECT_EQ(count("%c0 to %c7 step %c2")->getConstant(), 4);
  EXPECT_EQ(count("%c7 to %c0 step %c2")->getConstant(), 0);
  EXPECT_EQ(count("%c0 to %n step %c2"), std::nullopt);
  EXPECT_EQ(count("%c0 to %m step %n"), std::nullopt);
  std::optional<warp::Form> half = count("%c0 to %m step %c2");
  ASSERT_TRUE(half && half->terms.size() == 1);
  EXPECT_EQ(half->terms[0].factor, 1);
}
