"""Settings: `wp.config.<name>`, each with a type, a default, an environment variable and a doc.

The settings are the attributes of the module `warp.config`, so reading one costs an attribute
lookup. Assigning checks name and type; some settings are passed on to the runtime at once. The
environment variable `WARP_<NAME>` sets the initial value. Settings that exist for programs written
for NVIDIA Warp and change nothing here are marked as such.
"""

from __future__ import annotations

import enum
import os
import sys
import types

# Values of `wp.config.log_level`.
LOG_DEBUG, LOG_INFO, LOG_WARNING, LOG_ERROR = 10, 20, 30, 40


class LaunchArrayAccessMode(enum.IntEnum):
    """Values of `wp.config.launch_array_access_mode`; launches always check what they can reach."""

    RELAXED = 0
    CHECKED = 1
    STRICT = 2


class DeterministicMode(enum.IntEnum):
    """Values of `wp.config.deterministic` and of the option of that name.

    Attributes:
        NOT_GUARANTEED: sums are made in any order. The same as False.
        RUN_TO_RUN: they have the same bits in every run on a device. The same as True.
        GPU_TO_GPU: they have the same bits on every device, the CPU among them, and for any number
            of threads: they are exact, which takes longer on CPUs with few cores.
    """

    NOT_GUARANTEED = 0
    RUN_TO_RUN = 1
    GPU_TO_GPU = 2


# Values of the option that ask for the same bits on every device.
SAME_ON_DEVICES = (DeterministicMode.GPU_TO_GPU, "gpu_to_gpu")


class Setting:
    """One setting: its type or types, default, environment variables, choices and doc."""

    def __init__(self, name, kind, default, doc, choices=None, env=None, inert=False, least=None):
        self.name = name
        self.kinds = kind if isinstance(kind, tuple) else (kind,)
        self.default = default
        self.doc = doc
        self.choices = choices
        self.env = (env or ()) + (f"WARP_{name.upper()}",)
        self.inert = inert
        self.least = least

    def check(self, value):
        """The value to store; an empty text stands for the default among choices.

        Raises:
            TypeError, ValueError: `value` does not suit the setting.
        """
        if isinstance(value, os.PathLike) and str in self.kinds:
            value = os.fspath(value)
        accepted = isinstance(value, self.kinds)
        if isinstance(value, bool) and bool not in self.kinds and value is not None:
            accepted = False
        if not accepted and float in self.kinds and isinstance(value, int):
            accepted = True
        if not accepted:
            if bool in self.kinds and isinstance(value, int) and value in (0, 1):
                return bool(value)
            raise TypeError(
                f"config.{self.name} expects {self._kinds_text()}, but got '{type(value).__name__}'"
            )
        if self.choices and value == "":
            # As NVIDIA Warp takes it, and as environment variables say it.
            return self.default
        if self.choices and value is not None and value not in self.choices:
            raise ValueError(
                f"config.{self.name} expects one of {', '.join(map(repr, self.choices))}, "
                f"but got {value!r}"
            )
        if self.least is not None and value < self.least:
            raise ValueError(f"config.{self.name} expects at least {self.least}, but got {value!r}")
        return value

    def initial(self):
        """The default, or what the environment says."""
        for variable in self.env:
            text = os.environ.get(variable)
            if text is not None:
                return self._parse(variable, text)
        return self.default

    def _parse(self, variable, text):
        if bool in self.kinds and text.lower() in _BOOLEANS:
            return _BOOLEANS[text.lower()]
        if str in self.kinds:
            return self.check(text) if text else self.default
        for kind in (int, float):
            if kind in self.kinds:
                try:
                    return self.check(kind(text))
                except ValueError:
                    continue
        raise ValueError(f"{variable} expects {self._kinds_text()}, but got {text!r}")

    def _kinds_text(self):
        names = ("None" if kind is type(None) else f"'{kind.__name__}'" for kind in self.kinds)
        return " or ".join(names)


_BOOLEANS = {
    **dict.fromkeys(("1", "true", "on", "yes"), True),
    **dict.fromkeys(("0", "false", "off", "no", ""), False),
}
_MAYBE_BOOL = (bool, type(None))
_MAYBE_INT = (int, type(None))
_MAYBE_STR = (str, type(None))


def _inert(name, kind, default):
    return Setting(name, kind, default, "accepted for compatibility, changes nothing", inert=True)


SETTINGS = {
    setting.name: setting
    for setting in (
        Setting("quiet", bool, False, "print no notices"),
        Setting(
            "peer_messages",
            bool,
            False,
            "add the sentences of NVIDIA Warp to messages of errors, for programs that read them",
            env=("WARP_PEER_MESSAGES",),
        ),
        Setting("verbose", bool, False, "print a line per compiled kernel, with times by phase"),
        Setting("verbose_warnings", bool, False, "show warnings with their place in the source"),
        Setting("print_launches", bool, False, "print kernel, device and dimensions of launches"),
        Setting("verify_fp", bool, False, "after each launch, reject infinite or NaN outputs"),
        Setting("enable_mempools_at_init", bool, True, "use the memory pools of CUDA devices"),
        Setting("track_memory", bool, False, "note where the memory of arrays is allocated"),
        Setting(
            "optimize_graphs",
            _MAYBE_BOOL,
            None,
            "operations of captured graphs come behind those alone that they depend on; None: "
            "those of GPUs. In debug mode they run as recorded",
        ),
        Setting(
            "fuse_graphs",
            bool,
            True,
            "launches of optimized graphs whose threads keep to elements of their own are one, on "
            "GPUs fills that wait for the same operations, too",
        ),
        Setting(
            "fuse_rows",
            bool,
            False,
            "on GPUs so are launches of equal first extents whose threads share elements with "
            "those of the same first index: a block runs them for each",
        ),
        Setting(
            "verify_graphs",
            bool,
            False,
            "each launch of an optimized graph also runs it as recorded and compares the memory",
        ),
        Setting("verify_cuda", bool, False, "wait for each CUDA launch and check for errors"),
        Setting(
            "mode",
            str,
            "release",
            "`debug` checks every array access and names kernel, line, array, index and shape",
            choices=("release", "debug"),
        ),
        Setting(
            "optimization_level",
            _MAYBE_INT,
            None,
            "0 to 3; None is 2, but first launches may begin with code that is there sooner",
        ),
        Setting("fast_math", bool, False, "allow reassociation and approximate functions"),
        Setting(
            "profile",
            str,
            "",
            "who is told of code that is loaded for the CPU: `perf` (by `/tmp/perf-PID.map`) or "
            "`gdb` (by its interface for JIT compilers); set before the first launch",
            choices=("", "perf", "gdb"),
        ),
        Setting("lineinfo", bool, False, "keep source lines in compiled code, for profilers"),
        Setting("max_unroll", int, 16, "constant loops up to this many iterations are unrolled"),
        Setting(
            "inline_budget",
            _MAYBE_INT,
            None,
            "scalar operations of a kernel beyond which large functions with several calls stay "
            "functions; None is 3,000 on GPUs and 12,000 on CPUs",
        ),
        Setting(
            "singular",
            str,
            "pinned",
            "derivatives where there is none: 0 (`pinned`), what IEEE arithmetic gives (`strict`), "
            "or 0 and a line with the number of times (`report`)",
            choices=("pinned", "strict", "report"),
        ),
        Setting("enable_backward", bool, True, "allow derivatives of kernels"),
        Setting(
            "tape",
            str,
            "checkpoints",
            "how derivatives of long loops have values of each iteration again: parts of the loop "
            "are run again (`checkpoints`), or all are kept in memory allocated for the launch "
            "(`global`)",
            choices=("checkpoints", "global"),
        ),
        Setting(
            "verify_autograd_array_access",
            bool,
            False,
            "print a line to stderr as soon as something overwrites what the gradient of a "
            "recorded launch depends on",
        ),
        Setting(
            "lazy_compile",
            bool,
            True,
            "first launches on GPUs return before their code is there, which threads make; "
            "`wp.synchronize`, or whatever else needs a result, waits for it and raises errors of "
            "the compiler. Off while `verbose` is on, in debug mode, and once another library uses "
            "the memory",
        ),
        Setting(
            "compile_threads",
            _MAYBE_INT,
            None,
            "threads that make code for launches on GPUs; None is one per processor, 16 at most",
        ),
        Setting(
            "ptxas",
            str,
            "auto",
            "program that assembles code for GPUs where several kernels wait for theirs, beside "
            "the driver, which makes one after the other: a file, `none`, or `auto`, which looks "
            "in `CUDA_HOME`, `PATH` and packages for one that is no newer than the driver",
        ),
        Setting(
            "progress",
            _MAYBE_BOOL,
            None,
            "show a bar while a call waits for more than two seconds for kernels to be compiled; "
            "None shows it in terminals and notebooks",
        ),
        Setting("cache_kernels", bool, True, "keep compiled kernels on disk"),
        Setting(
            "kernel_cache_dir",
            _MAYBE_STR,
            None,
            "folder of compiled kernels; None is `warp-mlir/<version>` in the user's cache folder",
            env=("WARP_CACHE_PATH",),
        ),
        Setting(
            "kernel_cache_limit",
            (float, int),
            4,
            "GiB that compiled kernels may take on disk; those not used for longest go first, and "
            "0 is no limit",
            least=0,
        ),
        Setting("dump", _MAYBE_STR, None, "folder that gets every stage of each compiled kernel"),
        Setting(
            "num_threads",
            _MAYBE_INT,
            None,
            "threads of a CPU launch, set before the first; None uses all cores",
        ),
        Setting(
            "check_lanes",
            bool,
            True,
            "compare the lanes of a CPU kernel with scalar code in a few launches, and then with "
            "another width, once it has run for a while, and keep the quickest; never of "
            "deterministic kernels, whose sums would round in another way",
        ),
        Setting(
            "check_schedules",
            bool,
            True,
            "compare the schedule of a GPU kernel with the plain mapping in 28 launches, once it "
            "has been launched often, and keep the quicker; not in captures, and never of "
            "deterministic kernels, whose sums would round in another way",
        ),
        Setting(
            "load_module_max_workers",
            _MAYBE_INT,
            None,
            "threads that compile what `wp.load_module` loads; 0 is serial, None one per processor",
        ),
        Setting(
            "deterministic",
            (bool, str, DeterministicMode),
            DeterministicMode.NOT_GUARANTEED,
            "sums that launches add to arrays have the same bits in every run: on a GPU they are "
            "exact, on the CPU they keep one order; see `DeterministicMode`",
        ),
        Setting(
            "ordered_slots",
            (bool, int),
            1 << 17,
            "CPU launches of up to so many threads (True: any number, False: none) run them one "
            "after another in kernels that use what an atomic returned, so that slots taken from a "
            "counter follow the threads",
            least=0,
        ),
        Setting(
            "enable_cpu_blocks",
            bool,
            False,
            "blocks of kernels with tiles have as many threads on a CPU as launches ask for",
        ),
        Setting(
            "peer_tile_gradients",
            bool,
            False,
            "`tile_diag_add`, `tile_min`, `tile_max`, `tile_reduce`, `tile_arange` and scans pass "
            "no gradient, as with NVIDIA Warp: for programs whose own adjoints count on that",
        ),
        Setting(
            "launch_array_access_mode",
            int,
            LaunchArrayAccessMode.RELAXED,
            "accepted for compatibility: launches always check what they can reach",
            tuple(LaunchArrayAccessMode),
        ),
        Setting("log_level", int, 30, "above LOG_WARNING the runtime gives no notices"),
        _inert("enable_vector_component_overwrites", bool, False),
        Setting(
            "legacy_scalar_return_types",
            bool,
            False,
            "components of vectors and matrices of any type are numbers of Python",
        ),
        _inert("cuda_output", _MAYBE_STR, None),
        _inert("ptx_target_arch", _MAYBE_INT, None),
        _inert("cuda_arch_suffix", _MAYBE_STR, None),
        _inert("line_directives", bool, True),
        _inert("compile_time_trace", bool, False),
        _inert("default_grid_stride", bool, True),
        _inert("enable_mathdx_gemm", bool, True),
        _inert("enable_mathdx_solver", bool, True),
        _inert("enable_mathdx_fft", bool, True),
        _inert("cpu_compiler_flags", _MAYBE_STR, None),
        _inert("llvm_cuda", bool, False),
        _inert("enable_graph_capture_module_load_by_default", bool, True),
        _inert("enable_tiles_in_stack_memory", bool, True),
        _inert("use_precompiled_headers", bool, True),
        _inert("legacy_cpu_linker", bool, False),
        _inert("deterministic_max_records", int, 0),
        _inert("deterministic_debug", bool, False),
    )
}

# Called with the new value after an assignment.
_listeners: dict = {}


def on_change(name, listener) -> None:
    """Calls `listener(value)` whenever the setting is assigned."""
    _listeners[name] = listener


class ConfigModule(types.ModuleType):
    """The class of the module `warp.config`."""

    def __reduce__(self):
        import importlib

        return importlib.import_module, (self.__name__,)

    def __setattr__(self, name, value):
        setting = SETTINGS.get(name)
        if setting is None:
            if name.startswith("__") or isinstance(value, types.ModuleType):
                super().__setattr__(name, value)
                return
            raise AttributeError(f"config has no setting '{name}'{_suggestion(name)}")
        value = setting.check(value)
        super().__setattr__(name, value)
        listener = _listeners.get(name)
        if listener is not None:
            listener(value)

    def __getattr__(self, name):
        raise AttributeError(f"config has no setting '{name}'{_suggestion(name)}")

    def __delattr__(self, name):
        raise AttributeError(f"setting '{name}' cannot be deleted")

    def __dir__(self):
        return sorted(SETTINGS)


def _suggestion(name):
    import difflib

    close = difflib.get_close_matches(name, SETTINGS, 1)
    return f", did you mean '{close[0]}'?" if close else ""


def install(module_name, version) -> None:
    """Puts the settings in place of the named module, which is being imported."""
    plain = sys.modules[module_name]
    module = sys.modules[module_name] = ConfigModule(module_name)
    values = vars(module)
    values.update(vars(plain))
    values["version"] = version
    values["DeterministicMode"] = DeterministicMode
    values["LaunchArrayAccessMode"] = LaunchArrayAccessMode
    for setting in SETTINGS.values():
        values[setting.name] = setting.initial()
