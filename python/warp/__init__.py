"""Kernels in Python, compiled through an MLIR dialect for CPU and GPU.

    import warp as wp

    @wp.kernel
    def scale(x: wp.array(dtype=float), s: float):
        i = wp.tid()
        x[i] = x[i] * s

    x = wp.ones(1000)
    wp.launch(scale, dim=1000, inputs=[x, 2.0])
    print(x.numpy())

This file lists the public names; the implementation is in `warp._src`. Imports under
`TYPE_CHECKING` and builtins of the kernel language (`wp.sin`, `wp.dot`, ...) happen when they are
first asked for.
"""

import typing as _typing

from warp import config as config
from warp._src.arrays.array import array as array
from warp._src.arrays.array import array1d as array1d
from warp._src.arrays.array import array2d as array2d
from warp._src.arrays.array import array3d as array3d
from warp._src.arrays.array import array4d as array4d
from warp._src.arrays.copies import clone as clone
from warp._src.arrays.copies import copy as copy
from warp._src.arrays.copies import empty_like as empty_like
from warp._src.arrays.create import empty as empty
from warp._src.arrays.create import from_ipc_handle as from_ipc_handle
from warp._src.arrays.create import from_numpy as from_numpy
from warp._src.arrays.create import from_ptr as from_ptr
from warp._src.arrays.create import full as full
from warp._src.arrays.create import full_like as full_like
from warp._src.arrays.create import ones as ones
from warp._src.arrays.create import ones_like as ones_like
from warp._src.arrays.create import zeros as zeros
from warp._src.arrays.create import zeros_like as zeros_like
from warp._src.arrays.indexed import indexedarray as indexedarray
from warp._src.arrays.indexed import indexedarray1d as indexedarray1d
from warp._src.arrays.indexed import indexedarray2d as indexedarray2d
from warp._src.arrays.indexed import indexedarray3d as indexedarray3d
from warp._src.arrays.indexed import indexedarray4d as indexedarray4d
from warp._src.beside import check as _check
from warp._src.config import LOG_DEBUG as LOG_DEBUG
from warp._src.config import LOG_ERROR as LOG_ERROR
from warp._src.config import LOG_INFO as LOG_INFO
from warp._src.config import LOG_WARNING as LOG_WARNING
from warp._src.config import DeterministicMode as DeterministicMode
from warp._src.derivatives.functions import adjoint as adjoint
from warp._src.derivatives.functions import custom_jvp as custom_jvp
from warp._src.derivatives.functions import custom_vjp as custom_vjp
from warp._src.derivatives.functions import fixed_point as fixed_point
from warp._src.derivatives.functions import func_grad as func_grad
from warp._src.derivatives.functions import func_replay as func_replay
from warp._src.derivatives.functions import grad as grad
from warp._src.derivatives.functions import hessian as hessian
from warp._src.derivatives.tape import Tape as Tape
from warp._src.devices.allocators import Allocator as Allocator
from warp._src.devices.allocators import CudaManagedAllocator as CudaManagedAllocator
from warp._src.devices.allocators import ScopedAllocator as ScopedAllocator
from warp._src.devices.allocators import get_device_allocator as get_device_allocator
from warp._src.devices.allocators import set_cuda_allocator as set_cuda_allocator
from warp._src.devices.allocators import set_device_allocator as set_device_allocator
from warp._src.devices.devices import Device as Device
from warp._src.devices.devices import DeviceLike as DeviceLike
from warp._src.devices.devices import get_cuda_device as get_cuda_device
from warp._src.devices.devices import get_cuda_device_count as get_cuda_device_count
from warp._src.devices.devices import get_cuda_devices as get_cuda_devices
from warp._src.devices.devices import get_cuda_driver_version as get_cuda_driver_version
from warp._src.devices.devices import get_cuda_toolkit_version as get_cuda_toolkit_version
from warp._src.devices.devices import get_device as get_device
from warp._src.devices.devices import get_devices as get_devices
from warp._src.devices.devices import get_preferred_device as get_preferred_device
from warp._src.devices.devices import get_stream as get_stream
from warp._src.devices.devices import is_cpu_available as is_cpu_available
from warp._src.devices.devices import is_cuda_available as is_cuda_available
from warp._src.devices.devices import is_device_available as is_device_available
from warp._src.devices.devices import map_cuda_device as map_cuda_device
from warp._src.devices.devices import set_device as set_device
from warp._src.devices.devices import set_stream as set_stream
from warp._src.devices.devices import synchronize as synchronize
from warp._src.devices.devices import synchronize_device as synchronize_device
from warp._src.devices.devices import synchronize_event as synchronize_event
from warp._src.devices.devices import synchronize_stream as synchronize_stream
from warp._src.devices.devices import unmap_cuda_device as unmap_cuda_device
from warp._src.devices.graphs import CaptureMode as CaptureMode
from warp._src.devices.graphs import Graph as Graph
from warp._src.devices.graphs import ScopedCapture as ScopedCapture
from warp._src.devices.graphs import capture_begin as capture_begin
from warp._src.devices.graphs import capture_debug_dot_print as capture_debug_dot_print
from warp._src.devices.graphs import capture_end as capture_end
from warp._src.devices.graphs import capture_if as capture_if
from warp._src.devices.graphs import capture_launch as capture_launch
from warp._src.devices.graphs import capture_while as capture_while
from warp._src.devices.graphs import (
    is_conditional_graph_supported as is_conditional_graph_supported,
)
from warp._src.devices.memory import MemoryKind as MemoryKind
from warp._src.devices.memory import ScopedMempool as ScopedMempool
from warp._src.devices.memory import ScopedMempoolAccess as ScopedMempoolAccess
from warp._src.devices.memory import ScopedPeerAccess as ScopedPeerAccess
from warp._src.devices.memory import can_access as can_access
from warp._src.devices.memory import event_from_ipc_handle as event_from_ipc_handle
from warp._src.devices.memory import get_mempool_release_threshold as get_mempool_release_threshold
from warp._src.devices.memory import get_mempool_used_mem_current as get_mempool_used_mem_current
from warp._src.devices.memory import get_mempool_used_mem_high as get_mempool_used_mem_high
from warp._src.devices.memory import is_mempool_access_enabled as is_mempool_access_enabled
from warp._src.devices.memory import is_mempool_access_supported as is_mempool_access_supported
from warp._src.devices.memory import is_mempool_enabled as is_mempool_enabled
from warp._src.devices.memory import is_mempool_supported as is_mempool_supported
from warp._src.devices.memory import is_peer_access_enabled as is_peer_access_enabled
from warp._src.devices.memory import is_peer_access_supported as is_peer_access_supported
from warp._src.devices.memory import set_mempool_access_enabled as set_mempool_access_enabled
from warp._src.devices.memory import set_mempool_enabled as set_mempool_enabled
from warp._src.devices.memory import set_mempool_release_threshold as set_mempool_release_threshold
from warp._src.devices.memory import set_peer_access_enabled as set_peer_access_enabled
from warp._src.devices.memory_tracker import ScopedMemoryTracker as ScopedMemoryTracker
from warp._src.devices.memory_tracker import print_memory_report as print_memory_report
from warp._src.devices.runtime import clear_kernel_cache as clear_kernel_cache
from warp._src.devices.runtime import clear_lto_cache as clear_lto_cache
from warp._src.devices.runtime import connect as _connect
from warp._src.devices.runtime import init as init
from warp._src.devices.saved_graphs import capture_load as capture_load
from warp._src.devices.saved_graphs import capture_load_from_bytes as capture_load_from_bytes
from warp._src.devices.saved_graphs import capture_save as capture_save
from warp._src.devices.scoped import ScopedDevice as ScopedDevice
from warp._src.devices.scoped import ScopedStream as ScopedStream
from warp._src.devices.scoped import ScopedTimer as ScopedTimer
from warp._src.devices.streams import Event as Event
from warp._src.devices.streams import Stream as Stream
from warp._src.devices.streams import get_event_elapsed_time as get_event_elapsed_time
from warp._src.devices.streams import record_event as record_event
from warp._src.devices.streams import wait_event as wait_event
from warp._src.devices.streams import wait_stream as wait_stream
from warp._src.errors import WarpCodegenAttributeError as WarpCodegenAttributeError
from warp._src.errors import WarpCodegenError as WarpCodegenError
from warp._src.errors import WarpCodegenIndexError as WarpCodegenIndexError
from warp._src.errors import WarpCodegenKeyError as WarpCodegenKeyError
from warp._src.errors import WarpCodegenOverflowError as WarpCodegenOverflowError
from warp._src.errors import WarpCodegenTypeError as WarpCodegenTypeError
from warp._src.errors import WarpCodegenValueError as WarpCodegenValueError
from warp._src.errors import WarpDeterminismError as WarpDeterminismError
from warp._src.errors import WarpError as WarpError
from warp._src.errors import WarpLaunchError as WarpLaunchError
from warp._src.interop.dlpack import from_dlpack as from_dlpack
from warp._src.interop.dlpack import to_dlpack as to_dlpack
from warp._src.interop.torch import device_from_torch as device_from_torch
from warp._src.interop.torch import device_to_torch as device_to_torch
from warp._src.interop.torch import dtype_from_torch as dtype_from_torch
from warp._src.interop.torch import dtype_to_torch as dtype_to_torch
from warp._src.interop.torch import from_torch as from_torch
from warp._src.interop.torch import stream_from_torch as stream_from_torch
from warp._src.interop.torch import stream_to_torch as stream_to_torch
from warp._src.interop.torch import to_torch as to_torch
from warp._src.kernels.aot import compile_aot_module as compile_aot_module
from warp._src.kernels.aot import load_aot_module as load_aot_module
from warp._src.kernels.build_options import ModuleBuildOptions as ModuleBuildOptions
from warp._src.kernels.decorator import kernel as kernel
from warp._src.kernels.function import Function as Function
from warp._src.kernels.function import func as func
from warp._src.kernels.function import func_native as func_native
from warp._src.kernels.kernel import Kernel as Kernel
from warp._src.kernels.launch import Launch as Launch
from warp._src.kernels.launch import launch as launch
from warp._src.kernels.maps import map as map
from warp._src.kernels.modules import Module as Module
from warp._src.kernels.modules import compile as compile
from warp._src.kernels.modules import force_load as force_load
from warp._src.kernels.modules import get_module as get_module
from warp._src.kernels.modules import get_module_options as get_module_options
from warp._src.kernels.modules import load_module as load_module
from warp._src.kernels.modules import set_module_options as set_module_options
from warp._src.kernels.overloads import overload as overload
from warp._src.kernels.tuning import get_cmake_dir as get_cmake_dir
from warp._src.kernels.tuning import get_cpu_kernel_cache_key as get_cpu_kernel_cache_key
from warp._src.kernels.tuning import get_cuda_kernel_properties as get_cuda_kernel_properties
from warp._src.kernels.tuning import get_cuda_max_cluster_dim as get_cuda_max_cluster_dim
from warp._src.kernels.tuning import get_cuda_supported_archs as get_cuda_supported_archs
from warp._src.kernels.tuning import get_include as get_include
from warp._src.kernels.tuning import get_suggested_block_size as get_suggested_block_size
from warp._src.types import dtypes as _types
from warp._src.types.annotations import address_of as address_of
from warp._src.types.annotations import fixedarray as fixedarray
from warp._src.types.annotations import ref as ref
from warp._src.types.constants import HALF_PI as HALF_PI
from warp._src.types.constants import INF as INF
from warp._src.types.constants import LN2 as LN2
from warp._src.types.constants import LN10 as LN10
from warp._src.types.constants import LOG2E as LOG2E
from warp._src.types.constants import LOG10E as LOG10E
from warp._src.types.constants import NAN as NAN
from warp._src.types.constants import PHI as PHI
from warp._src.types.constants import PI as PI
from warp._src.types.constants import TAU as TAU
from warp._src.types.constants import E as E
from warp._src.types.constants import constant as constant
from warp._src.types.constants import e as e
from warp._src.types.constants import half_pi as half_pi
from warp._src.types.constants import inf as inf
from warp._src.types.constants import ln2 as ln2
from warp._src.types.constants import ln10 as ln10
from warp._src.types.constants import log2e as log2e
from warp._src.types.constants import log10e as log10e
from warp._src.types.constants import nan as nan
from warp._src.types.constants import phi as phi
from warp._src.types.constants import pi as pi
from warp._src.types.constants import tau as tau
from warp._src.types.dtypes import Float as Float
from warp._src.types.dtypes import Int as Int
from warp._src.types.dtypes import Matrix as Matrix
from warp._src.types.dtypes import Quaternion as Quaternion
from warp._src.types.dtypes import Scalar as Scalar
from warp._src.types.dtypes import Transformation as Transformation
from warp._src.types.dtypes import Vector as Vector
from warp._src.types.dtypes import bfloat16 as bfloat16
from warp._src.types.dtypes import bool as bool
from warp._src.types.dtypes import float16 as float16
from warp._src.types.dtypes import float32 as float32
from warp._src.types.dtypes import float64 as float64
from warp._src.types.dtypes import handle as handle
from warp._src.types.dtypes import int8 as int8
from warp._src.types.dtypes import int16 as int16
from warp._src.types.dtypes import int32 as int32
from warp._src.types.dtypes import int64 as int64
from warp._src.types.dtypes import mat as mat
from warp._src.types.dtypes import matrix_from_cols as matrix_from_cols
from warp._src.types.dtypes import matrix_from_rows as matrix_from_rows
from warp._src.types.dtypes import spatial_matrix as spatial_matrix
from warp._src.types.dtypes import spatial_matrixd as spatial_matrixd
from warp._src.types.dtypes import spatial_matrixf as spatial_matrixf
from warp._src.types.dtypes import spatial_matrixh as spatial_matrixh
from warp._src.types.dtypes import spatial_vector as spatial_vector
from warp._src.types.dtypes import spatial_vectord as spatial_vectord
from warp._src.types.dtypes import spatial_vectorf as spatial_vectorf
from warp._src.types.dtypes import spatial_vectorh as spatial_vectorh
from warp._src.types.dtypes import uint8 as uint8
from warp._src.types.dtypes import uint16 as uint16
from warp._src.types.dtypes import uint32 as uint32
from warp._src.types.dtypes import uint64 as uint64
from warp._src.types.dtypes import vec as vec
from warp._src.types.native import ArrayType as ArrayType
from warp._src.types.numpy_types import dtype_from_numpy as dtype_from_numpy
from warp._src.types.numpy_types import dtype_to_numpy as dtype_to_numpy
from warp._src.types.structs import struct as struct
from warp._src.version import VERSION as VERSION

# Picklers look for what is there already.
# isort: off
from warp import types as types
from warp._src import pickling as _pickling
# isort: on

if _typing.TYPE_CHECKING:
    from warp import autograd as autograd
    from warp import build_experimental as build_experimental
    from warp import extend as extend
    from warp import fem as fem
    from warp import geometry as geometry
    from warp import optim as optim
    from warp import render as render
    from warp import sparse as sparse
    from warp import types as types
    from warp import utils as utils
    from warp._src.arrays.fabric import fabricarray as fabricarray
    from warp._src.arrays.fabric import fabricarrayarray as fabricarrayarray
    from warp._src.arrays.fabric import indexedfabricarray as indexedfabricarray
    from warp._src.arrays.fabric import indexedfabricarrayarray as indexedfabricarrayarray
    from warp._src.devices.diagnostics import print_diagnostics as print_diagnostics
    from warp._src.devices.timing import TIMING_ALL as TIMING_ALL
    from warp._src.devices.timing import TIMING_GRAPH as TIMING_GRAPH
    from warp._src.devices.timing import TIMING_KERNEL as TIMING_KERNEL
    from warp._src.devices.timing import TIMING_KERNEL_BUILTIN as TIMING_KERNEL_BUILTIN
    from warp._src.devices.timing import TIMING_MEMCPY as TIMING_MEMCPY
    from warp._src.devices.timing import TIMING_MEMSET as TIMING_MEMSET
    from warp._src.devices.timing import ScopedCudaProfiler as ScopedCudaProfiler
    from warp._src.devices.timing import TimingResult as TimingResult
    from warp._src.devices.timing import cuda_profiler_start as cuda_profiler_start
    from warp._src.devices.timing import cuda_profiler_stop as cuda_profiler_stop
    from warp._src.devices.timing import timing_begin as timing_begin
    from warp._src.devices.timing import timing_end as timing_end
    from warp._src.devices.timing import timing_print as timing_print
    from warp._src.geometry.bvh import Bvh as Bvh
    from warp._src.geometry.bvh import is_cubql_available as is_cubql_available
    from warp._src.geometry.grid import HashGrid as HashGrid
    from warp._src.geometry.grid_queries import HashGridQuery as HashGridQuery
    from warp._src.geometry.mesh import Mesh as Mesh
    from warp._src.geometry.mesh_queries import MeshQueryPoint as MeshQueryPoint
    from warp._src.geometry.mesh_queries import MeshQueryRay as MeshQueryRay
    from warp._src.geometry.surfaces.marching_cubes import IsoSurfaceMarchingCubes as MarchingCubes
    from warp._src.geometry.tile_queries import BvhQueryTiled as BvhQueryTiled
    from warp._src.geometry.tile_queries import MeshQueryAABBTiled as MeshQueryAABBTiled
    from warp._src.geometry.tree_queries import BvhQuery as BvhQuery
    from warp._src.geometry.tree_queries import MeshQuery as MeshQuery
    from warp._src.geometry.tree_queries import MeshQueryAABB as MeshQueryAABB
    from warp._src.geometry.volumes.volume import Volume as Volume
    from warp._src.interop.jax import device_from_jax as device_from_jax
    from warp._src.interop.jax import device_to_jax as device_to_jax
    from warp._src.interop.jax import dtype_from_jax as dtype_from_jax
    from warp._src.interop.jax import dtype_to_jax as dtype_to_jax
    from warp._src.interop.jax import from_jax as from_jax
    from warp._src.interop.jax import to_jax as to_jax
    from warp._src.interop.jax_callable import JaxCallableGraphMode as JaxCallableGraphMode
    from warp._src.interop.jax_callable import JaxModulePreloadMode as JaxModulePreloadMode
    from warp._src.interop.jax_callable import (
        clear_jax_callable_graph_cache as clear_jax_callable_graph_cache,
    )
    from warp._src.interop.jax_callable import jax_callable as jax_callable
    from warp._src.interop.jax_kernel import jax_kernel as jax_kernel
    from warp._src.interop.paddle import device_from_paddle as device_from_paddle
    from warp._src.interop.paddle import device_to_paddle as device_to_paddle
    from warp._src.interop.paddle import dtype_from_paddle as dtype_from_paddle
    from warp._src.interop.paddle import dtype_to_paddle as dtype_to_paddle
    from warp._src.interop.paddle import from_paddle as from_paddle
    from warp._src.interop.paddle import stream_from_paddle as stream_from_paddle
    from warp._src.interop.paddle import to_paddle as to_paddle
    from warp._src.kernels.manifest import KernelManifest as KernelManifest
    from warp._src.kernels.manifest import Manifest as Manifest
    from warp._src.kernels.manifest import manifest as manifest
    from warp._src.kernels.tiled import launch_tiled as launch_tiled
    from warp._src.language.symmetric import sym_fn3 as sym_fn3
    from warp._src.logger import Logger as Logger
    from warp._src.logger import ScopedLogger as ScopedLogger
    from warp._src.logger import ScopedLogLevel as ScopedLogLevel
    from warp._src.logger import get_logger as get_logger
    from warp._src.logger import set_logger as set_logger
    from warp._src.textures.texture import Texture as Texture
    from warp._src.textures.texture import Texture1D as Texture1D
    from warp._src.textures.texture import Texture2D as Texture2D
    from warp._src.textures.texture import Texture3D as Texture3D
    from warp._src.textures.texture import TextureAddressMode as TextureAddressMode
    from warp._src.textures.texture import TextureFilterMode as TextureFilterMode
    from warp._src.utils.transforms import transform_expand as transform_expand

__version__ = VERSION
_check(__path__[0])
globals().update(_types.NAMED_TYPES)
_connect()


def __getattr__(name):
    from warp._src.language.public import find

    return find(name)


def __dir__():
    from warp._src.language.public import names

    return names(globals())
