"""The interface for libraries that build on Warp: types, generated functions, adjoints, captures.

`warp.sparse`, `warp.optim`, `warp.utils` and `warp.render` stand on this module and on the public
names of `warp` alone, and libraries elsewhere can do the same. docs/extend.md lists the names by
topic, with an example of a whole library.
"""

from warp._src import errors as errors
from warp._src.arguments import checked as checked
from warp._src.arguments import shown as shown
from warp._src.arrays.recording import is_differentiating as is_differentiating
from warp._src.arrays.recording import is_recording as is_recording
from warp._src.arrays.recording import measured_by as measured_by
from warp._src.arrays.recording import note_writes as note_writes
from warp._src.arrays.recording import record_adjoint as record_adjoint
from warp._src.arrays.recording import unrecorded as unrecorded
from warp._src.derivatives.functions import gradient_by as gradient_by
from warp._src.devices.paused_captures import capture_pause as capture_pause
from warp._src.devices.paused_captures import capture_resume as capture_resume
from warp._src.devices.paused_captures import is_capturing as is_capturing
from warp._src.kernels.descriptions import Description as Description
from warp._src.kernels.descriptions import OnField as OnField
from warp._src.kernels.descriptions import Operator as Operator
from warp._src.kernels.descriptions import Recast as Recast
from warp._src.kernels.descriptions import Static as Static
from warp._src.kernels.inspection import place_of as place_of
from warp._src.kernels.inspection import remembered as remembered
from warp._src.kernels.inspection import syntax_of as syntax_of
from warp._src.kernels.inspection import type_of_local as type_of_local
from warp._src.kernels.made_functions import function_from_text as function_from_text
from warp._src.kernels.made_functions import function_from_tree as function_from_tree
from warp._src.kernels.made_functions import transformed_function as transformed_function
from warp._src.logger import notice as notice
from warp._src.types.annotations import annotations_of as annotations_of
from warp._src.types.dtypes import canonical as canonical
from warp._src.types.dtypes import is_array as is_array
from warp._src.types.dtypes import type_is_array as type_is_array
from warp._src.types.dtypes import type_is_matrix as type_is_matrix
from warp._src.types.dtypes import type_is_quaternion as type_is_quaternion
from warp._src.types.dtypes import type_is_struct as type_is_struct
from warp._src.types.dtypes import type_is_transformation as type_is_transformation
from warp._src.types.dtypes import type_is_vector as type_is_vector
from warp._src.types.dtypes import type_repr as type_repr
from warp._src.types.dtypes import type_scalar_type as type_scalar_type
from warp._src.types.dtypes import type_size as type_size
from warp._src.types.dtypes import types_equal as types_equal
from warp._src.types.structs import struct_from_fields as struct_from_fields
from warp._src.version import calling_frame as calling_frame
