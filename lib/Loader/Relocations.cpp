//===- Relocations.cpp - Relocations of ELF objects -----------------------===//
//
// Part of Warp on MLIR, under the Apache License v2.0.
//
//===----------------------------------------------------------------------===//

#include "Relocations.h"

#include <elf.h>

#include <cstring>

using namespace warp;

template <typename T> static void store(char *at, T value) {
  std::memcpy(at, &value, sizeof value);
}

//===----------------------------------------------------------------------===//
// x86-64
//===----------------------------------------------------------------------===//

/// jmp *[rip + 0]
static constexpr unsigned char jumpOfX86[6] = {0xff, 0x25, 0, 0, 0, 0};

static size_t sizeOnX86(unsigned kind) {
  return kind == R_X86_64_64 || kind == R_X86_64_PC64 ? 8 : 4;
}

static Relocated applyOnX86(const Relocation &r) {
  uint64_t here = reinterpret_cast<uint64_t>(r.at);
  int64_t value = 0;
  bool isSigned = true;
  switch (r.kind) {
  case R_X86_64_NONE:
    return Relocated::Done;
  case R_X86_64_64:
    store(r.at, r.address + r.addend);
    return Relocated::Done;
  case R_X86_64_PC64:
    store(r.at, r.address + r.addend - here);
    return Relocated::Done;
  case R_X86_64_PLT32:
  case R_X86_64_PC32:
    value = r.address + r.addend - here;
    if (value != int32_t(value))
      value = r.stub() + r.addend - here;
    break;
  case R_X86_64_GOTPCREL:
  case R_X86_64_GOTPCRELX:
  case R_X86_64_REX_GOTPCRELX:
    value = r.slot() + r.addend - here;
    break;
  case R_X86_64_32:
    isSigned = false;
    [[fallthrough]];
  case R_X86_64_32S:
    value = r.address + r.addend;
    break;
  default:
    return Relocated::UnknownKind;
  }
  if (isSigned ? value != int32_t(value) : value != int64_t(uint32_t(value)))
    return Relocated::TooFar;
  store(r.at, int32_t(value));
  return Relocated::Done;
}

const Relocations warp::x86Relocations = {
    EM_X86_64, "x86-64", jumpOfX86, sizeof(jumpOfX86), sizeOnX86, applyOnX86,
};

//===----------------------------------------------------------------------===//
// aarch64
//===----------------------------------------------------------------------===//

/// ldr x16, [pc + 8]; br x16
static constexpr uint32_t jumpOfAArch64[2] = {0x58000050, 0xd61f0200};

static size_t sizeOnAArch64(unsigned kind) {
  return kind == R_AARCH64_ABS64 || kind == R_AARCH64_PREL64 ? 8 : 4;
}

/// Puts bits of a value into an instruction, whose field is zero.
static void insert(char *at, uint32_t bits) {
  uint32_t instruction = 0;
  std::memcpy(&instruction, at, sizeof instruction);
  store(at, instruction | bits);
}

/// The distance in pages of 4 KB, for `adrp`.
static Relocated insertPages(char *at, uint64_t target) {
  int64_t pages =
      int64_t(target >> 12) - int64_t(reinterpret_cast<uint64_t>(at) >> 12);
  if (pages < -(1 << 20) || pages >= 1 << 20)
    return Relocated::TooFar;
  insert(at, uint32_t(pages & 3) << 29 | uint32_t(pages >> 2 & 0x7ffff) << 5);
  return Relocated::Done;
}

/// The place in its page, in units of an access of `1 << scale` bytes.
static Relocated insertOffset(char *at, uint64_t target, unsigned scale) {
  if (target & ((1 << scale) - 1))
    return Relocated::TooFar;
  insert(at, uint32_t(target & 0xfff) >> scale << 10);
  return Relocated::Done;
}

static Relocated applyOnAArch64(const Relocation &r) {
  uint64_t here = reinterpret_cast<uint64_t>(r.at);
  uint64_t target = r.address + r.addend;
  int64_t distance = target - here;
  switch (r.kind) {
  case R_AARCH64_NONE:
    return Relocated::Done;
  case R_AARCH64_ABS64:
    store(r.at, target);
    return Relocated::Done;
  case R_AARCH64_PREL64:
    store(r.at, distance);
    return Relocated::Done;
  case R_AARCH64_PREL32:
    if (distance != int32_t(distance))
      return Relocated::TooFar;
    store(r.at, int32_t(distance));
    return Relocated::Done;
  case R_AARCH64_CALL26:
  case R_AARCH64_JUMP26: {
    constexpr int64_t reach = int64_t(1) << 27;
    if (distance < -reach || distance >= reach)
      distance = r.stub() - here;
    if (distance < -reach || distance >= reach || distance % 4)
      return Relocated::TooFar;
    insert(r.at, uint32_t(distance >> 2) & 0x3ffffff);
    return Relocated::Done;
  }
  case R_AARCH64_ADR_PREL_PG_HI21:
    return insertPages(r.at, target);
  case R_AARCH64_ADR_GOT_PAGE:
    return insertPages(r.at, r.slot());
  case R_AARCH64_LD64_GOT_LO12_NC:
    return insertOffset(r.at, r.slot(), 3);
  case R_AARCH64_ADD_ABS_LO12_NC:
  case R_AARCH64_LDST8_ABS_LO12_NC:
    return insertOffset(r.at, target, 0);
  case R_AARCH64_LDST16_ABS_LO12_NC:
    return insertOffset(r.at, target, 1);
  case R_AARCH64_LDST32_ABS_LO12_NC:
    return insertOffset(r.at, target, 2);
  case R_AARCH64_LDST64_ABS_LO12_NC:
    return insertOffset(r.at, target, 3);
  case R_AARCH64_LDST128_ABS_LO12_NC:
    return insertOffset(r.at, target, 4);
  default:
    return Relocated::UnknownKind;
  }
}

const Relocations warp::aarch64Relocations = {
    EM_AARCH64,           "aarch64",     jumpOfAArch64,
    sizeof jumpOfAArch64, sizeOnAArch64, applyOnAArch64,
};
