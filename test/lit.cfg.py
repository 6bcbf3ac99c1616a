"""lit configuration: suites, substitutions and features.

Features: `x86-64` or `aarch64` (the processor that warp-opt is for; an emulator may run it),
`package` (Python imports the package: it is for the same processor as the interpreter), `cuda`
(a device answers), `ptxas` (the assembler is installed), `amdgpu` (LLVM's tools
are installed and generate code for AMD's GPUs).
WARP_VERIFY_ROUNDTRIP=1 makes every warp-opt run also check that its input
survives printing and parsing, as text and as bytecode.
"""

import ctypes
import importlib.util
import os
import shutil
import subprocess

import lit.formats

config.name = "warp"
config.test_format = lit.formats.ShTest(execute_external=False)
config.suffixes = [".mlir", ".py", ".td"]
config.excludes = ["lit.cfg.py", "lit.site.cfg.py", "python", "unit", "device", "typing", "Inputs"]
config.test_source_root = os.path.dirname(__file__)
config.test_exec_root = config.warp_obj_root

config.available_features.add(config.warp_processor)
warp_opt = os.path.join(config.warp_tools_dir, "warp-opt")
if not config.warp_emulator:
    config.available_features.add("package")
else:
    warp_opt = " ".join([*config.warp_emulator.split(";"), warp_opt])
if os.environ.get("WARP_VERIFY_ROUNDTRIP", "0") not in ("", "0"):
    warp_opt += " --verify-roundtrip"
    config.available_features.add("roundtrip")


def llvm_tool(name):
    return os.path.join(config.llvm_tools_dir, name)


def find_ptxas():
    folders = [os.environ.get("CUDA_PATH", ""), "/usr/local/cuda"]
    places = [os.path.join(folder, "bin") for folder in folders]
    places.append(os.path.join(config.warp_obj_root, "..", "third_party"))
    return shutil.which("ptxas") or shutil.which("ptxas", path=os.pathsep.join(places))


def has_amdgpu():
    try:
        targets = subprocess.run([llvm_tool("llc"), "--version"], capture_output=True, text=True)
    except OSError:
        return False
    tools = ("mlir-translate", "llvm-link")
    return "amdgcn" in targets.stdout and all(os.path.exists(llvm_tool(tool)) for tool in tools)


def count_cuda_devices():
    try:
        driver = ctypes.CDLL("libcuda.so.1")
    except OSError:
        return 0
    count = ctypes.c_int(0)
    if driver.cuInit(0) or driver.cuDeviceGetCount(ctypes.byref(count)):
        return 0
    return count.value


ptxas = find_ptxas()
if ptxas:
    config.available_features.add("ptxas")
    config.substitutions.append((r"\bptxas\b", ptxas))
if has_amdgpu():
    config.available_features.add("amdgpu")
if count_cuda_devices():
    config.available_features.add("cuda")

llvm_tools = ["FileCheck", "not", "split-file", "mlir-opt", "mlir-translate", "llc"]
llvm_tools += ["llvm-readobj", "llvm-nm", "llvm-objdump"]
for tool in llvm_tools:
    config.substitutions.append((rf"(?<![-\w/]){tool}(?![-\w])", llvm_tool(tool)))
config.substitutions.append((r"(?<![-\w/])warp-opt(?![-\w])", warp_opt))
warp_tblgen = [
    config.warp_tblgen or os.path.join(config.warp_tools_dir, "warp-tblgen"),
    "-I " + os.path.join(config.test_source_root, "..", "include", "WarpDialect"),
    "-I " + os.path.join(config.llvm_tools_dir, "..", "include"),
]
config.substitutions.append((r"(?<![-\w/])warp-tblgen(?![-\w])", " ".join(warp_tblgen)))
config.substitutions.append(("%build", os.path.join(config.warp_tools_dir, "..")))
config.substitutions.append(("%llvm_tools", config.llvm_tools_dir))
config.substitutions.append(("%warp_python_dir", config.warp_python_dir))
config.substitutions.append(("%python", config.warp_python))
if importlib.util.find_spec("mypy"):
    config.available_features.add("mypy")

config.environment["PYTHONPATH"] = config.warp_python_dir
config.environment["WARP_CACHE_PATH"] = os.path.join(config.warp_obj_root, "kernel-cache")
for name in ("HOME", "CUDA_PATH", "LD_LIBRARY_PATH", "ASAN_OPTIONS"):
    if name in os.environ:
        config.environment[name] = os.environ[name]
