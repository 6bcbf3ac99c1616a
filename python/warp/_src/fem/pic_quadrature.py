"""Quadrature by particles - points in cells by look-up, differentiable by their positions."""

import functools
from types import SimpleNamespace

import numpy as np

import warp as wp
from warp import extend
from warp._src.fem.assembly.incidence import find_incidence, mark_used
from warp._src.fem.kept import Functions
from warp._src.fem.particles import (
    coordinates_kernel,
    count_particles,
    lookup_kernel,
    order_kernel,
)
from warp._src.fem.quadratures import MAKERS, Quadrature, QuadratureRecord
from warp._src.fem.types import Ints, coords_type


def _pic(record: QuadratureRecord, domain: SimpleNamespace) -> SimpleNamespace:
    real, by_domain = record.domain.geometry.scalar, record.detail
    ElementArg = domain.ElementArg
    fields = {"cell_particle_offsets": Ints, "cell_particle_indices": Ints}
    fields |= {"cell_particle_coords": wp.array(dtype=coords_type(real))}
    fields |= {"cell_particle_fraction": wp.array(dtype=real)}
    Arg = extend.struct_from_fields("PicArg", fields, module=__name__)

    @wp.func
    def first(arg: Arg, domain_element: int, element: int):
        if wp.static(by_domain):
            return arg.cell_particle_offsets[domain_element]
        else:
            return arg.cell_particle_offsets[element]

    made = Functions(Arg=Arg)

    @made.add
    def point_count(elements: ElementArg, arg: Arg, domain_element: int, element: int):
        return first(arg, domain_element + 1, element + 1) - first(arg, domain_element, element)

    @made.add
    def point_coords(elements: ElementArg, arg: Arg, domain_element: int, element: int, k: int):
        return arg.cell_particle_coords[first(arg, domain_element, element) + k]

    @made.add
    def point_weight(elements: ElementArg, arg: Arg, domain_element: int, element: int, k: int):
        return arg.cell_particle_fraction[first(arg, domain_element, element) + k]

    @made.add
    def point_index(elements: ElementArg, arg: Arg, domain_element: int, element: int, k: int):
        return arg.cell_particle_indices[first(arg, domain_element, element) + k]

    @made.add
    def point_evaluation_index(
        elements: ElementArg, arg: Arg, domain_element: int, element: int, k: int
    ):
        return first(arg, domain_element, element) + k

    return made


MAKERS["pic"] = _pic


class PicQuadrature(Quadrature):
    """Particles as points; gradients reach their positions and measures.

    Args:
        domain: domain of cells.
        positions: one of: positions in space (n,); a pair (cells, coordinates) of arrays (n,); a
            triple (cells, coordinates, fractions) of arrays (n, m), for particles that are in m
            cells at once.
        measures: measure of each particle (n,); None shares a cell out among its particles.
        env_indices: environment of each particle (n,) of int32, for positions in space.
        requires_grad: gradients are allocated; also where `positions` or `measures` have some.
        max_dist: distance from the domain within which particles count, on grids.
        use_domain_element_indices: cells are numbered as in the domain: less memory, but the
            domain cannot be changed.
        temporary_store: ignored.

    Raises:
        ValueError: shapes do not fit, or environments are missing.
        RuntimeError: the geometry has no hierarchy for look-up on the device.
    """

    def __init__(
        self,
        domain,
        positions,
        measures=None,
        env_indices=None,
        requires_grad: bool = False,
        max_dist: float = 0.0,
        use_domain_element_indices: bool = False,
        temporary_store=None,
    ):
        super().__init__(domain)
        if not domain.is_cells:
            raise ValueError("'domain' expects cells, but got sides")
        self._by_domain = bool(use_domain_element_indices)
        self._requires_grad = requires_grad
        self.particle_fraction = None
        if extend.is_array(positions):
            self._find(positions, env_indices, max_dist)
        else:
            if env_indices is not None:
                raise ValueError("'env_indices' expects positions in space, but got cells")
            self._take(tuple(positions))
        self._order(measures)

    @property
    def record(self) -> QuadratureRecord:
        """Facts that functions of kernels depend on."""
        return QuadratureRecord("pic", self._domain.record, None, None, self._by_domain)

    @property
    def domain(self):
        """Domain of the points; another one of the same geometry may be set."""
        return self._domain

    @domain.setter
    def domain(self, domain) -> None:
        if self._by_domain and domain != self._domain:
            raise RuntimeError("the domain is fixed by 'use_domain_element_indices'")
        if domain.is_cells != self._domain.is_cells or (
            domain.geometry.base is not self._domain.geometry.base
        ):
            raise RuntimeError("'domain' expects cells of the same geometry")
        self._domain = domain
        self.__dict__.pop("_per_device", None)

    def _take(self, given: tuple) -> None:
        if len(given) not in (2, 3) or not all(extend.is_array(array) for array in given):
            raise ValueError(
                "'positions' expects an array, (cells, coordinates) or (cells, coordinates, "
                f"fractions), but got {extend.shown(given)}"
            )
        self.cell_indices, self.particle_coords = given[:2]
        if len(given) == 3:
            self.particle_fraction = given[2]
        shapes = [array.shape for array in given]
        if len(set(shapes)) > 1:
            raise ValueError(f"'positions' expects arrays of one shape, but got {shapes}")

    def _find(self, positions, env_indices, max_dist) -> None:
        domain, device, n = self._domain, positions.device, positions.shape[0]
        real = domain.geometry.scalar_type
        vector = wp.types.vector(domain.geometry.dimension, real)
        if positions.ndim != 1 or not extend.types_equal(positions.dtype, vector):
            raise ValueError(
                f"'positions' expects an array (particles,) of {extend.type_repr(vector)}, but got "
                f"{extend.type_repr(positions.dtype)} of shape {positions.shape}"
            )
        if domain.geometry.environment_count() > 1 and env_indices is None:
            raise ValueError(
                f"'env_indices' expects an array, as the geometry has "
                f"{domain.geometry.environment_count()} environments, but got None"
            )
        if env_indices is not None:
            if not extend.is_array(env_indices) or env_indices.shape != (n,):
                raise ValueError(f"'env_indices' expects an array ({n},), one per particle")
            if env_indices.dtype is not wp.int32:
                numbers = env_indices.numpy()
                if numbers.dtype.kind not in "iu":
                    raise ValueError("'env_indices' expects integers")
                env_indices = wp.array(numbers.astype(np.int32), device=device)
            env_indices = env_indices.to(device)
        if not domain.supports_lookup(device):
            raise RuntimeError(
                f"geometry '{domain.geometry.name}' has no hierarchy for look-up on {device}; "
                "call its 'build_bvh' first"
            )
        grad = self._requires_grad or positions.requires_grad
        self.cell_indices = wp.empty(n, dtype=wp.int32, device=device)
        self.particle_coords = wp.empty(
            n, dtype=coords_type(real), device=device, requires_grad=grad
        )
        kernel = lookup_kernel(domain.record, self._by_domain, env_indices is not None)
        inputs = [domain.domain_arg_value(device), positions, env_indices, real(max_dist)]
        with extend.unrecorded():
            wp.launch(kernel, n, inputs, [self.cell_indices], device=device)
        kernel = coordinates_kernel(domain.record, self._by_domain)
        inputs = [domain.element_arg_value(device), domain.element_index_arg_value(device)]
        inputs += [positions, self.cell_indices]
        wp.launch(kernel, n, inputs, [self.particle_coords], device=device)

    def _order(self, measures) -> None:
        domain, device = self._domain, self.cell_indices.device
        n = self.cell_indices.shape[0]
        if measures is not None and measures.shape != (n,):
            raise ValueError(f"'measures' expects shape ({n},), but got {measures.shape}")
        real = domain.geometry.scalar_type
        count = domain.element_count() if self._by_domain else domain.geometry_element_count()
        cells = self.cell_indices.flatten()
        size = cells.shape[0]
        with extend.unrecorded():
            # Particles outside, whose numbers are no cells, come last.
            order = find_incidence(cells.reshape((size, 1)), count, is_repeated=True)
        self._cell_particle_offsets, items = order.begins, order.positions
        fraction = self.particle_fraction
        grad = self._requires_grad or any(
            array is not None and array.requires_grad
            for array in (self.particle_coords, measures, fraction)
        )
        self._cell_particle_indices = wp.empty(size, dtype=wp.int32, device=device)
        self._cell_particle_coords = wp.empty(
            size, coords_type(real), device=device, requires_grad=grad
        )
        self._cell_particle_fraction = wp.empty(size, dtype=real, device=device, requires_grad=grad)
        kernel = order_kernel(
            domain.record, self._by_domain, measures is not None, fraction is not None
        )
        inputs = [domain.element_arg_value(device), domain.element_index_arg_value(device)]
        inputs += [1 if self.cell_indices.ndim == 1 else self.cell_indices.shape[1], measures]
        inputs += [None if fraction is None else fraction.flatten()]
        inputs += [self.particle_coords.flatten(), cells, self._cell_particle_offsets, items]
        outputs = [
            self._cell_particle_indices,
            self._cell_particle_coords,
            self._cell_particle_fraction,
        ]
        wp.launch(kernel, size, inputs, outputs, device=device)

    def fill_arg(self, arg, device) -> None:
        """Fills an argument of the functions of points."""
        for name in ("offsets", "indices", "coords", "fraction"):
            array = getattr(self, f"_cell_particle_{name}")
            setattr(arg, f"cell_particle_{name}", array.to(device))

    def total_point_count(self) -> int:
        """Number of particles."""
        return self.cell_indices.shape[0]

    def evaluation_point_count(self) -> int:
        """Number of (cell, particle) pairs, those outside included."""
        return self._cell_particle_indices.shape[0]

    @functools.cached_property
    def _counts(self) -> tuple:
        with extend.unrecorded():
            counts = wp.zeros(2, dtype=wp.int32, device=self._cell_particle_offsets.device)
            n = self._cell_particle_offsets.shape[0] - 1
            wp.launch(
                count_particles, n, [self._cell_particle_offsets], [counts], device=counts.device
            )
            return tuple(int(number) for number in counts.numpy())

    def max_points_per_element(self) -> int:
        """Largest number of particles of a cell; waits for the device once."""
        return self._counts[0]

    def active_cell_count(self) -> int:
        """Number of cells with particles; waits for the device once."""
        return self._counts[1]

    def outside_count(self) -> int:
        """Number of (cell, particle) pairs in no cell; waits for the device."""
        return self._cell_particle_indices.shape[0] - int(
            self._cell_particle_offsets[-1:].numpy()[0]
        )

    @property
    def cell_particle_offsets(self):
        """(cells + 1,) of int32: first place of the particles of each cell."""
        return self._cell_particle_offsets

    @property
    def cell_particle_indices(self):
        """Particles in the order of cells."""
        return self._cell_particle_indices

    def fill_element_mask(self, mask) -> None:
        """Sets `mask`, of int32, to 1 for cells with particles, else 0."""
        n = self._cell_particle_offsets.shape[0] - 1
        wp.launch(mark_used, n, [self._cell_particle_offsets, mask], device=mask.device)
