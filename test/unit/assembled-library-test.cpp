//===- assembled-library-test.cpp - The device library as GPU code --------===//
//
// Part of Warp on MLIR, under the Apache License v2.0.
//
// Whatever quickly compiled kernels may call is in the object of every
// architecture that there is one for.
//
//===----------------------------------------------------------------------===//

#include "Targets/Nvidia/AssembledLibrary.h"

#include "warp/LibraryCode.h"

#include "llvm/ADT/StringSet.h"
#include "llvm/Bitcode/BitcodeReader.h"
#include "llvm/IR/LLVMContext.h"
#include "llvm/IR/Module.h"
#include "llvm/Object/ELF.h"
#include "llvm/Support/MemoryBuffer.h"

#include <gtest/gtest.h>

using namespace warp;

namespace {

/// Functions that an object defines for others.
void addDefined(llvm::StringRef object, llvm::StringSet<> &names) {
  using Elf = llvm::object::ELF64LEFile;
  Elf file = llvm::cantFail(Elf::create(object));
  for (const auto &section : llvm::cantFail(file.sections())) {
    if (section.sh_type != llvm::ELF::SHT_SYMTAB)
      continue;
    llvm::StringRef strings =
        llvm::cantFail(file.getStringTableForSymtab(section));
    for (const auto &symbol : llvm::cantFail(file.symbols(&section)))
      if (symbol.getBinding() == llvm::ELF::STB_GLOBAL &&
          symbol.st_shndx != llvm::ELF::SHN_UNDEF)
        names.insert(llvm::cantFail(symbol.getName(strings)));
  }
}

class AssembledLibrary : public testing::TestWithParam<const char *> {};

} // namespace

TEST_P(AssembledLibrary, HasAllThatMayBeCalled) {
  ASSERT_TRUE(hasAssembledLibrary(GetParam()));
  llvm::StringSet<> names;
  for (const std::vector<char> &object : assembledLibrary(GetParam()))
    addDefined({object.data(), object.size()}, names);
  llvm::LLVMContext context;
  int count = 0;
  for (llvm::StringRef bitcode : {gpuLibrary(), gpuTileLibrary()}) {
    auto library = llvm::cantFail(
        llvm::getLazyBitcodeModule({bitcode, "device library"}, context));
    for (const llvm::Function &function : *library)
      if (function.hasExternalLinkage() && !function.isDeclaration() &&
          isAssembled(function.getName(), GetParam())) {
        EXPECT_TRUE(names.contains(function.getName()))
            << function.getName().str();
        ++count;
      }
  }
  EXPECT_GE(count, 20);
}

INSTANTIATE_TEST_SUITE_P(Architectures, AssembledLibrary,
                         testing::Values("sm_80", "sm_86", "sm_89", "sm_90a",
                                         "sm_100", "sm_120"));

TEST(AssembledLibraries, AreOnlyForArchitecturesThatHaveOne) {
  for (const char *target : {"sm_75", "sm_90", "sm_101", "sm_8", "cpu", ""})
    EXPECT_FALSE(hasAssembledLibrary(target)) << target;
}

// Kernels that first builds wait for, and the text of all.
TEST(AssembledLibraries, HaveTheRuntimesKernels) {
  for (const char *file :
       {"Scan", "Sort", "TreeFill", "TreeHalves", "TreeOrder"}) {
    std::string text = kernelText(file);
    EXPECT_EQ(text.find("//"), 0u) << file;
    for (int arch : {80, 87, 89, 90}) {
      std::vector<char> code = assembledKernels(file, arch);
      llvm::StringSet<> names;
      ASSERT_FALSE(code.empty()) << file << arch;
      addDefined({code.data(), code.size()}, names);
      size_t count = 0, at = 0;
      static const std::string entry = "\n.visible .entry ";
      while ((at = text.find(entry, at)) != text.npos) {
        at += entry.size();
        EXPECT_TRUE(names.contains(text.substr(at, text.find('(', at) - at)));
        ++count;
      }
      EXPECT_GT(count, 0u);
    }
  }
  EXPECT_FALSE(kernelText("SortSegments").empty());
  EXPECT_TRUE(assembledKernels("SortSegments", 90).empty());
  EXPECT_TRUE(assembledKernels("Sort", 75).empty());
  EXPECT_TRUE(kernelText("Sor").empty());
}
