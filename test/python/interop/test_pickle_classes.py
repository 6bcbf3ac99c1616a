"""Every public class: its objects come back from a pickle, or an error says what to send."""

import enum
import importlib
import inspect
import json
import os
import pickle
import subprocess
import sys

import pytest

import pickle_cases
import pickle_registry
import warp as wp

MODULES = (
    *("warp", "warp.fem", "warp.sparse", "warp.optim", "warp.optim.linear", "warp.autograd"),
    *("warp.geometry", "warp.distributed", "warp.utils"),
)
CHILD = """
import json, pickle, sys, traceback
import pickle_cases
found = {}
for name, data in pickle.loads(sys.stdin.buffer.read()).items():
    try:
        found[name] = pickle_cases.facts(pickle.loads(data))
    except Exception:
        found[name] = traceback.format_exc()
print(json.dumps(found))
"""


def picklers():
    found = {"pickle": pickle}
    try:
        import cloudpickle
    except ImportError:
        return found
    return {**found, "cloudpickle": cloudpickle}


# Objects that write to their arrays, which are read-only in the memory of Ray.
WRITING = {"fsai", "cg", "cr", "bicgstab", "gmres", "adam", "sgd", "lbfgs"}


def through_ray(objects):
    """The facts of copies that a task of Ray finds; what writes to its arrays goes as bytes."""
    ray = pytest.importorskip("ray")
    ray.init(num_cpus=1, include_dashboard=False, log_to_driver=False, logging_level="error")
    try:
        task = ray.remote(pickle_cases.facts)
        of_bytes = ray.remote(lambda data: pickle_cases.facts(pickle.loads(data)))
        waiting = {
            name: of_bytes.remote(pickle.dumps(one))
            if name in WRITING
            else task.remote(ray.put(one))
            for name, one in objects.items()
        }
        return {name: ray.get(one, timeout=200) for name, one in waiting.items()}
    finally:
        ray.shutdown()


def through_dask(objects):
    """The facts of copies that a process of Dask finds."""
    dask = pytest.importorskip("dask")
    wrapped = [dask.delayed(one, name=name, traverse=False) for name, one in objects.items()]
    tasks = [dask.delayed(pickle_cases.facts)(one) for one in wrapped]
    return dict(zip(objects, dask.compute(*tasks, scheduler="processes", num_workers=1)))


@pytest.fixture(scope="module", params=[*picklers(), "ray", "dask"])
def copies(request):
    """The facts of the copies in another process, by name of the case."""
    through = {"ray": through_ray, "dask": through_dask}.get(request.param)
    if through:
        objects = {name: pickle_registry.make(name) for name in pickle_registry.CASES}
        with pytest.MonkeyPatch.context() as changed:
            changed.setenv("PYTHONPATH", os.pathsep.join(sys.path))
            return json.loads(json.dumps(through(objects)))
    pickler = picklers()[request.param]
    data, found = {}, {}
    for name in pickle_registry.CASES:
        try:
            data[name] = pickler.dumps(pickle_registry.make(name))
        except Exception as problem:
            found[name] = repr(problem)
    done = subprocess.run(
        [sys.executable, "-c", CHILD],
        input=pickle.dumps(data),
        env={**os.environ, "PYTHONPATH": os.pathsep.join(sys.path)},
        capture_output=True,
        timeout=200,
    )
    assert done.returncode == 0, done.stderr.decode()[-2000:]
    return found | json.loads(done.stdout.decode().splitlines()[-1])


@pytest.mark.parametrize("name", pickle_registry.CASES)
def test_copies_do_what_the_original_does(copies, name):
    wanted = json.loads(json.dumps(pickle_cases.facts(pickle_registry.make(name))))
    assert copies[name] == wanted, copies[name]


@pytest.mark.parametrize("name", pickle_registry.STAYS)
def test_an_error_says_what_to_send(name):
    value = pickle_registry.make(name)
    for pickler in picklers().values():
        with pytest.raises(TypeError, match="cannot pickle ") as caught:
            pickler.dumps(value)
        assert pickle_registry.STAYS[name][1] in str(caught.value)


# Values of kernels, helpers of `with` blocks, and classes to derive from or to annotate with.
NO_OBJECTS = {
    *("BvhQuery", "BvhQueryTiled", "HashGridQuery", "MeshQuery", "MeshQueryAABBTiled"),
    *("MeshQueryPoint", "MeshQueryRay", "Sample", "Sample_f64", "Domain", "Field", "ref", "handle"),
    *("fixedarray", "Element", "Allocator", "Logger", "StructInstance", "IsoSurfaceBase"),
    # CUDA alone; `test_pickling.py` has arrays of GPUs.
    *("Event", "Stream", "CudaManagedAllocator"),
    # Memory of Fabric is another program's.
    *("fabricarray", "indexedfabricarray"),
}


def public_classes():
    found = {}
    for name in MODULES:
        module = importlib.import_module(name)
        for one in dir(module):
            value = None if one.startswith("_") else getattr(module, one)
            if inspect.isclass(value) and value.__module__.startswith("warp."):
                found.setdefault(value, f"{name}.{one}")
    return found


def test_every_public_class_has_a_case():
    """Types of elements, enumerations and errors have tests of their own."""
    names = [*pickle_registry.CASES, *pickle_registry.STAYS]
    objects = [pickle_registry.make(name) for name in names]
    left = []
    for cls, name in public_classes().items():
        composite = hasattr(cls, "_wp_scalar_type_") or issubclass(cls, wp.types.scalar_base)
        plain = composite or issubclass(cls, (enum.Enum, BaseException))
        helper = cls.__name__.startswith("Scoped") or cls.__name__ in NO_OBJECTS
        if not plain and not helper and not any(isinstance(one, cls) for one in objects):
            left.append(name)
    assert not left, left
