#!/bin/bash
# Tests and benchmarks on a machine with a GPU.
#
#   test/device/run.sh [STEP] [pytest arguments]
#
#   assemble   put the package together in build/device-package
#   tests      the pytest suite on the GPU, one process per file
#   better     the tests of tiles again, with the code of later launches
#   sanitize   representative kernels under compute-sanitizer
#   pair       the tests that need two GPUs, NCCL among them
#   bench      figures with their goals
#   all        everything; tests and sanitizer side by side, figures alone
#
# The machine needs Python with NumPy, pybind11 and pytest, g++ and xz (or
# Python's lzma), but no LLVM and no network: libwarp.so comes ready from
# `make device-bundle` in build/device, and only the thin binding is compiled
# here, for this Python. Every step ends within its share of BUDGET, and a step
# that fails does not keep the next from running; the summary comes last.
#
#   PYTHON             interpreter (default: python3)
#   WARP_TEST_DEVICE   device the tests use (default: cuda:0)
#   BUDGET             seconds for everything (default: 570)
#   LOGS               folder for whole logs (default: build/device-logs)
set -uo pipefail
cd "$(dirname "$0")/../.."
step=${1:-all}
shift || true

python=${PYTHON:-python3}
bundle=build/device
work=build/device-package
package=$work/warp
logs=${LOGS:-build/device-logs}
budget=${BUDGET:-570}
mkdir -p "$logs"
export WARP_TEST_DEVICE=${WARP_TEST_DEVICE:-cuda:0}
export PYTHONPATH=$PWD/$work${PYTHONPATH:+:$PYTHONPATH}
export WARP_CACHE_PATH=${WARP_CACHE_PATH:-$(mktemp -d)}
export PYTHONUNBUFFERED=1
# Modules are compiled once, not by each of the processes.
unset PYTHONDONTWRITEBYTECODE
export PYTHONPYCACHEPREFIX=${PYTHONPYCACHEPREFIX:-$(mktemp -d)}

# Seconds left, but at most $1.
share() {
  local left=$((budget - SECONDS))
  [ $left -lt "$1" ] || left=$1
  [ $left -gt 1 ] || left=1
  echo $left
}

assemble() {
  rm -rf "$package" && mkdir -p "$package/_src" &&
    cp -r python/warp/. "$package/" &&
    cp "$bundle"/{builtin_table,builtin_calls,device_table}.py "$package/_src/" &&
    cp "$bundle"/{__init__,config}.pyi "$bundle"/libwarp_*.so "$package/" &&
    cp -r examples "$package/examples/programs" &&
    rm -rf "$package"/examples/programs/{c,cpp} &&
    mkdir -p "$package/include" "$package/cmake" &&
    cp -r include/warp "$package/include/" &&
    cp "$bundle"/{HandleKinds,LaunchContract.h}.inc "$package/include/warp/" &&
    cp cmake/warpConfig.cmake "$package/cmake/" || return 1
  "$python" - "$bundle/libwarp.so.xz" "$package/libwarp.so" <<'PYTHON' || return 1
import lzma, shutil, sys
with lzma.open(sys.argv[1]) as packed, open(sys.argv[2], "wb") as plain:
    shutil.copyfileobj(packed, plain)
PYTHON
  local suffix includes
  suffix=$("$python" -c 'import sysconfig; print(sysconfig.get_config_var("EXT_SUFFIX"))')
  includes=$("$python" -m pybind11 --includes) || return 1
  local objects=() source failed=0
  for source in python/bindings/*.cpp; do
    objects+=("$work/$(basename "$source" .cpp).o")
    # shellcheck disable=SC2086
    g++ -std=c++20 -O2 -fPIC -fvisibility=hidden $includes "-I$package/include" \
      -c "$source" -o "${objects[-1]}" &
  done
  for source in $(jobs -p); do wait "$source" || failed=1; done
  [ $failed = 0 ] || return 1
  g++ -shared -o "$package/_native$suffix" "${objects[@]}" "$package/libwarp.so" \
    -Wl,-rpath,'$ORIGIN'
}

run_tests() {
  local limit=400
  [ "$step" != tests ] || limit=540 # alone: as long as the files take
  limit=$(share $limit)
  timeout -k 10 $((limit + 10)) "$python" test/device/suite.py --timeout "$limit" \
    --log "$logs/pytest" -- "$@"
}

run_better() {
  local limit
  limit=$(share 100)
  WARP_TEST_LEVEL=2 timeout -k 10 $((limit + 10)) "$python" test/device/suite.py \
    --timeout "$limit" --log "$logs/better" test/python/tiles/test_*.py -- "$@"
}

run_sanitizer() {
  local limit
  limit=$(share 200)
  timeout -k 10 $((limit + 10)) "$python" test/device/sanitize.py \
    --timeout $((limit / 2))
}

run_pair() {
  local limit
  limit=$(share 420)
  # On SIGINT pytest still says what failed.
  WARP_RANKS_SECONDS=$((limit > 180 ? limit - 120 : 60)) timeout -s INT -k 10 \
    "$limit" "$python" -m pytest -q --no-header -rfs --tb=short --durations=5 \
    -p no:cacheprovider test/python/devices/test_two_devices.py \
    test/python/distributed/test_nccl.py "$@"
}

run_benchmarks() {
  local status=0 limit
  limit=$(share 240)
  timeout -k 10 $((limit + 5)) "$python" benchmarks/gpu.py --budget $((limit * 2 / 3)) \
    --json "$logs/gpu.json" || status=1
  timeout -k 10 "$(share 60)" "$python" benchmarks/autodiff.py --device cuda:0 \
    --only time,compile,loops --seconds 0.2 --json "$logs/autodiff.json" || status=1
  if [ "$(share 60)" -ge 60 ]; then
    timeout -k 10 "$(share 150)" "$python" benchmarks/spine.py --device cpu \
      --seconds 0.3 --json "$logs/spine.json" || status=1
  else
    echo "spine.py on the CPU: not run, out of time"
  fi
  return $status
}

summary=()
status=0
# record NAME BEGIN STATUS [LOG]: a line of the summary, with what a log counts.
record() {
  local outcome=ok last=
  [ "$3" = 0 ] || outcome=FAILED status=1
  [ "$3" != 124 ] || outcome="FAILED (out of time)"
  [ -z "${4:-}" ] ||
    last=$(grep -E ' passed|goals met$|findings|not (run|finished)' "$4" |
      cut -c 1-120 | tail -n 3 | paste -sd ';')
  summary+=("$(printf '%-9s %4d s  %s  %s' "$1" $((SECONDS - $2)) "$outcome" "$last")")
}

# perform NAME FUNCTION ARGUMENTS...: a step, its output kept and shown.
perform() {
  local name=$1 begin=$SECONDS result
  shift
  echo "== $name"
  "$@" 2>&1 | tee "$logs/$name.log"
  result=${PIPESTATUS[0]}
  record "$name" "$begin" "$result" "$logs/$name.log"
}

echo "== assemble"
assemble || { echo "cannot assemble the package"; exit 1; }
"$python" -c 'import warp; print("warp", warp.__version__, "from", warp.__file__)' || exit 1
"$python" -c 'import warp; print(*map(repr, warp.get_devices()))'
record assemble 0 0
case $step in
assemble) ;;
tests) perform tests run_tests "$@" ;;
better) perform better run_better "$@" ;;
sanitize) perform sanitize run_sanitizer ;;
pair) perform pair run_pair "$@" ;;
bench) perform bench run_benchmarks ;;
all)
  begin=$SECONDS
  run_sanitizer >"$logs/sanitize.log" 2>&1 &
  sanitizer=$!
  perform tests run_tests "$@"
  wait $sanitizer
  result=$?
  echo "== sanitize"
  cat "$logs/sanitize.log"
  record sanitize "$begin" $result "$logs/sanitize.log"
  perform better run_better
  perform bench run_benchmarks
  ;;
*)
  echo "unknown step '$step', expected assemble, tests, better, sanitize, pair, bench or all"
  exit 2
  ;;
esac
echo "== summary after $SECONDS s"
printf '%s\n' "${summary[@]}"
exit $status
