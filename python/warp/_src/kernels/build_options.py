"""Additions of a module to the native code of its kernels: `wp.ModuleBuildOptions`."""

from __future__ import annotations

import os

from warp._src.argument_kinds import NAMES, TEXT
from warp._src.arguments import checked


class ModuleBuildOptions:
    """Folders, texts and files that native functions need, as a module option.

    Kernels of a module whose option `extra_build_options` this is compile their functions of
    `wp.func_native` with it. A change after a kernel's first launch takes effect with the
    next `wp.set_module_options`.

    Args:
        extra_cuda_include_dirs, extra_cpu_include_dirs: absolute paths of folders with headers.
        extra_cuda_preamble, extra_cpu_preamble: C++ before each function, at the outermost scope.
        extra_build_dependencies: absolute paths of files; kernels are compiled anew when the
            contents have changed.

    Raises:
        TypeError: a preamble is no string.

    Example:
        >>> import warp as wp
        >>> options = wp.ModuleBuildOptions(extra_cpu_preamble="#define LIMIT 4")
        >>> wp.set_module_options({"extra_build_options": options})
    """

    @checked(
        extra_cuda_include_dirs=NAMES,
        extra_cpu_include_dirs=NAMES,
        extra_cuda_preamble=TEXT,
        extra_cpu_preamble=TEXT,
        extra_build_dependencies=NAMES,
    )
    def __init__(
        self,
        *,
        extra_cuda_include_dirs=None,
        extra_cpu_include_dirs=None,
        extra_cuda_preamble: str = "",
        extra_cpu_preamble: str = "",
        extra_build_dependencies=None,
    ):
        for name, text in (("cuda", extra_cuda_preamble), ("cpu", extra_cpu_preamble)):
            if not isinstance(text, str):
                raise TypeError(
                    f"extra_{name}_preamble must be a str, but got '{type(text).__name__}'"
                )
        self.extra_cuda_include_dirs = list(extra_cuda_include_dirs or ())
        self.extra_cpu_include_dirs = list(extra_cpu_include_dirs or ())
        self.extra_cuda_preamble = extra_cuda_preamble
        self.extra_cpu_preamble = extra_cpu_preamble
        self.extra_build_dependencies = list(extra_build_dependencies or ())

    def merged(self, *others: ModuleBuildOptions) -> ModuleBuildOptions:
        """New options with what these and then the others have; paths occur once.

        Raises:
            TypeError: one of the others is something else.
        """
        made = ModuleBuildOptions()
        for one in (self, *others):
            if not isinstance(one, ModuleBuildOptions):
                raise TypeError(f"expects ModuleBuildOptions, but got '{type(one).__name__}'")
            for name, value in vars(one).items():
                before = getattr(made, name)
                if isinstance(value, str):
                    joint = "\n" if before and value and not before.endswith("\n") else ""
                    setattr(made, name, before + joint + value)
                    continue
                known = {os.fspath(path) for path in before}
                before += [path for path in value if os.fspath(path) not in known]
        return made


class Build:
    """The options of compilers, with everything read: later changes of the options do nothing.

    Attributes:
        text: C++ that comes before functions; its comments change with the files.
        cpu_folders, gpu_folders: where headers are.
    """

    def __init__(self, options: ModuleBuildOptions | None = None):
        options = options or ModuleBuildOptions()
        self.cpu_folders = _paths("extra_cpu_include_dirs", options, "folder")
        self.gpu_folders = _paths("extra_cuda_include_dirs", options, "folder")
        files = _paths("extra_build_dependencies", options, "file")
        marks = [*map(_mark, files), *self.cpu_folders, *self.gpu_folders]
        gpu, cpu = options.extra_cuda_preamble, options.extra_cpu_preamble
        self.text = "".join(f"// {mark}\n" for mark in marks)
        if gpu or cpu:
            self.text += f"#ifdef __CUDACC_RTC__\n{gpu}\n#else\n{cpu}\n#endif\n"


def _mark(path) -> str:
    """A file and its contents, in a line."""
    import hashlib

    with open(path, "rb") as file:
        return f"{path} {hashlib.sha256(file.read()).hexdigest()}"


def _paths(name, options, kind) -> list[str]:
    """The paths of an attribute.

    Raises:
        ValueError: one is not absolute, or there is no such folder or file.
    """
    paths = [os.fspath(path) for path in getattr(options, name)]
    for path in paths:
        there = os.path.isdir(path) if kind == "folder" else os.path.isfile(path)
        if not (os.path.isabs(path) and there):
            raise ValueError(f"{name} expects absolute paths of {kind}s, but got '{path}'")
    return paths
