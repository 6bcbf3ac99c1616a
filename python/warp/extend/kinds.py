"""Kinds of arguments for `warp.extend.checked`: in words, and which values are of them.

A kind is a `Kind`; `a | b` is a kind of either. The constants are the kinds that functions of this
package take, such as `ARRAY`, `COUNT`, `NUMBER` and `TEXT`.

Example:
    >>> import warp as wp
    >>> from warp.extend import kinds
    >>> (kinds.ARRAY | kinds.NUMBER).wanted
    'an array or a finite number'
    >>> kinds.COUNT.fits(3), kinds.COUNT.fits(-1)
    (True, False)
"""

from warp._src.argument_kinds import ANYTHING as ANYTHING
from warp._src.argument_kinds import ARRAY as ARRAY
from warp._src.argument_kinds import ARRAYS as ARRAYS
from warp._src.argument_kinds import AXES as AXES
from warp._src.argument_kinds import BETAS as BETAS
from warp._src.argument_kinds import BYTES as BYTES
from warp._src.argument_kinds import CALLABLE as CALLABLE
from warp._src.argument_kinds import COUNT as COUNT
from warp._src.argument_kinds import DATA as DATA
from warp._src.argument_kinds import DEVICE as DEVICE
from warp._src.argument_kinds import DICT as DICT
from warp._src.argument_kinds import DIM as DIM
from warp._src.argument_kinds import DIMS as DIMS
from warp._src.argument_kinds import DLPACK as DLPACK
from warp._src.argument_kinds import EVENT as EVENT
from warp._src.argument_kinds import FLAG as FLAG
from warp._src.argument_kinds import FUNCTION as FUNCTION
from warp._src.argument_kinds import GRADIENTS as GRADIENTS
from warp._src.argument_kinds import GRAPH as GRAPH
from warp._src.argument_kinds import GRAPH_MODE as GRAPH_MODE
from warp._src.argument_kinds import INTEGER as INTEGER
from warp._src.argument_kinds import JAX_CALLABLE as JAX_CALLABLE
from warp._src.argument_kinds import KERNEL as KERNEL
from warp._src.argument_kinds import LIST as LIST
from warp._src.argument_kinds import MATRIX as MATRIX
from warp._src.argument_kinds import MESHES as MESHES
from warp._src.argument_kinds import MODULE as MODULE
from warp._src.argument_kinds import MODULES as MODULES
from warp._src.argument_kinds import NAMES as NAMES
from warp._src.argument_kinds import NATIVE_GRAPH as NATIVE_GRAPH
from warp._src.argument_kinds import NONE as NONE
from warp._src.argument_kinds import NUMBER as NUMBER
from warp._src.argument_kinds import NUMBERS as NUMBERS
from warp._src.argument_kinds import OPERATOR as OPERATOR
from warp._src.argument_kinds import PAIR as PAIR
from warp._src.argument_kinds import PATH as PATH
from warp._src.argument_kinds import POINT as POINT
from warp._src.argument_kinds import POSITIVE as POSITIVE
from warp._src.argument_kinds import SHAPE as SHAPE
from warp._src.argument_kinds import SMALL as SMALL
from warp._src.argument_kinds import SOLVER as SOLVER
from warp._src.argument_kinds import SPARSE as SPARSE
from warp._src.argument_kinds import STREAM as STREAM
from warp._src.argument_kinds import TAPE as TAPE
from warp._src.argument_kinds import TEXT as TEXT
from warp._src.argument_kinds import TIMINGS as TIMINGS
from warp._src.argument_kinds import TRANSFORMS as TRANSFORMS
from warp._src.argument_kinds import TRANSLATION as TRANSLATION
from warp._src.argument_kinds import TRIPLES as TRIPLES
from warp._src.argument_kinds import TYPE as TYPE
from warp._src.argument_kinds import VALUE as VALUE
from warp._src.argument_kinds import VOLUME as VOLUME
from warp._src.argument_kinds import VOXEL as VOXEL
from warp._src.argument_kinds import Kind as Kind
from warp._src.argument_kinds import instance as instance
from warp._src.argument_kinds import named as named
from warp._src.argument_kinds import offers as offers
from warp._src.argument_kinds import sequence_of as sequence_of
