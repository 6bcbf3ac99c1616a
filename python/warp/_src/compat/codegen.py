"""`warp._src.codegen`: the error classes, which packages catch under this name."""

from warp._src.errors import WarpCodegenAttributeError as WarpCodegenAttributeError
from warp._src.errors import WarpCodegenError as WarpCodegenError
from warp._src.errors import WarpCodegenIndexError as WarpCodegenIndexError
from warp._src.errors import WarpCodegenKeyError as WarpCodegenKeyError
from warp._src.errors import WarpCodegenTypeError as WarpCodegenTypeError
from warp._src.errors import WarpCodegenValueError as WarpCodegenValueError
from warp._src.types.structs import StructInstance as StructInstance
