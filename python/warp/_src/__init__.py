"""The implementation of the package. No module imports one that needs it, not even in functions.

    config, errors, version   settings, exceptions, who calls the package
    forks         what a fork waits for
    types         scalars, vectors, matrices, structs, annotations; `native`: the compiler's types
    devices       devices, streams, memory, allocators, graphs, start of the runtime (`runtime`)
    arrays        `array`: the class, with views, operators, protocols, gradients, data, copies;
                  `create`, `indexed`; `observers`, `versions`: who sees what is done with memory
    interop       DLPack, PyTorch, JAX; `exchange`: what all exchanges share
    language      builtins at Python scope, and what of the language is written in itself
    frontend      from a Python function to a module of the dialect
    kernels       `kernel`, `function`, `launch`, `maps`, modules and their options, saved code;
                  `hooks`: what launches of some kernels do besides (`blocks`, `constants`,
                  `handle_checks`); `call`: a launch with everything it was given
    derivatives   `kernel_derivatives`: adjoints and tangents of a kernel; `tape`, its records and
                  its backward pass; `functions`: derivatives that users write
    autograd      Jacobians, forward mode, checkpoints, checks, for `wp.autograd`
    optim         optimisers, for `wp.optim`; `linear`: solvers of linear systems
    utils         scans, sorts, sums and casts, for `wp.utils`
    sparse        sparse matrices, for `wp.sparse`
    logger        where lines go that are for the user

`optim`, `utils`, `sparse` and `render` are libraries: they use the public names of `warp` and
`warp.extend`, and nothing of this package but their own part. `kernels.made_functions`,
`arrays.recording` and `devices.paused_captures` are there for libraries.

Arrays are below kernels, and what arrays do by kernels is put into `arrays.hooks`. The kernel
language's own functions use `language.namespace` in place of `warp`. Modules that few programs need
(the front end before the first kernel, backward passes, `autograd`, `optim`) and other libraries
are imported in functions.
"""

import os

# Names of the peer's private modules that public packages use are in one folder. They are found
# under this package, as those packages spell them, and imported when somebody asks for them.
__path__.append(os.path.join(__path__[0], "compat"))
_COMPAT = frozenset(
    ("build", "codegen", "context", "fabric", "lang", "logger", "thirdparty", "utils")
)


def __getattr__(name):
    if name not in _COMPAT:
        raise AttributeError(f"module '{__name__}' has no attribute '{name}'")
    import importlib

    return importlib.import_module(f"{__name__}.{name}")
