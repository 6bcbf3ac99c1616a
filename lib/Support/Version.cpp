//===- Version.cpp - Version of this build --------------------------------===//
//
// Part of Warp on MLIR, under the Apache License v2.0.
//
//===----------------------------------------------------------------------===//

#include "warp/Version.h"

#include <cstdint>
#include <elf.h>
#include <link.h>

namespace {

struct Search {
  uintptr_t address;
  std::string found;
};

size_t roundToWord(size_t size) { return (size + 3) & ~size_t(3); }

/// Appends the build id among the notes in [note, note + size), if any.
void readNotes(const char *note, size_t size, std::string &digits) {
  const char *end = note + size;
  while (note + sizeof(ElfW(Nhdr)) <= end) {
    const auto *header = reinterpret_cast<const ElfW(Nhdr) *>(note);
    const char *name = note + sizeof(*header);
    const char *value = name + roundToWord(header->n_namesz);
    if (header->n_type == NT_GNU_BUILD_ID && header->n_namesz == 4 &&
        std::string(name, 3) == "GNU") {
      for (size_t i = 0; i < header->n_descsz; ++i) {
        unsigned char byte = static_cast<unsigned char>(value[i]);
        digits += "0123456789abcdef"[byte >> 4];
        digits += "0123456789abcdef"[byte & 15];
      }
      return;
    }
    note = value + roundToWord(header->n_descsz);
  }
}

/// Called per loaded object; stops at the one that contains the address.
int visit(dl_phdr_info *info, size_t, void *data) {
  auto *search = static_cast<Search *>(data);
  bool here = false;
  for (int i = 0; i < info->dlpi_phnum; ++i) {
    const ElfW(Phdr) &segment = info->dlpi_phdr[i];
    uintptr_t begin = info->dlpi_addr + segment.p_vaddr;
    here |= segment.p_type == PT_LOAD && search->address >= begin &&
            search->address < begin + segment.p_memsz;
  }
  if (!here)
    return 0;
  for (int i = 0; i < info->dlpi_phnum && search->found.empty(); ++i) {
    const ElfW(Phdr) &segment = info->dlpi_phdr[i];
    if (segment.p_type == PT_NOTE)
      readNotes(reinterpret_cast<const char *>(info->dlpi_addr) +
                    segment.p_vaddr,
                segment.p_memsz, search->found);
  }
  return 1;
}

} // namespace

const char *warp::version() { return WARP_RELEASE; }

const std::string &warp::buildId() {
  static const std::string id = [] {
    Search search{reinterpret_cast<uintptr_t>(&warp::version), {}};
    dl_iterate_phdr(visit, &search);
    return search.found.empty() ? WARP_RELEASE " " __DATE__ " " __TIME__
                                : search.found;
  }();
  return id;
}
