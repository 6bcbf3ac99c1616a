//===- index-branches-test.cpp - Branches for indices below zero ----------===//
//
// Part of Warp on MLIR, under the Apache License v2.0.
//
//===----------------------------------------------------------------------===//

#include "Compiler/Target.h"

#include "llvm/AsmParser/Parser.h"
#include "llvm/IR/InstIterator.h"
#include "llvm/IR/Instructions.h"
#include "llvm/IR/Module.h"
#include "llvm/IR/Verifier.h"
#include "llvm/Support/SourceMgr.h"

#include <gtest/gtest.h>

namespace {
/// Branches that the function of some text gets, and selects that it keeps.
struct Counts {
  int branches = 0, selects = 0;
  bool operator==(const Counts &other) const = default;
};
} // namespace

static Counts countsOf(const std::string &body) {
  llvm::LLVMContext context;
  llvm::SMDiagnostic error;
  std::unique_ptr<llvm::Module> module = llvm::parseAssemblyString(
      "define void @f(ptr %params, ptr %x, ptr %y) {\n" + body +
          "  ret void\n}\n",
      error, context);
  EXPECT_TRUE(module) << error.getMessage().str();
  if (!module)
    return {};
  warp::branchOnIndices(*module);
  EXPECT_FALSE(llvm::verifyModule(*module));
  Counts counts;
  for (llvm::Instruction &one : llvm::instructions(*module->getFunction("f"))) {
    auto *branch = llvm::dyn_cast<llvm::BranchInst>(&one);
    counts.branches += branch && branch->isConditional();
    counts.selects += llvm::isa<llvm::SelectInst>(one);
  }
  return counts;
}

static const std::string begin = R"(
  %at = getelementptr inbounds i8, ptr %params, i64 40
  %wide = load i64, ptr %at
  %n = trunc i64 %wide to i32
  %i = load i32, ptr %x
)";
static const std::string end = R"(
  %e = sext i32 %w to i64
  %p = getelementptr float, ptr %y, i64 %e
  store float 0.0, ptr %p
)";

TEST(IndexBranches, TakeThePlaceOfExtentsThatAreAdded) {
  EXPECT_EQ(countsOf(begin + R"(
  %c = icmp slt i32 %i, 0
  %s = select i1 %c, i32 %n, i32 0
  %w = add i32 %s, %i
)" + end),
            (Counts{1, 0}));
  EXPECT_EQ(countsOf(begin + R"(
  %c = icmp sgt i32 %i, -1
  %a = add i32 %i, %n
  %w = select i1 %c, i32 %i, i32 %a
)" + end),
            (Counts{1, 0}));
}

// An index that is made of another and a constant, and two of the same number.
TEST(IndexBranches, FollowSums) {
  EXPECT_EQ(countsOf(begin + R"(
  %c = icmp slt i32 %i, -1
  %j = add i32 %i, 1
  %s = select i1 %c, i32 %n, i32 0
  %v = add i32 %j, %s
  %d = icmp slt i32 %v, 0
  %t = select i1 %d, i32 %n, i32 0
  %w = add i32 %v, %t
)" + end),
            (Counts{2, 0}));
}

// The sign of what a program adds its own numbers to is not known.
TEST(IndexBranches, LeaveOtherSelects) {
  EXPECT_EQ(countsOf(begin + R"(
  %q = load ptr, ptr %x
  %m = load i32, ptr %q
  %c = icmp slt i32 %i, 0
  %s = select i1 %c, i32 %m, i32 0
  %w = add i32 %s, %i
)" + end),
            (Counts{0, 1}));
  EXPECT_EQ(countsOf(begin + R"(
  %c = icmp slt i32 %i, 7
  %s = select i1 %c, i32 %n, i32 0
  %w = add i32 %s, %i
)" + end),
            (Counts{0, 1}));
  EXPECT_EQ(countsOf(begin + R"(
  %c = icmp slt i32 %i, 0
  %s = select i1 %c, i32 %n, i32 0
  %w = mul i32 %s, %i
)" + end),
            (Counts{0, 1}));
}
