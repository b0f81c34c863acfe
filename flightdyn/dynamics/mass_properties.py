"""Mass, centre of gravity and inertia of a rigid vehicle, and their sums."""

from collections.abc import Callable, Iterator
from dataclasses import dataclass, fields, replace
from math import isfinite
from typing import Any, Self

import numpy as _np

from .. import numpy as np
from ..errors import InputError
from ..frames import Rotation, Vector, matmul, rotate, transpose
from ..numpy import Vectorizable

TOLERANCE = 1e-6
"""How far the rules of inertia may be missed, relative to the tensor: figures are rounded."""

_LOST_DIGITS = 1e-9  # of the minuend, that a difference may show as unphysical

INERTIA = ('Ixx', 'Iyy', 'Izz', 'Ixy', 'Iyz', 'Ixz')


@dataclass(frozen=True)
class MassProperties:
    """Mass, centre of gravity and inertia of a rigid body; add parts up to make a vehicle.

    Parameters
    ----------
    mass : Vectorizable
        kg; 0 stands for nothing, the start of a sum.
    x_cg, y_cg, z_cg : Vectorizable
        Centre of gravity [m], body axes (forward, right, down), from any fixed reference point.
        The Dynamics classes do not use it: they move the centre of gravity itself.
    Ixx, Iyy, Izz, Ixy, Iyz, Ixz : Vectorizable
        Inertia tensor about the centre of gravity [kg m^2], body axes. The products are tensor
        elements: Ixy = -sum(m x y).

    Each is a number, an array of shape (n,), or a CasADi scalar or column. `rotated` brings what
    is known in other axes here: from geometry axes by `frames.R_BODY_GEOMETRY`.

    Raises
    ------
    InputError
        If numbers are not finite, arrays differ in length, the mass is negative, or no body can
        have the inertia. A body can if no principal moment exceeds the sum of the other two: then
        the matrix of second moments sum(m r r^T) = trace(I)/2 - I has no negative eigenvalue.
        One moment given alone, the rest 0, is the planar inertia of a body that moves in a plane,
        and passes. Symbols are not checked.

    References
    ----------
    .. [1] Wittenburg, *Dynamics of Multibody Systems*, 2nd edition, 2008, chapter 3 (inertia
       tensor, parallel axes, inequalities of the moments).
    """

    mass: Vectorizable = 0.0
    x_cg: Vectorizable = 0.0
    y_cg: Vectorizable = 0.0
    z_cg: Vectorizable = 0.0
    Ixx: Vectorizable = 0.0
    Iyy: Vectorizable = 0.0
    Izz: Vectorizable = 0.0
    Ixy: Vectorizable = 0.0
    Iyz: Vectorizable = 0.0
    Ixz: Vectorizable = 0.0

    __array_ufunc__ = None  # so that `array * mass_properties` is ours to do

    def __post_init__(self) -> None:
        for name in NAMES:
            value = getattr(self, name)
            if isinstance(value, list | tuple):
                object.__setattr__(self, name, np.array(value))
        self._check_numbers()
        self._check_lengths()
        self._check_body(0.0)

    # ------------------------------------------------------------------ checks

    def _check_numbers(self) -> None:
        for name in NAMES:
            value = getattr(self, name)
            if not np.is_symbolic(value) and not _finite(value):
                raise InputError(f'MassProperties: {name} must be finite numbers, got {value!r}')

    def _check_lengths(self) -> None:
        sizes = {name: _size(getattr(self, name)) for name in NAMES}
        if len(set(sizes.values()) - {1}) > 1:
            given = ', '.join(f'{name} has {n}' for name, n in sizes.items() if n != 1)
            raise InputError(f'MassProperties: arrays must be of one length, but {given}')

    def _check_body(self, slack: Vectorizable) -> None:
        """Refuse what no body can have; `slack` is an inertia [kg m^2] too small to matter."""
        if not np.is_symbolic(self.mass) and not _all(self.mass >= 0):
            raise InputError(f'MassProperties: the mass must not be negative, got {self.mass} kg')
        inertia = self._inertia()
        if np.is_symbolic(*inertia):
            return
        possible = _possible(inertia, slack)
        if not _all(possible):
            possible |= _planar(inertia)
        if not _all(possible):
            raise InputError(f'MassProperties: {_why_impossible(inertia, possible)}')
        if np.is_symbolic(self.mass):
            return
        empty = (self.mass == 0) & (abs(self.Ixx) + abs(self.Iyy) + abs(self.Izz) > slack)
        if not _all(empty == 0):
            raise InputError(
                'MassProperties: a mass of 0 has no moments of inertia, got '
                f'Ixx = {self.Ixx}, Iyy = {self.Iyy}, Izz = {self.Izz} kg m^2'
            )

    def is_physically_possible(self) -> bool:
        """Return whether a body in three dimensions can have these values, all of them.

        What is refused is never possible; the planar inertia of a 2D body neither.

        Raises
        ------
        InputError
            If the values are symbols.
        """
        inertia = self._inertia()
        if np.is_symbolic(self.mass, *inertia):
            raise InputError('is_physically_possible: symbols have no values to check')
        return _all(self.mass >= 0) and _all(_possible(inertia, 0.0))

    def is_point_mass(self) -> bool:
        """Return whether the inertia is 0 throughout."""
        return all(
            value.is_zero() if np.is_symbolic(value) else _all(value == 0)
            for value in self._inertia()
        )

    def allclose(self, other: 'MassProperties', rtol: float = 1e-5, atol: float = 1e-8) -> bool:
        """Return whether all values are near those of `other`, as `numpy.allclose` has it."""
        return all(
            np.allclose(getattr(self, name), getattr(other, name), rtol=rtol, atol=atol)
            for name in NAMES
        )

    # ------------------------------------------------------------------ parts

    def map_fields(self, function: Callable[[Vectorizable], Vectorizable]) -> Self:
        """Return these with `function` applied to each value, unchecked: `map_fields(sol.value)`.

        Unchecked because a solver keeps its bounds only to its tolerance.
        """
        twin = object.__new__(type(self))
        for name in NAMES:
            object.__setattr__(twin, name, function(getattr(self, name)))
        return twin

    def __len__(self) -> int:
        """Return the length of the arrays among the values; 1 of scalars."""
        return next((n for n in map(_size, self._values()) if n != 1), 1)

    def __getitem__(self, index: Any) -> Self:
        """Return the values at an index or slice; scalars stay as they are.

        Raises
        ------
        IndexError
            If there are arrays, and the index is not within them.
        """
        n = len(self)
        if n > 1 and isinstance(index, int | _np.integer) and not -n <= index < n:
            raise IndexError(f'index {index} of MassProperties of length {n}')
        if all(isinstance(value, float | int) for value in self._values()):
            return self

        def part(value: Vectorizable) -> Vectorizable:
            if _size(value) > 1:
                return value[index]
            # one value for all, however wrapped; a slice may leave it so
            alone = isinstance(value, _np.ndarray) and not isinstance(index, slice)
            return value.item() if alone else value

        return self.map_fields(part)

    def __iter__(self) -> Iterator[Self]:
        return (self[i] for i in range(len(self)))

    def _values(self) -> list[Vectorizable]:
        return [getattr(self, name) for name in NAMES]

    def _inertia(self) -> tuple[Vectorizable, ...]:
        return self.Ixx, self.Iyy, self.Izz, self.Ixy, self.Iyz, self.Ixz

    @property
    def xyz_cg(self) -> Vector:
        """Centre of gravity [m], body axes."""
        return self.x_cg, self.y_cg, self.z_cg

    # ------------------------------------------------------------------ inertia

    def inertia_rows(self) -> Rotation:
        """Return the inertia tensor about the centre of gravity as 3 x 3 nested tuples."""
        return _rows(*self._inertia())

    def inverse_inertia_rows(self) -> Rotation:
        """Return the inverse of the inertia tensor [1/(kg m^2)] as 3 x 3 nested tuples.

        Raises
        ------
        InputError
            If a tensor of numbers has no inverse: a principal moment is 0.
        """
        xx, yy, zz, xy, yz, xz = self._inertia()
        # cofactors; what is the number 0 here drops out of symbolic expressions
        cxx, cyy, czz = yy * zz - yz * yz, xx * zz - xz * xz, xx * yy - xy * xy
        cxy, cyz, cxz = xz * yz - xy * zz, xy * xz - xx * yz, xy * yz - xz * yy
        det = xx * cxx + xy * cxy + xz * cxz
        if not np.is_symbolic(det) and not _all(det > 0):
            raise InputError(
                f'the inertia tensor has no inverse: Ixx = {xx}, Iyy = {yy}, Izz = {zz}, '
                f'Ixy = {xy}, Iyz = {yz}, Ixz = {xz} kg m^2'
            )
        return _rows(*(c / det for c in (cxx, cyy, czz, cxy, cyz, cxz)))

    @property
    def inertia_tensor(self) -> Vectorizable:
        """Inertia tensor about the centre of gravity [kg m^2], body axes, (3, 3) or (n, 3, 3).

        A CasADi matrix of symbolic scalars; columns of them have `inertia_rows()`.
        """
        return _matrix(self.inertia_rows())

    def inverse_inertia_tensor(self) -> Vectorizable:
        """Return the inverse of `inertia_tensor`, in closed form.

        Raises
        ------
        InputError
            If a tensor of numbers has no inverse: a principal moment is 0.
        """
        return _matrix(self.inverse_inertia_rows())

    inv_inertia_tensor = inverse_inertia_tensor
    """The name AeroSandbox has for it."""

    def get_inertia_tensor_about_point(
        self,
        x: Vectorizable = 0.0,
        y: Vectorizable = 0.0,
        z: Vectorizable = 0.0,
        return_tensor: bool = True,
    ) -> Vectorizable:
        """Return the inertia tensor about a point [kg m^2], body axes, by the parallel axes rule.

        Parameters
        ----------
        x, y, z : Vectorizable
            The point [m], body axes, from the reference point of `xyz_cg`.
        return_tensor : bool
            Whether to return a matrix as `inertia_tensor` does, or the six elements Jxx, Jyy,
            Jzz, Jxy, Jyz, Jxz.
        """
        offset = self.x_cg - x, self.y_cg - y, self.z_cg - z
        elements = _add(self._inertia(), _point(self.mass, offset))
        return _matrix(_rows(*elements)) if return_tensor else elements

    # ------------------------------------------------------------------ moving and adding

    def moved(self, x: Vectorizable = 0.0, y: Vectorizable = 0.0, z: Vectorizable = 0.0) -> Self:
        """Return the body shifted by x, y, z [m], body axes."""
        return replace(self, x_cg=self.x_cg + x, y_cg=self.y_cg + y, z_cg=self.z_cg + z)

    def rotated(self, rotation: Rotation) -> Self:
        """Return centre of gravity and inertia in other axes.

        Parameters
        ----------
        rotation : 3 x 3 nested tuples, or an array
            R_ab takes components in b, where these are given, to a: `frames.R_BODY_GEOMETRY`
            brings what was written in geometry axes to body axes. The reference point stays.

        Raises
        ------
        InputError
            If a matrix of numbers is no rotation.
        """
        if not np.holds_symbols(rotation):
            numbers = _np.array(rotation, dtype=float)
            if numbers.shape[:2] != (3, 3) or not _np.allclose(
                _np.einsum('ij...,kj...->...ik', numbers, numbers), _np.eye(3), atol=1e-6
            ):
                raise InputError(
                    f'rotated: expected a 3 x 3 rotation, orthogonal to 1e-6, got {rotation!r}'
                )
        x, y, z = rotate(rotation, self.xyz_cg)
        turned = matmul(matmul(rotation, self.inertia_rows()), transpose(rotation))
        (xx, xy, xz), (_, yy, yz), (_, _, zz) = turned
        return type(self)(self.mass, x, y, z, xx, yy, zz, xy, yz, xz)

    def __add__(self, other: 'MassProperties') -> Self:
        """Return both bodies, each where it is, as one."""
        if not isinstance(other, MassProperties):
            return NotImplemented
        return self._joined(other, 1.0)

    def __radd__(self, other: Any) -> Self:
        """Return these: `sum([...])` starts from 0."""
        if isinstance(other, int) and other == 0:
            return self
        return NotImplemented

    def __sub__(self, other: 'MassProperties') -> Self:
        """Return what is left of the body when `other`, a part of it, is taken away.

        Raises
        ------
        InputError
            If `other` cannot have been a part of it.
        """
        if not isinstance(other, MassProperties):
            return NotImplemented
        return self._joined(other, -1.0)

    def _joined(self, other: 'MassProperties', sign: float) -> Self:
        mass = self.mass + sign * other.mass
        nothing = mass == 0  # a guard of the quotients; the numerators are 0 there
        x, y, z = (
            (self.mass * a + sign * other.mass * b) / (mass + nothing)
            for a, b in zip(self.xyz_cg, other.xyz_cg, strict=True)
        )
        # With the reduced mass the distance counts once: nothing large cancels.
        apart = tuple(b - a for a, b in zip(self.xyz_cg, other.xyz_cg, strict=True))
        reduced = self.mass * (sign * other.mass) / (mass + nothing)
        inertia = _add(
            self._inertia(),
            (sign * value for value in other._inertia()),
            _point(reduced, apart),
        )
        if sign > 0:
            return type(self)(mass, x, y, z, *inertia)
        made = iter((mass, x, y, z, *inertia))
        rest = self.map_fields(lambda _: next(made))
        rest._check_numbers()
        rest._check_body(_LOST_DIGITS * (self.Ixx + self.Iyy + self.Izz))
        return rest

    def __mul__(self, factor: Vectorizable) -> Self:
        """Return the body with its mass, and inertia, times a factor; its place and size stay."""
        if isinstance(factor, MassProperties):
            return NotImplemented
        inertia = (value * factor for value in self._inertia())
        return type(self)(self.mass * factor, *self.xyz_cg, *inertia)

    __rmul__ = __mul__

    def __truediv__(self, divisor: Vectorizable) -> Self:
        """Return the body with its mass, and inertia, over a divisor."""
        if isinstance(divisor, MassProperties):
            return NotImplemented
        return self.__mul__(1.0 / divisor)


NAMES = tuple(field.name for field in fields(MassProperties))


def _all(condition: Any) -> bool:
    return condition if isinstance(condition, bool) else bool(_np.all(condition))


def _finite(value: Any) -> bool:
    if isinstance(value, float | int):
        return isfinite(value)
    try:
        return _all(_np.isfinite(value))
    except TypeError:  # neither a number nor an array of numbers
        return False


def _size(value: Vectorizable) -> int:
    if np.is_symbolic(value):
        return int(value.numel())
    return 1 if isinstance(value, float | int) else int(_np.size(value))


def _rows(
    xx: Vectorizable,
    yy: Vectorizable,
    zz: Vectorizable,
    xy: Vectorizable,
    yz: Vectorizable,
    xz: Vectorizable,
) -> Rotation:
    return (xx, xy, xz), (xy, yy, yz), (xz, yz, zz)


def _matrix(rows: Rotation) -> Vectorizable:
    elements = [element for row in rows for element in row]
    if np.is_symbolic(*elements):
        if any(_size(element) != 1 for element in elements):
            raise InputError('a symbolic matrix holds one tensor: take [i] of arrays first')
        return np.array([list(row) for row in rows])
    stacked = _np.stack(_np.broadcast_arrays(*elements), axis=-1)
    return stacked.reshape(*stacked.shape[:-1], 3, 3)


def _add(*tensors: Any) -> tuple[Vectorizable, ...]:
    return tuple(sum(elements) for elements in zip(*tensors, strict=True))


def _point(mass: Vectorizable, offset: Any) -> tuple[Vectorizable, ...]:
    """Return the inertia of a point mass about the origin, at an offset from it."""
    x, y, z = offset
    return (
        mass * (y * y + z * z),
        mass * (x * x + z * z),
        mass * (x * x + y * y),
        -mass * x * y,
        -mass * y * z,
        -mass * x * z,
    )


def _possible(inertia: tuple[Vectorizable, ...], slack: Vectorizable) -> Any:
    """Return, element by element, whether a body can have an inertia tensor.

    A symmetric matrix has no negative eigenvalue if none of its principal minors is negative.
    """
    xx, yy, zz, xy, yz, xz = inertia
    half = 0.5 * (xx + yy + zz)
    allowed = TOLERANCE * abs(half) + slack
    sxx, syy, szz = half - xx + allowed, half - yy + allowed, half - zz + allowed
    diagonal = (sxx >= 0) & (syy >= 0) & (szz >= 0)
    if all(isinstance(c, float) and c == 0 for c in (xy, yz, xz)):
        return diagonal
    mxx, myy, mzz = syy * szz - yz * yz, sxx * szz - xz * xz, sxx * syy - xy * xy
    det = sxx * mxx - xy * (xy * szz + yz * xz) - xz * (xy * yz + syy * xz)
    return diagonal & (mxx >= 0) & (myy >= 0) & (mzz >= 0) & (det >= 0)


def _planar(inertia: tuple[Vectorizable, ...]) -> Any:
    """Return, element by element, whether one positive moment is all there is of inertia."""
    xx, yy, zz, xy, yz, xz = inertia
    products = (xy != 0) | (yz != 0) | (xz != 0)
    alone = 0 + (xx != 0) + (yy != 0) + (zz != 0) == 1
    return alone & (xx + yy + zz > 0) & (products == 0)


def _why_impossible(inertia: tuple[Vectorizable, ...], possible: Any) -> str:
    values = _np.stack(_np.broadcast_arrays(*inertia), axis=-1).reshape(-1, 6)
    bad = int(_np.argmin(_np.broadcast_to(_np.ravel(possible), len(values))))
    xx, yy, zz, xy, yz, xz = values[bad]
    principal = _np.linalg.eigvalsh(_np.array(_rows(xx, yy, zz, xy, yz, xz)))
    where = f' at index {bad}' if len(values) > 1 else ''
    given = zip(INERTIA, values[bad], strict=True)
    return (
        f'no body has the inertia {", ".join(f"{name} = {v:g}" for name, v in given)} kg m^2'
        f'{where}: its principal moments {", ".join(f"{v:g}" for v in principal)} must not be '
        'negative, and none may exceed the sum of the other two'
    )
