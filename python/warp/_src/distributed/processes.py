"""Many processes of a host: shared memory, warm kernel caches, progress bars that stop alike."""

from __future__ import annotations

import atexit
import contextlib
import mmap
import os
import signal
import sys
import tempfile
import weakref

import warp as wp
from warp._src import errors
from warp._src.distributed.communicator import resolve
from warp._src.distributed.failures import DistributedError
from warp._src.types import dtypes

# Files of shared memory that this process has made, by name.
_files: dict = {}
# Arrays on GPUs that this process has shared, by handle.
_arrays: weakref.WeakValueDictionary = weakref.WeakValueDictionary()


def _path(name) -> str:
    folder = "/dev/shm" if os.path.isdir("/dev/shm") else tempfile.gettempdir()
    return os.path.join(folder, name)


@atexit.register
def _remove_files() -> None:
    for name, process in list(_files.items()):
        if process == os.getpid():
            with contextlib.suppress(OSError):
                os.unlink(_path(name))


class Shared:
    """A handle of memory that other processes of the host use; it pickles.

    `open` gives an array over the same memory there. The process that made it keeps the memory, and
    `close` gives it back.
    """

    def __init__(self, name, dtype, shape, handle=None, device="cpu", array=None):
        self.name, self.dtype, self.shape = name, dtype, tuple(shape)
        self.handle, self.device = handle, device
        # Memory of a GPU, in the process that made it: CUDA opens no handle there.
        self.array = array
        if array is not None:
            _arrays[handle] = array

    def __getstate__(self):
        return {**self.__dict__, "array": None}

    def open(self):
        """The array, over the same memory.

        Raises:
            FileNotFoundError: the process that made it has given it back.
        """
        array = _arrays.get(self.handle)
        if array is not None:
            return array.view(self.dtype)
        if self.handle is not None:
            return wp.from_ipc_handle(
                self.handle, dtype=self.dtype, shape=self.shape, device=self.device
            )
        try:
            with open(_path(self.name), "r+b") as file:
                return _array_of(mmap.mmap(file.fileno(), 0), self.dtype, self.shape)
        except FileNotFoundError:
            raise FileNotFoundError(
                f"wd.share: no shared memory '{self.name}' here: the process that shared it has "
                "given it back, or is on another host"
            ) from None

    def close(self) -> None:
        """Gives the memory back once no process has an array over it; no other can open it."""
        self.array = None
        _arrays.pop(self.handle, None)
        if _files.get(self.name) == os.getpid():
            del _files[self.name]
            with contextlib.suppress(FileNotFoundError):
                os.unlink(_path(self.name))


def _array_of(memory, dtype, shape):
    import numpy as np

    data = np.frombuffer(memory, np.uint8)
    lent = wp.array(data, dtype=wp.uint8, device="cpu", copy=False)
    strides, step = [], dtypes.type_size_in_bytes(dtype)
    for extent in reversed(shape):
        strides.insert(0, step)
        step *= extent
    return lent._view(0, tuple(shape), tuple(strides), dtype)


def share(array):
    """An array in memory that other processes of the host can use, and its handle.

    The elements are copied once, to memory that can be shared; an array on a GPU that is there
    already, outside of a pool, stays where it is.

    Returns:
        The array to use from now on, and a `Shared` to send to others, whose `open` gives theirs.

    Example:
        >>> import warp as wp
        >>> import warp.distributed as wd
        >>> x, handle = wd.share(wp.ones(4, dtype=float, device="cpu"))
        >>> y = handle.open()
        >>> x.fill_(2.0)
        >>> print(y.numpy())
        [2. 2. 2. 2.]
        >>> handle.close()
    """
    if not isinstance(array, wp.array):
        raise errors.WarpTypeError(f"wd.share expects an array, but got '{type(array).__name__}'")
    if array.device.is_cuda:
        try:
            handle = array.ipc_handle()
        except RuntimeError:
            with wp.ScopedMempool(array.device, False):
                array = wp.clone(array)
            # Others do not wait for the stream of the copy.
            wp.synchronize_device(array.device)
            handle = array.ipc_handle()
        return array, Shared("", array.dtype, array.shape, handle, str(array.device), array)
    name = f"warp-share-{os.getpid()}-{os.urandom(6).hex()}"
    size = max(array.size * dtypes.type_size_in_bytes(array.dtype), 1)
    with open(os.open(_path(name), os.O_RDWR | os.O_CREAT | os.O_EXCL, 0o600), "r+b") as file:
        os.truncate(file.fileno(), size)
        made = _array_of(mmap.mmap(file.fileno(), size), array.dtype, array.shape)
    _files[name] = os.getpid()
    if array.size:
        wp.copy(made, array)
    return made, Shared(name, array.dtype, array.shape)


def warm(kernels, device=None, comm=None) -> None:
    """Compiles kernels once on each host, before any rank launches them.

    Args:
        kernels: kernels, or modules of kernels.
        device: by default that of the communicator.

    Raises:
        DistributedError: another rank cannot compile them; that one raises its own error.
    """
    comm = resolve(comm)
    device = wp.get_device(device or comm.device)
    for turn in (True, False):
        problem = None
        if (comm.local_rank == 0) == turn:
            try:
                _load(kernels, device)
            except Exception as error:
                problem = error
        texts = comm.gather_objects(None if problem is None else str(problem).partition("\n")[0])
        if problem is not None:
            raise problem
        for rank, text in enumerate(texts):
            if text is not None:
                raise DistributedError(
                    f"rank {comm.rank}: warm: rank {rank} cannot compile the kernels: {text}"
                )


def _load(kernels, device) -> None:
    from warp._src.kernels.modules import load_kernels

    natives = []
    for one in kernels if isinstance(kernels, (list, tuple)) else [kernels]:
        if isinstance(one, wp.Kernel):
            natives += one.specializations if one.is_generic else [one.prepare()]
        else:
            wp.load_module(one, device)
    load_kernels(natives, device)


def progress(iterable, comm=None, checkpoint=None, **options):
    """Iterates with a progress bar on rank 0, until Ctrl-C asks to stop.

    The first Ctrl-C ends all ranks of the host after the same step, the second at once.

    Args:
        iterable: steps, as many on each rank.
        checkpoint: called without arguments before the program stops.
        options: for `tqdm`, which draws the bar if it is installed.

    Raises:
        KeyboardInterrupt: after the last step and the checkpoint.
    """
    comm = resolve(comm)
    steps = _bar(iterable, options) if comm.rank == 0 else iterable
    former = signal.getsignal(signal.SIGINT)
    pressed: list = []

    def ask(number, frame):
        if pressed:
            comm.abort(130)
        pressed.append(number)

    try:
        signal.signal(signal.SIGINT, ask)
    except ValueError:
        # Only the main thread gets signals.
        former = None
    last = None
    try:
        for number, step in enumerate(steps):
            if pressed and len(pressed) == 1:
                # Ranks that wait for each other's messages are less than `size` steps apart.
                comm.log.request_stop(number + comm.size + 1)
                pressed.append(None)
            stop = comm.log.stop_step()
            if last is None and stop and number >= stop:
                last = max(comm.gather_objects(number))
            if last is not None and number >= last:
                break
            yield step
    finally:
        if former is not None:
            signal.signal(signal.SIGINT, former)
        comm.log.clear_stop()
    if last is not None:
        if checkpoint is not None:
            checkpoint()
        raise KeyboardInterrupt(f"rank {comm.rank}: stopped before step {last}")


def _bar(iterable, options):
    try:
        from tqdm import tqdm
    except ImportError:
        return iterable
    return tqdm(iterable, file=options.pop("file", sys.stderr), **options)
