// A dummy fact of each kind: its member, key, text, bytes, attribute, and what
// Python shows.

// RUN: warp-tblgen -gen-launch-contract %s | FileCheck %s
// RUN: warp-tblgen -gen-launch-docs %s | FileCheck %s --check-prefix=DOCS
// RUN: sed 's/"odd_rows"/"oddRows"/' %s > %t.td
// RUN: not warp-tblgen -gen-launch-contract -I %S %t.td 2>&1 | FileCheck %s --check-prefix=NAME

include "LaunchFact.td"

def Launch_Rank : VariantFact<"rank", LaunchNumber<1, 1, 4>, "dimensions", Key>;
def Launch_OddRows : VariantFact<"odd_rows", LaunchFlag<>, "rows are odd",
    KeyIfUsed> {
  let phrase = "odd rows";
}
def Launch_Width : VariantFact<"width", LaunchPower<0, 0, 8>, "lanes", KeyIfUsed> {
  let phrase = "rows of {0} lanes";
}
def Launch_Effort : VariantFact<"effort", LaunchNumber<2, 0, 3>, "effort",
    PerKernel> {
  let inAttribute = 0;
}

def Launch_SizeFacts : ScheduleFact<"size_facts", SizeFactMask<>, "facts used">;
def Launch_RunLength : ScheduleFact<"run_length", LaunchNumber<1, 1, 16>,
    "indices in a row">;
def Launch_Copied : ScheduleFact<"copied",
    LaunchValue<"CopiedArrays", "::warp::CopiedAttr">, "copies">;
def Launch_Waits : CodeFact<"waits", LaunchFlag<>, "threads wait">;

// Facts that code may depend on have a bit each.
// CHECK-LABEL: enum SizeFact : int {
// CHECK-NEXT: oddRowsFact = 1,
// CHECK-NEXT: widthFact = 2,
// CHECK-NEXT: allFacts = 3

// The key: without those that differ between kernels only.
// CHECK-LABEL: struct LaunchFacts {
// CHECK-NEXT: /// dimensions
// CHECK-NEXT: int rank = 1;
// CHECK: bool oddRows = false;
// CHECK: int width = 0;
// CHECK-NOT: effort
// CHECK: bool operator==(const LaunchFacts &other) const {
// CHECK-NEXT: return rank == other.rank &&
// CHECK-NEXT: oddRows == other.oddRows &&
// CHECK: bool matches(LaunchFacts other, int sizeFacts) const {
// CHECK-NEXT: if (!(sizeFacts & oddRowsFact))
// CHECK-NEXT: other.oddRows = oddRows;

// Text, bytes and Python visit names, ranges and members.
// CHECK: visitor(FactInfo{"rank", 1, 4, false}, self.rank);
// CHECK: visitor(FactInfo{"width", 0, 8, true}, self.width);
// CHECK-LABEL: struct CompileOptions : LaunchFacts {
// CHECK: int effort = 2;
// CHECK: LaunchFacts::visit(self, visitor);
// CHECK-NEXT: visitor(FactInfo{"effort", 0, 3, false}, self.effort);
// CHECK-LABEL: struct Schedule {
// CHECK: int runLength = 1;
// CHECK: CopiedArrays copied;
// CHECK: bool waits = false;
// CHECK: visitor(FactInfo{"size_facts", 0, allFacts, false}, self.sizeFacts);
// CHECK-NEXT: visitor(FactInfo{"run_length", 1, 16, false}, self.runLength);

// CHECK-LABEL: #ifdef GET_LAUNCH_VARIANT_ACCESSORS
// CHECK: VariantAttr withOddRows(bool value) const;
// CHECK-NOT: withEffort
// CHECK-LABEL: #ifdef GET_LAUNCH_SCHEDULE_ACCESSORS
// CHECK: ScheduleAttr withRunLength(int64_t value) const;
// CHECK-NOT: withWaits

// The attribute: a verifier by ranges, defaults, and `with`.
// CHECK-LABEL: ::llvm::LogicalResult warp::VariantAttr::verify(
// CHECK: if (rank < 1 || rank > 4)
// CHECK: "expects 'rank' to be from 1 to 4, but got '"
// CHECK: if (width < 0 || width > 8 || (width & (width - 1)) != 0)
// CHECK: "expects 'width' to be 0 or a power of two up to 8, but got '"
// CHECK-LABEL: warp::VariantAttr warp::VariantAttr::getDefault(::warp::TargetAttr target) {
// CHECK-NEXT: return get(target.getContext(), target,
// CHECK-NEXT: false,
// CHECK-NEXT: 1,
// CHECK-NEXT: 0);
// CHECK-LABEL: warp::ScheduleAttr warp::ScheduleAttr::getDefault(
// CHECK: ::warp::CopiedAttr(),
// CHECK-LABEL: warp::VariantAttr warp::VariantAttr::withOddRows(bool value) const {
// CHECK-NEXT: return get(getContext(), getTarget(),
// CHECK-NEXT: value,
// CHECK-NEXT: getRank(),
// CHECK-LABEL: warp::ScheduleAttr warp::ScheduleAttr::withSizeFacts(int64_t value) const {
// CHECK-NEXT: value |= getSizeFacts();

// CHECK-LABEL: #ifdef GET_LAUNCH_CONVERSIONS
// CHECK: bool(options.oddRows),
// CHECK: assign(schedule.runLength, attribute.getRunLength());

// The phrases of `kernel.schedule()` about a launch.
// CHECK-LABEL: static std::string phrasesOf(
// CHECK: if (facts.oddRows)
// CHECK-NEXT: text += ", odd rows";
// CHECK: if (facts.width)
// CHECK-NEXT: text += ", rows of " + std::to_string(facts.width) + " lanes";

// DOCS-LABEL: ## Variant
// DOCS: | `odd_rows` | `false` | if the code depends on it | rows are odd |
// DOCS: | `effort` | `2` | no | effort |
// DOCS-LABEL: ## Schedule
// DOCS: | `run_length` | `1` | indices in a row |

// NAME: error: expects a name in snake case, but got 'oddRows'
