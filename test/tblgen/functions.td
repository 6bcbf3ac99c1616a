// One record of each kind, through every back end.

// RUN: warp-tblgen -gen-library-functions %s | FileCheck %s --check-prefix=TABLE
// RUN: warp-tblgen -gen-library-header %s | FileCheck %s --check-prefix=HEADER
// RUN: warp-tblgen -gen-handle-kinds %s | FileCheck %s --check-prefix=KINDS
// RUN: warp-tblgen -gen-device-table %s | FileCheck %s --check-prefix=PYTHON

include "FunctionBase.td"

def Tree : HandleKind<1, [Word<"count">, Pointer<"leaves">]>;
def Wood : HandleKind<2, [ReadOnly<Array<"trees", 8>>, Pointer<"map">], [Tree]>;

def Place : ResultStruct<"x: f32, sizes: i32[3]">;
def Found : ResultStruct<"place: Place, address: u64">;

def : DeviceFunction<"find",
    "(wood: handle<Wood>, at: vec2d, most: i32) -> Found",
    [Registers<40>, Lanes<1>, Assembled]>;
def : DeviceFunction<"grow", "(memory: address, by: f32) -> ()",
    [AssembledProductShort]>;
def : DeviceFunction<"cut_*", "(id: u64, kind: i32) -> u64", [FindsSlot]>;
def : DeviceFunction<"know", "() -> i32", [Expanded]>;

// TABLE: {"warp_find", "hddi", "fiiil", 40, 1, {{.*}}::Long, false, false},
// TABLE: {"warp_grow", "lf", "", 0, -1, {{.*}}::Short, true, false},
// TABLE: {"warp_cut_*", "hi", "l", 0, -1, {{.*}}::None, false, true},
// TABLE: {"warp_know", "", "i", 0, -1, {{.*}}::None, false, false},

// HEADER: kindOfTree = 1;
// HEADER: kindOfWood = 2;
// HEADER-LABEL: struct Place {
// HEADER-NEXT: float x;
// HEADER-NEXT: int sizes[3];
// HEADER-LABEL: struct Found {
// HEADER-NEXT: Place place;
// HEADER-NEXT: unsigned long long address;
// HEADER: void warp_find(unsigned long long wood, double at0, double at1, int most, warp::geometry::Found *result);
// HEADER-NEXT: void warp_grow(unsigned long long memory, float by, void *result);
// Several functions have no prototype, nor has what the compiler expands.
// HEADER-NOT: warp_cut
// HEADER-NOT: warp_know
// HEADER: void warp_find_lanes(unsigned long long wood, const double *at0, const double *at1, const int *most, int lanes, float *result);

// Word 0 of a slot is the tag; a descriptor takes seven words.
// KINDS: WARP_HANDLE_KIND(Tree, 1)
// KINDS-NEXT: WARP_SLOT_FIELD(Tree, Number, count, 1, 0, false)
// KINDS-NEXT: WARP_SLOT_FIELD(Tree, Pointer, leaves, 2, 0, false)
// KINDS-NEXT: WARP_HANDLE_KIND(Wood, 2)
// KINDS-NEXT: WARP_HANDLE_BASE(Wood, Tree)
// KINDS-NEXT: WARP_SLOT_FIELD(Wood, Array, trees, 1, 8, true)
// KINDS-NEXT: WARP_SLOT_FIELD(Wood, Pointer, map, 8, 0, false)

// PYTHON-LABEL: KINDS = {
// PYTHON-NEXT: "Tree": 1,
// PYTHON-LABEL: WORDS = {
// PYTHON: "Wood": {
// PYTHON-NEXT: "trees": 1,
// PYTHON-NEXT: "map": 8,
// PYTHON: void warp_find(uint64_t wood, double at0, double at1, int32_t most, void *result);
