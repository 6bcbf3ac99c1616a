#!/bin/bash
# Tests and benchmarks on a machine with a GPU.
#
#   test/device/run.sh [assemble|tests|bench|all] [pytest arguments]
#
# The machine needs Python with NumPy, pybind11 and pytest, g++ and xz (or
# Python's lzma), but no LLVM and no network: libwarp.so comes ready from
# `make device-bundle` in build/device, and only the thin binding is compiled
# here, for this Python. The package is put together in build/device-package.
#
#   PYTHON             interpreter (default: python3)
#   WARP_TEST_DEVICE   device the tests use (default: cuda:0)
set -uo pipefail
cd "$(dirname "$0")/../.."
step=${1:-all}
shift || true

python=${PYTHON:-python3}
bundle=build/device
work=build/device-package
package=$work/warp
export WARP_TEST_DEVICE=${WARP_TEST_DEVICE:-cuda:0}
export PYTHONPATH=$PWD/$work${PYTHONPATH:+:$PYTHONPATH}
export WARP_CACHE_PATH=${WARP_CACHE_PATH:-$(mktemp -d)}

assemble() {
  mkdir -p "$package/_src" && cp -r python/warp/. "$package/" &&
    cp "$bundle/builtin_table.py" "$package/_src/" &&
    cp "$bundle/__init__.pyi" "$package/" || return 1
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
    g++ -std=c++20 -O2 -fPIC -fvisibility=hidden $includes -Iinclude \
      -c "$source" -o "${objects[-1]}" &
  done
  for source in $(jobs -p); do wait "$source" || failed=1; done
  [ $failed = 0 ] || return 1
  g++ -shared -o "$package/_native$suffix" "${objects[@]}" "$package/libwarp.so" \
    -Wl,-rpath,'$ORIGIN'
}

run_tests() {
  "$python" -m pytest -q --no-header -p no:cacheprovider test/python "$@"
}

run_benchmarks() {
  local status=0 script
  for script in benchmarks/*.py; do
    case $script in */_*) continue ;; esac
    echo "== $script"
    "$python" "$script" || status=1
  done
  return $status
}

status=0
echo "== assemble"
assemble || { echo "cannot assemble the package"; exit 1; }
"$python" -c 'import warp; print("warp", warp.__version__, "from", warp.__file__)' || exit 1
case $step in
assemble) ;;
tests) run_tests "$@" || status=1 ;;
bench) run_benchmarks || status=1 ;;
all)
  run_tests "$@" || status=1
  run_benchmarks || status=1
  ;;
*)
  echo "unknown step '$step', expected assemble, tests, bench or all"
  exit 2
  ;;
esac
exit $status
