"""Fields: discrete, uniform, implicit, of other geometries; test and trial functions."""

from warp._src.fem.fields.base import FieldLike as FieldLike
from warp._src.fem.fields.base import GeometryField as GeometryField
from warp._src.fem.fields.discrete import DiscreteField as DiscreteField
from warp._src.fem.fields.discrete import FieldRestriction as FieldRestriction
from warp._src.fem.fields.discrete import SpaceField as SpaceField
from warp._src.fem.fields.discrete import make_discrete_field as make_discrete_field
from warp._src.fem.fields.discrete import make_restriction as make_restriction
from warp._src.fem.fields.implicit import ImplicitField as ImplicitField
from warp._src.fem.fields.nonconforming import NonconformingField as NonconformingField
from warp._src.fem.fields.uniform import UniformField as UniformField
from warp._src.fem.fields.virtual import LocalTestField as LocalTestField
from warp._src.fem.fields.virtual import TestField as TestField
from warp._src.fem.fields.virtual import TrialField as TrialField
from warp._src.fem.fields.virtual import VirtualField as VirtualField
from warp._src.fem.fields.virtual import make_test as make_test
from warp._src.fem.fields.virtual import make_trial as make_trial
