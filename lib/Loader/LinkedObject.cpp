//===- LinkedObject.cpp - ELF object linked in memory ---------------------===//
//
// Part of Warp on MLIR, under the Apache License v2.0.
//
// Sections that are executed come first, then stubs that jump to functions
// too far away, then all other sections and a table of addresses. An
// object may be from a file, so nothing in it is taken on trust: a section, a
// symbol or a relocation outside of its bounds is an error.
//
//===----------------------------------------------------------------------===//

#include "LinkedObject.h"
#include "Relocations.h"

#include "warp/Error.h"

#include <elf.h>
#include <sys/mman.h>
#include <unistd.h>

#include <cstdint>
#include <cstring>
#include <vector>

using namespace warp;

[[noreturn]] static void fail(const std::string &reason) {
  throw Error(Error::Kind::Compile, "cannot load compiled code: " + reason);
}

/// A jump and the address behind it.
static constexpr size_t stubSize = 16, slotSize = 8;
/// Beyond any object of the compiler, far below what 32 bits address.
static constexpr size_t mostBytes = size_t(1) << 30;

namespace warp {
/// Reads, places and relocates one object.
class ObjectLinker {
public:
  ObjectLinker(LinkedObject &object, std::string_view bytes,
               const LinkedObject::Find &find)
      : object(object), bytes(bytes), find(find) {}

  void link() {
    readSections();
    place();
    readSymbols();
    for (const Elf64_Shdr &section : sections)
      if (section.sh_type == SHT_RELA)
        relocate(section);
      else if (section.sh_type == SHT_REL)
        fail("it has relocations of another kind");
    char *code = static_cast<char *>(object.memory);
    __builtin___clear_cache(code, code + executed);
    if (mprotect(object.memory, executed, PROT_READ | PROT_EXEC))
      fail("the system refuses memory for code");
  }

private:
  struct Symbol {
    std::string_view name;
    uint64_t address = 0;
    bool isWeak = false, isFound = false;
  };

  template <typename T> T read(uint64_t offset) const {
    if (offset > bytes.size() || bytes.size() - offset < sizeof(T))
      fail("it ends too early");
    T value;
    std::memcpy(&value, bytes.data() + offset, sizeof value);
    return value;
  }

  std::string_view contents(const Elf64_Shdr &section) const {
    if (section.sh_offset > bytes.size() ||
        section.sh_size > bytes.size() - section.sh_offset)
      fail("a section lies outside of it");
    return bytes.substr(section.sh_offset, section.sh_size);
  }

  void readSections() {
    auto header = read<Elf64_Ehdr>(0);
    if (std::memcmp(header.e_ident, ELFMAG, SELFMAG) ||
        header.e_ident[EI_CLASS] != ELFCLASS64 || header.e_type != ET_REL ||
        header.e_machine != rules.machine)
      fail("it is no relocatable object for " + std::string(rules.name));
    for (unsigned i = 0; i < header.e_shnum; ++i)
      sections.push_back(
          read<Elf64_Shdr>(header.e_shoff + uint64_t(i) * sizeof(Elf64_Shdr)));
    for (const Elf64_Shdr &section : sections)
      if (section.sh_type == SHT_SYMTAB)
        table = contents(section), strings = namesOf(section);
    count = table.size() / sizeof(Elf64_Sym);
  }

  std::string_view namesOf(const Elf64_Shdr &section) const {
    if (section.sh_link >= sections.size())
      fail("its symbols have no names");
    return contents(sections[section.sh_link]);
  }

  /// Gives every section that is part of the program its place.
  void place() {
    places.resize(sections.size(), nullptr);
    std::vector<size_t> offsets(sections.size());
    size_t end = 0;
    for (bool code : {true, false}) {
      for (size_t i = 0; i < sections.size(); ++i) {
        const Elf64_Shdr &section = sections[i];
        if (!isPlaced(section) ||
            bool(section.sh_flags & SHF_EXECINSTR) != code)
          continue;
        size_t alignment = std::max<size_t>(section.sh_addralign, 1);
        if (alignment > 4096 || (alignment & (alignment - 1)) ||
            section.sh_size > mostBytes)
          fail("a section has no possible size");
        end = (end + alignment - 1) & ~(alignment - 1);
        offsets[i] = end;
        end += section.sh_size;
        if (end > mostBytes)
          fail("it is too large");
      }
      end = (end + 15) & ~size_t(15);
      (code ? stubs : slots) = end;
      end += count * (code ? stubSize : slotSize);
      size_t page = sysconf(_SC_PAGESIZE);
      end = (end + page - 1) & ~(page - 1);
      if (code)
        executed = end;
    }
    if (!end)
      fail("it is empty");
    void *memory = mmap(nullptr, end, PROT_READ | PROT_WRITE,
                        MAP_PRIVATE | MAP_ANONYMOUS, -1, 0);
    if (memory == MAP_FAILED)
      fail("out of memory");
    object.memory = memory;
    object.size = end;
    for (size_t i = 0; i < sections.size(); ++i) {
      if (!isPlaced(sections[i]))
        continue;
      places[i] = static_cast<char *>(memory) + offsets[i];
      if (sections[i].sh_type != SHT_NOBITS) {
        std::string_view from = contents(sections[i]);
        std::memcpy(places[i], from.data(), from.size());
      }
    }
  }

  static bool isPlaced(const Elf64_Shdr &section) {
    return section.sh_flags & SHF_ALLOC;
  }

  void readSymbols() {
    for (size_t i = 0; i < count; ++i) {
      Elf64_Sym entry;
      std::memcpy(&entry, table.data() + i * sizeof entry, sizeof entry);
      if (entry.st_name >= strings.size() ||
          strings.find('\0', entry.st_name) == strings.npos)
        fail("a symbol has no name");
      Symbol symbol;
      symbol.name = strings.data() + entry.st_name;
      symbol.isWeak = ELF64_ST_BIND(entry.st_info) == STB_WEAK;
      if (entry.st_shndx == SHN_ABS) {
        symbol.address = entry.st_value;
        symbol.isFound = true;
      } else if (entry.st_shndx != SHN_UNDEF) {
        if (entry.st_shndx >= sections.size() ||
            entry.st_value > sections[entry.st_shndx].sh_size)
          fail("symbol '" + std::string(symbol.name) + "' lies nowhere");
        if (char *place = places[entry.st_shndx]) {
          symbol.address = reinterpret_cast<uint64_t>(place) + entry.st_value;
          symbol.isFound = true;
          if (ELF64_ST_BIND(entry.st_info) != STB_LOCAL)
            object.symbols.emplace(symbol.name,
                                   reinterpret_cast<void *>(symbol.address));
        }
      }
      symbols.push_back(symbol);
    }
  }

  /// The address of a symbol, looked for outside when it is first asked for.
  uint64_t addressOf(Symbol &symbol) {
    if (!symbol.isFound) {
      symbol.address = reinterpret_cast<uint64_t>(find(symbol.name));
      symbol.isFound = symbol.address || symbol.isWeak;
      if (!symbol.isFound)
        fail("nothing defines '" + std::string(symbol.name) + "'");
    }
    return symbol.address;
  }

  /// Code near the object that jumps to an address.
  uint64_t stubFor(size_t symbol, uint64_t address) {
    char *stub = static_cast<char *>(object.memory) + stubs + symbol * stubSize;
    std::memcpy(stub, rules.jump, rules.jumpSize);
    std::memcpy(stub + rules.jumpSize, &address, sizeof address);
    return reinterpret_cast<uint64_t>(stub);
  }

  /// The place of an address in the table.
  uint64_t slotFor(size_t symbol, uint64_t address) {
    char *slot = static_cast<char *>(object.memory) + slots + symbol * slotSize;
    std::memcpy(slot, &address, sizeof address);
    return reinterpret_cast<uint64_t>(slot);
  }

  void relocate(const Elf64_Shdr &table) {
    if (table.sh_info >= sections.size())
      fail("relocations are for no section");
    char *place = places[table.sh_info];
    const Elf64_Shdr &target = sections[table.sh_info];
    if (!place)
      return;
    std::string_view entries = contents(table);
    for (size_t i = 0; i < entries.size() / sizeof(Elf64_Rela); ++i) {
      Elf64_Rela entry;
      std::memcpy(&entry, entries.data() + i * sizeof entry, sizeof entry);
      unsigned kind = ELF64_R_TYPE(entry.r_info);
      if (target.sh_type == SHT_NOBITS || entry.r_offset > target.sh_size ||
          target.sh_size - entry.r_offset < rules.size(kind))
        fail("a relocation lies outside of its section");
      size_t index = ELF64_R_SYM(entry.r_info);
      if (index >= symbols.size())
        fail("a relocation is of no symbol");
      apply(kind, place + entry.r_offset, index, entry.r_addend);
    }
  }

  void apply(unsigned kind, char *at, size_t index, int64_t addend) {
    uint64_t address = addressOf(symbols[index]);
    Relocation relocation{kind,
                          at,
                          address,
                          addend,
                          [&] { return stubFor(index, address); },
                          [&] { return slotFor(index, address); }};
    switch (rules.apply(relocation)) {
    case Relocated::Done:
      return;
    case Relocated::TooFar:
      fail("'" + std::string(symbols[index].name) + "' is too far away");
    case Relocated::UnknownKind:
      fail("it has relocations of kind " + std::to_string(kind));
    }
  }

  const Relocations &rules = hostRelocations();
  LinkedObject &object;
  std::string_view bytes, table, strings;
  const LinkedObject::Find &find;
  std::vector<Elf64_Shdr> sections;
  std::vector<char *> places;
  std::vector<Symbol> symbols;
  /// Entries of the symbol table; each has a stub and a slot.
  size_t count = 0;
  /// Offsets: the first stub, the first slot, the end of executable code.
  size_t stubs = 0, slots = 0, executed = 0;
};
} // namespace warp

LinkedObject::LinkedObject(std::string_view bytes, const Find &find) {
  try {
    ObjectLinker(*this, bytes, find).link();
  } catch (...) {
    if (memory)
      munmap(memory, size);
    throw;
  }
}

LinkedObject::~LinkedObject() { munmap(memory, size); }

void *LinkedObject::symbol(std::string_view name) const {
  auto found = symbols.find(name);
  return found == symbols.end() ? nullptr : found->second;
}
