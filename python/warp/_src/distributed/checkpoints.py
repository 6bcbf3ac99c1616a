"""Checkpoints: a file for each rank and array, and a manifest; read on any number of ranks."""

from __future__ import annotations

import contextlib
import json
import os
import shutil

import numpy as np

import warp as wp
from warp._src.distributed.communicator import resolve
from warp._src.distributed.failures import DistributedError
from warp._src.types.numpy_types import numpy_bfloat16

FORMAT = 1
_MANIFEST = "manifest.json"
# Advice about a file that cannot be written.
_FIX = "free space or give another folder"


def save(folder, comm=None, blocks=None, **state) -> None:
    """Writes arrays of all ranks to a folder, all or nothing.

    Files are written aside and the folder is renamed by rank 0 after a barrier, so that one that
    is there stays whole whatever happens.

    Args:
        folder: where to; one that is there is replaced.
        comm: by default that of `wd.init`.
        blocks: `Blocks` whose fields are among the state: these are saved without ghosts.
        state: arrays by name, split along the first axis; fields of `blocks`; or replicated
            values, which are taken from rank 0: NumPy arrays, numbers, strings and lists.

    Raises:
        DistributedError: a rank could not write, or has other names; all ranks raise it.
    """
    comm = resolve(comm)
    folder = os.fspath(folder)
    fields = _fields(comm, folder, state, blocks)
    aside = f"{folder}.writing"
    problem, facts = None, {}
    if comm.rank == 0:
        shutil.rmtree(aside, ignore_errors=True)
        try:
            os.makedirs(aside)
        except OSError as error:
            problem = f"{error}: {_FIX}"
    comm.barrier()
    for name, value in state.items():
        try:
            facts[name] = _write(aside, name, value, comm, blocks if name in fields else None)
        except TypeError as error:
            problem = problem or f"{error}: leave it out or pass one of these"
        except OSError as error:
            problem = problem or f"{error}: {_FIX}"
    found = comm.gather_objects((problem, facts))
    problems = [text for text, _ in found]
    if comm.rank == 0 and not any(problems):
        try:
            _publish(aside, folder, comm, state, [own for _, own in found], blocks)
        except OSError as error:
            problems[0] = f"{error}: {_FIX}"
    for rank, text in enumerate(comm.broadcast_object(problems)):
        if text:
            raise DistributedError(
                f"rank {comm.rank}: save to '{folder}': rank {rank} could not write, what was "
                f"there is still whole: {text}"
            )


def _fields(comm, folder, state, blocks) -> set:
    """Names of arrays that have the shape of a field on all ranks."""
    found = {name: _is_field(value, blocks) for name, value in state.items()}
    every = comm.gather_objects(found)
    for rank, one in enumerate(every):
        if one.keys() != every[0].keys():
            raise DistributedError(
                f"rank {comm.rank}: save to '{folder}': rank {rank} saves {sorted(one)}, but "
                f"rank 0 {sorted(every[0])}: pass the same names on all ranks"
            )
    return {name for name in found if all(one[name] for one in every)}


def _is_field(value, blocks) -> bool:
    if blocks is None or not isinstance(value, wp.array):
        return False
    lead = value.ndim - blocks.ndim
    return lead in (0, 1) and value.shape[lead:] == blocks.local


def _write(aside, name, value, comm, blocks):
    """Writes the rank's part of a value; gives facts about it.

    Args:
        blocks: those of a field, else None.
    """
    path = os.path.join(aside, f"{name}.{comm.rank}.npy")
    if isinstance(value, np.ndarray) and not value.dtype.hasobject:
        if comm.rank == 0:
            _write_file(path, value)
        return {"replicated": True}
    if not isinstance(value, wp.array):
        try:
            json.dumps(value)
        except (TypeError, ValueError):
            raise TypeError(
                f"'{name}' is {type(value).__name__}, not an array, number, text or list"
            ) from None
        return {"value": value}
    own = value if blocks is None else blocks.inner(value)
    values = own.numpy()
    _write_file(path, values)
    # Files of NumPy keep the width of bfloat16 alone.
    type_ = {"type": "bfloat16"} if values.dtype.name == "bfloat16" else {}
    return {"field": blocks is not None, "rows": int(own.shape[0]), **type_}


def _write_file(path, values) -> None:
    with open(path, "wb") as file:
        np.save(file, np.ascontiguousarray(values))
        file.flush()
        os.fsync(file.fileno())


def _publish(aside, folder, comm, state, facts, blocks) -> None:
    """Writes the manifest and puts the folder in place."""
    names = {}
    for name in state:
        own = [one[name] for one in facts]
        names[name] = own[0] if "field" not in own[0] else {
            **own[0],
            "rows": [one["rows"] for one in own],
        }  # fmt: skip
    manifest = {"format": FORMAT, "ranks": comm.size, "state": names}
    if blocks is not None:
        manifest["blocks"] = {"shape": blocks.shape, "ranks": blocks.ranks}
    with open(os.path.join(aside, _MANIFEST), "w") as file:
        json.dump(manifest, file, indent=1)
    former = f"{folder}.former"
    shutil.rmtree(former, ignore_errors=True)
    with contextlib.suppress(FileNotFoundError):
        os.rename(folder, former)
    os.rename(aside, folder)
    shutil.rmtree(former, ignore_errors=True)


def load(folder, comm=None, blocks=None) -> dict:
    """The rank's part of what `save` wrote, on this number of ranks.

    Split arrays come as NumPy arrays with the rows `rows_of(n, rank, size)`; fields of blocks as
    the cells that the rank owns in `blocks`, for `blocks.inner(field).assign`; replicated values
    whole.

    Raises:
        DistributedError: files are missing, cut off or of another version; all ranks raise it.
    """
    comm = resolve(comm)
    folder = os.fspath(folder)
    problem, state = None, {}
    try:
        with open(os.path.join(folder, _MANIFEST)) as file:
            manifest = json.load(file)
        if manifest.get("format") != FORMAT:
            raise ValueError(
                f"has format {manifest.get('format')}, but this version has {FORMAT}: load it with "
                "the version that wrote it"
            )
        for name, facts in manifest["state"].items():
            found = _read(folder, name, facts, manifest, comm, blocks)
            state[name] = (
                found if "type" not in facts else found.view(numpy_bfloat16() or np.uint16)
            )
    except (OSError, ValueError, KeyError, EOFError) as error:
        problem = " ".join(str(error).split())
    for rank, text in enumerate(comm.gather_objects(problem)):
        if text:
            raise DistributedError(
                f"rank {comm.rank}: load from '{folder}': rank {rank} cannot read it ({text})"
            )
    return state


def _read(folder, name, facts, manifest, comm, blocks):
    if "value" in facts:
        return facts["value"]

    def part(rank):
        path = os.path.join(folder, f"{name}.{rank}.npy")
        try:
            return np.load(path, mmap_mode="r")
        except ValueError as error:
            raise ValueError(
                f"{os.path.basename(path)} is damaged, {error}: load an older checkpoint"
            ) from None

    if "replicated" in facts:
        return np.array(part(0))
    if facts["field"]:
        return _read_field(part, manifest, name, blocks)
    from warp._src.distributed.operations import rows_of

    first, last = rows_of(sum(facts["rows"]), comm.rank, comm.size)
    found, start = [], 0
    for rank, count in enumerate(facts["rows"]):
        a, b = max(first - start, 0), min(last - start, count)
        if b > a or not found:
            rows = part(rank)
            if len(rows) != count:
                raise ValueError(f"{name}.{rank}.npy has {len(rows)} rows, but {count} were saved")
            found.append(rows[max(a, 0) : max(b, a, 0)])
        start += count
    return np.concatenate(found)


def _read_field(part, manifest, name, blocks):
    """The cells of a field that a rank owns, from the blocks of those who saved it."""
    from warp._src.distributed.operations import rows_of

    about = manifest["blocks"]
    if blocks is None:
        raise ValueError(f"field '{name}' needs `blocks`, of shape {about['shape']}")
    if list(blocks.shape) != list(about["shape"]):
        raise ValueError(
            f"field '{name}' has {about['shape']} cells, but the blocks have {list(blocks.shape)}"
        )
    whole = None
    ndim = blocks.ndim
    for rank in range(manifest["ranks"]):
        k = np.unravel_index(rank, about["ranks"])
        inside, outside, empty = [], [], False
        for axis in range(ndim):
            a, b = rows_of(blocks.shape[axis], int(k[axis]), about["ranks"][axis])
            low = max(a, blocks.offset[axis])
            high = min(b, blocks.offset[axis] + blocks.owned[axis])
            empty = empty or high <= low
            inside.append(slice(low - a, high - a))
            outside.append(slice(low - blocks.offset[axis], high - blocks.offset[axis]))
        if empty:
            continue
        values = part(rank)
        lead = _lead(values, k, about, blocks)
        if whole is None:
            inner = values.shape[lead + ndim :]
            whole = np.empty((*values.shape[:lead], *blocks.owned, *inner), values.dtype)
        before = (slice(None),) * lead
        whole[(*before, *outside)] = values[(*before, *inside)]
    return whole


def _lead(values, k, about, blocks) -> int:
    """Leading axes of a saved field, 0 or 1."""
    from warp._src.distributed.operations import rows_of

    extents = []
    for axis in range(blocks.ndim):
        a, b = rows_of(blocks.shape[axis], int(k[axis]), about["ranks"][axis])
        extents.append(b - a)
    return 0 if list(values.shape[: blocks.ndim]) == extents else 1
