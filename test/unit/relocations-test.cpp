//===- relocations-test.cpp - Relocations of ELF objects ------------------===//
//
// Part of Warp on MLIR, under the Apache License v2.0.
//
// Encodings are those of the Arm Architecture Reference Manual, the rules those
// of "ELF for the Arm 64-bit Architecture". Both processors' rules run here.
//
//===----------------------------------------------------------------------===//

#include "Loader/Relocations.h"

#include <elf.h>
#include <gtest/gtest.h>

#include <cstring>

using namespace warp;

namespace {

constexpr uint64_t far = uint64_t(1) << 40;

/// A page that holds an instruction at an offset of 16.
class Aarch64 : public testing::Test {
protected:
  uint64_t here() const { return reinterpret_cast<uint64_t>(page) + 16; }

  Relocated apply(unsigned kind, uint64_t address, uint64_t instruction,
                  int64_t addend = 0) {
    std::memcpy(page + 16, &instruction, sizeof instruction);
    return aarch64Relocations.apply({kind, page + 16, address, addend,
                                     [&] { return here() + 0x200; },
                                     [&] { return here() + 0x2008; }});
  }

  template <typename T> T result() const {
    T value;
    std::memcpy(&value, page + 16, sizeof value);
    return value;
  }

  alignas(4096) char page[4096] = {};
};

TEST_F(Aarch64, CallsReachOrGoByAStub) {
  // bl
  ASSERT_EQ(apply(R_AARCH64_CALL26, here() + 0x1000, 0x94000000),
            Relocated::Done);
  EXPECT_EQ(result<uint32_t>(), 0x94000400u);
  ASSERT_EQ(apply(R_AARCH64_CALL26, here() - 4, 0x94000000), Relocated::Done);
  EXPECT_EQ(result<uint32_t>(), 0x97ffffffu);
  // The last places that 26 bits reach, and the next.
  ASSERT_EQ(apply(R_AARCH64_CALL26, here() + (1 << 27) - 4, 0x94000000),
            Relocated::Done);
  EXPECT_EQ(result<uint32_t>(), 0x95ffffffu);
  ASSERT_EQ(apply(R_AARCH64_CALL26, here() + (1 << 27), 0x94000000),
            Relocated::Done);
  EXPECT_EQ(result<uint32_t>(), 0x94000080u);
  // b
  ASSERT_EQ(apply(R_AARCH64_JUMP26, here() + far, 0x14000000), Relocated::Done);
  EXPECT_EQ(result<uint32_t>(), 0x14000080u);
}

TEST_F(Aarch64, AddressesAreAPageAndAnOffset) {
  uint64_t start = reinterpret_cast<uint64_t>(page);
  // adrp x0: two low bits of the distance are at 29, the others at 5.
  ASSERT_EQ(
      apply(R_AARCH64_ADR_PREL_PG_HI21, start + 0x5000, 0x90000000, 0xfff),
      Relocated::Done);
  EXPECT_EQ(result<uint32_t>(), 0xb0000020u);
  ASSERT_EQ(apply(R_AARCH64_ADR_PREL_PG_HI21, start - 1, 0x90000000),
            Relocated::Done);
  EXPECT_EQ(result<uint32_t>(), 0xf0ffffe0u);
  EXPECT_EQ(apply(R_AARCH64_ADR_PREL_PG_HI21, start + far, 0x90000000),
            Relocated::TooFar);
  // add x0, x0
  ASSERT_EQ(apply(R_AARCH64_ADD_ABS_LO12_NC, start + 0xabc, 0x91000000),
            Relocated::Done);
  EXPECT_EQ(result<uint32_t>(), 0x91000000u | 0xabc << 10);
  // ldr x0, ldr q0: units of the access, which the address has to be of.
  ASSERT_EQ(apply(R_AARCH64_LDST64_ABS_LO12_NC, start + 0xab8, 0xf9400000),
            Relocated::Done);
  EXPECT_EQ(result<uint32_t>(), 0xf9400000u | 0x157 << 10);
  ASSERT_EQ(apply(R_AARCH64_LDST128_ABS_LO12_NC, start + 0xab0, 0x3dc00000),
            Relocated::Done);
  EXPECT_EQ(result<uint32_t>(), 0x3dc00000u | 0xab << 10);
  EXPECT_EQ(apply(R_AARCH64_LDST64_ABS_LO12_NC, start + 4, 0xf9400000),
            Relocated::TooFar);
}

TEST_F(Aarch64, SlotsHoldAddresses) {
  ASSERT_EQ(apply(R_AARCH64_ADR_GOT_PAGE, far, 0x90000000), Relocated::Done);
  EXPECT_EQ(result<uint32_t>(), 0xd0000000u);
  ASSERT_EQ(apply(R_AARCH64_LD64_GOT_LO12_NC, far, 0xf9400000),
            Relocated::Done);
  EXPECT_EQ(result<uint32_t>(), 0xf9400000u | 3 << 10);
}

TEST_F(Aarch64, DataHoldAddressesAndDistances) {
  EXPECT_EQ(aarch64Relocations.size(R_AARCH64_ABS64), 8u);
  EXPECT_EQ(aarch64Relocations.size(R_AARCH64_PREL32), 4u);
  ASSERT_EQ(apply(R_AARCH64_ABS64, far, 0, 3), Relocated::Done);
  EXPECT_EQ(result<uint64_t>(), far + 3);
  ASSERT_EQ(apply(R_AARCH64_PREL64, here() + far, 0), Relocated::Done);
  EXPECT_EQ(result<uint64_t>(), far);
  ASSERT_EQ(apply(R_AARCH64_PREL32, here() - 5, 0), Relocated::Done);
  EXPECT_EQ(result<int32_t>(), -5);
  EXPECT_EQ(apply(R_AARCH64_PREL32, here() + far, 0), Relocated::TooFar);
  EXPECT_EQ(apply(R_AARCH64_TLSDESC_CALL, far, 0), Relocated::UnknownKind);
}

} // namespace
