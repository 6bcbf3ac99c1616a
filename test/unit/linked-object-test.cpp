//===- linked-object-test.cpp - ELF objects linked without LLVM -----------===//
//
// Part of Warp on MLIR, under the Apache License v2.0.
//
//===----------------------------------------------------------------------===//

#include "Loader/LinkedObject.h"
#include "Support/LibraryObjects.h"
#include "Support/RuntimeSymbols.h"

#include "warp/Error.h"

#include <gtest/gtest.h>

#include <cstring>
#include <random>

using namespace warp;

namespace {

void *find(std::string_view name) {
  for (RuntimeSymbol symbol : runtimeSymbols())
    if (symbol.name == name)
      return symbol.address;
  return nullptr;
}

std::string errorOf(std::string_view bytes) {
  try {
    LinkedObject object(bytes, find);
  } catch (const Error &error) {
    return error.message;
  }
  return "";
}

// The device library's code for every processor, linked, runs.
TEST(LinkedObject, RunsWhatItDefines) {
  LinkedObject object(libraryObjects()[0].bytes, find);
  auto *systems = object.symbol("warp_tile_systems_f32");
  ASSERT_TRUE(systems);
  EXPECT_FALSE(object.symbol("warp_absent"));
}

TEST(LinkedObject, NamesWhatIsMissing) {
  std::string message;
  try {
    LinkedObject object(libraryObjects()[0].bytes,
                        [](std::string_view) { return nullptr; });
  } catch (const Error &error) {
    message = error.message;
  }
  EXPECT_TRUE(message.starts_with("cannot load compiled code: nothing defines"))
      << message;
}

// Parts of an object, and objects of other kinds, are errors.
TEST(LinkedObject, RefusesPieces) {
  std::string_view whole = libraryObjects().back().bytes;
  for (size_t size :
       {size_t(0), size_t(3), size_t(63), whole.size() / 2, whole.size() - 64})
    EXPECT_FALSE(errorOf(whole.substr(0, size)).empty()) << size;
#ifdef __aarch64__
  std::string processor = "aarch64";
#else
  std::string processor = "x86-64";
#endif
  EXPECT_EQ(errorOf(std::string(1000, 'x')),
            "cannot load compiled code: it is no relocatable object for " +
                processor);
}

// Damage of headers, symbols and relocations is an error or makes other code;
// it never reads or writes outside.
TEST(LinkedObject, SurvivesDamage) {
  std::string whole(libraryObjects().back().bytes);
  uint64_t headers;
  std::memcpy(&headers, whole.data() + 40, sizeof headers);
  std::mt19937_64 random(3);
  int refused = 0;
  for (int i = 0; i < 300; ++i) {
    std::string damaged = whole;
    // Half of the changes are in the table of sections.
    size_t from = i % 2 ? headers : 0;
    for (int change = 0; change < 3; ++change)
      damaged[from + random() % (damaged.size() - from)] = char(random());
    refused += !errorOf(damaged).empty();
  }
  EXPECT_GT(refused, 20);
}

} // namespace
