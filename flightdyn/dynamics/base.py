"""What every Dynamics class shares: loads in any axes, the air, and what follows from both."""

from abc import ABC, abstractmethod
from collections.abc import Callable, Iterator, Mapping, Sequence
from typing import TYPE_CHECKING, Any, ClassVar, Self

from .. import numpy as np
from ..config import suggestion
from ..environment.atmosphere import Atmosphere
from ..environment.wind import ConstantWind, Wind, as_wind
from ..errors import InputError
from ..frames import AXES, Turn, Vector, add, turn
from ..numpy import Vectorizable
from .mass_properties import MassProperties
from .named_values import NamedValues, Names
from .operating_point import OperatingPoint

if TYPE_CHECKING:
    from ..viewing.drawing import Drawing

ZERO: Vector = (0.0, 0.0, 0.0)
G = 9.81  # m/s^2, rounded standard gravity, the default of the textbook problems


class Dynamics(NamedValues, ABC):
    """A vehicle's state, the loads on it, and the equations of motion between them.

    Parameters
    ----------
    mass_props : MassProperties
        Point masses use the mass alone; by default 1 kg.
    wind : (x, y, z) [m/s], or callable (x_e, y_e, z_e, time) -> (x, y, z)
        Where the air moves to, earth axes; by default the air is still. Speed, gamma and track
        stay inertial; wind and stability axes, alpha and beta of rigid bodies, `airspeed` and
        `op_point` are of the velocity through the air.
    time : float
        Passed on to the wind [s].
    atmosphere : callable of altitude [m] -> Atmosphere
        The standard atmosphere by default. The earth is flat and its gravity uniform, so the
        altitude that this default reads is geopotential.
    **values
        State variables, indirect controls and rotor momenta by name; by default 0.

    Values are floats, arrays of one shape (n,), or CasADi expressions (n, 1), mixed as they come.
    Earth axes are north-east-down at a flat, non-rotating earth. Mass and inertia may be arrays,
    but what leaves the vehicle takes its momentum along: thrust is a force.

    Raises
    ------
    InputError
        If a name is not the class's, or arrays differ in length.
    """

    inertia: Names = ()
    """Elements of the inertia tensor that must not be 0."""
    singular_at: ClassVar[Mapping[str, float]] = {}
    """States at which others lose their meaning: no flight can start or end there."""
    loads: Names
    force_axes: ClassVar[str]
    """Default axes of `add_force`."""
    kept_axes: ClassVar[str]
    """Axes in which the loads are summed and the equations written."""

    mass_props: MassProperties
    wind: Wind | None
    time: Vectorizable
    atmosphere: Callable[[Vectorizable], Atmosphere]
    x_e: Vectorizable = 0.0
    y_e: Vectorizable = 0.0
    z_e: Vectorizable = 0.0

    def __init__(
        self,
        mass_props: MassProperties | None = None,
        *,
        wind: Wind | Sequence[Vectorizable] | None = None,
        time: Vectorizable = 0.0,
        atmosphere: Callable[[Vectorizable], Atmosphere] = Atmosphere,
        **values: Vectorizable,
    ) -> None:
        super().__init__(values)
        self.__dict__.update(
            mass_props=MassProperties(mass=1.0) if mass_props is None else mass_props,
            wind=as_wind(wind),
            time=time,
            atmosphere=atmosphere,
            _force=ZERO,
            _gravity=None,
        )
        self._length()  # refuses arrays that do not fit

    _force: Vector
    _gravity: Vectorizable | None

    # ------------------------------------------------------------------ state and controls

    @property
    def control_variables(self) -> dict[str, Vectorizable]:
        """Indirect controls, the accumulated loads, and rotor momenta, by name."""
        indirect = {name: getattr(self, name) for name in self.indirect_controls}
        momenta = {name: getattr(self, name) for name in self.rotor_momenta}
        axes = {letter: self._load(letter) for letter in {name[0] for name in self.loads}}
        loads = {name: axes[name[0]]['xyz'.index(name[1])] for name in self.loads}
        return indirect | loads | momenta

    def _load(self, kind: str) -> Vector:
        """Return the accumulated force ('F'), or moment ('M') where the class has one."""
        return self.convert_axes(*self._force, self.kept_axes, self.force_axes)

    def _surroundings(self) -> dict[str, Any]:
        return {
            'mass_props': self.mass_props,
            'wind': self.wind,
            'time': self.time,
            'atmosphere': self.atmosphere,
        }

    def _columns(self) -> Iterator[tuple[str, Vectorizable]]:
        yield from super()._columns()
        yield 'time', self.time
        yield 'mass', self.mass_props.mass
        yield from zip(('Fx', 'Fy', 'Fz'), self._force, strict=True)

    def _map_columns(self, function: Callable[[Any], Any]) -> Self:
        part = super()._map_columns(function)
        part.__dict__.update(
            mass_props=self.mass_props.map_fields(function),
            time=function(self.time),
            _gravity=function(self._gravity),
            _force=tuple(function(component) for component in self._force),
        )
        if isinstance(self.wind, ConstantWind):
            part.__dict__['wind'] = ConstantWind(*(function(v) for v in self.wind_earth))
        return part

    # ------------------------------------------------------------------ velocity and air

    @property
    @abstractmethod
    def velocity_earth(self) -> Vector:
        """Inertial velocity u_e, v_e, w_e [m/s], earth axes."""

    @property
    @abstractmethod
    def speed(self) -> Vectorizable:
        """Inertial speed [m/s]."""

    @property
    def altitude(self) -> Vectorizable:
        """Height above the origin [m]; 0 where the class has no vertical state."""
        return 0.0 - self.z_e

    @property
    def wind_earth(self) -> Vector:
        """Wind where and when the vehicle is [m/s], earth axes."""
        if self.wind is None:
            return ZERO
        wind = self.wind
        found: Vector = self._once('wind', lambda: wind(self.x_e, self.y_e, self.z_e, self.time))
        return found

    @property
    def air_velocity_earth(self) -> Vector:
        """Velocity through the air [m/s], earth axes."""
        u, v, w = self.velocity_earth
        if self.wind is None:
            return u, v, w
        x, y, z = self.wind_earth
        return u - x, v - y, w - z

    @property
    def airspeed(self) -> Vectorizable:
        """True airspeed [m/s]: the length of the velocity through the air."""
        if self.wind is None:
            return self.speed
        return self._once('airspeed', lambda: np.hypot(*self.air_velocity_earth))

    alpha: Vectorizable = 0.0
    """Angle of attack [deg]."""
    beta: Vectorizable = 0.0
    """Sideslip angle [deg]."""
    p: Vectorizable = 0.0
    q: Vectorizable = 0.0
    r: Vectorizable = 0.0
    """Roll, pitch and yaw rate [rad/s], body axes."""

    @property
    def op_point(self) -> OperatingPoint:
        """What aerodynamics depend on, of the velocity through the air."""
        found: OperatingPoint = self._once('op_point', self._op_point)
        return found

    def _op_point(self) -> OperatingPoint:
        return OperatingPoint(
            atmosphere=self.atmosphere(self.altitude),
            velocity=self.airspeed,
            alpha=self.alpha,
            beta=self.beta,
            p=self.p,
            q=self.q,
            r=self.r,
        )

    # ------------------------------------------------------------------ loads

    def add_force(
        self,
        Fx: Vectorizable = 0.0,
        Fy: Vectorizable = 0.0,
        Fz: Vectorizable = 0.0,
        axes: str | None = None,
    ) -> None:
        """Add a force [N] given in any axes; by default in `force_axes`.

        Raises
        ------
        InputError
            If `axes` is not one of earth, body, wind, stability, geometry.
        """
        force = self.convert_axes(Fx, Fy, Fz, axes or self.force_axes, self.kept_axes)
        self.__dict__['_force'] = add(self._force, force)

    def add_gravity_force(self, g: Vectorizable = G) -> None:
        """Add the weight, down in earth axes; g in m/s^2."""
        self.__dict__['_gravity'] = g if self._gravity is None else self._gravity + g
        self.add_force(Fz=self.mass_props.mass * g, axes='earth')

    @property
    def load_factor(self) -> Vectorizable:
        """Force other than the weight over m x 9.81 m/s^2.

        Along -z of the body for rigid bodies, as an accelerometer has it, and of the wind axes
        for point masses: lift over weight.
        """
        axes = 'body' if 'M' in {name[0] for name in self.loads} else 'wind'
        force = self.convert_axes(*self._force, self.kept_axes, axes)
        if self._gravity is None:
            return -force[2] / (self.mass_props.mass * G)
        weight = self.convert_axes(0.0, 0.0, self.mass_props.mass * self._gravity, 'earth', axes)
        return (weight[2] - force[2]) / (self.mass_props.mass * G)

    @abstractmethod
    def state_derivatives(self) -> dict[str, Vectorizable]:
        """Return d(state)/dt by name, per second, of the accumulated loads."""

    def constrain_derivatives(
        self,
        opti: Any,
        time: Vectorizable,
        method: str = 'trapezoidal',
        which: str | Sequence[str] = 'all',
    ) -> None:
        """Constrain a discretized trajectory to obey the equations of motion.

        Parameters
        ----------
        opti : Opti
            Whose variables the state is made of.
        time : (n,) [s]
        method : str
            One of the rules of `Opti.constrain_derivative`.
        which : 'all' or names of states

        Raises
        ------
        InputError
            If `which` names no state of the class.
        """
        names = self.states if isinstance(which, str) and which == 'all' else which
        names = [names] if isinstance(names, str) else list(names)
        for name in names:
            if name not in self.states:
                raise InputError(
                    f"{type(self).__name__} has no state '{name}'{suggestion(name, self.states)}"
                )
        derivatives = self.state_derivatives()
        for name in names:
            opti.constrain_derivative(
                derivative=derivatives[name],
                variable=getattr(self, name),
                with_respect_to=time,
                method=method,
                name=f'dynamics of {name}',
            )

    # ------------------------------------------------------------------ axes

    def convert_axes(
        self, x: Vectorizable, y: Vectorizable, z: Vectorizable, from_axes: str, to_axes: str
    ) -> Vector:
        """Return the components of a vector in other axes, at the current attitude.

        Raises
        ------
        InputError
            If a name is not one of earth, body, wind, stability, geometry.
        """
        v: Vector = (x, y, z)
        if from_axes == to_axes and from_axes in AXES:
            return v
        there, back = self._lineage(from_axes), self._lineage(to_axes)
        meeting = next(axes for axes in there if axes in back)
        for axes in there[: there.index(meeting)]:
            v = self._to_next(axes, v)
        for axes in reversed(back[: back.index(meeting)]):
            v = self._from_next(axes, v)
        return v

    def _lineage(self, axes: str) -> list[str]:
        """Return the axes passed from given ones to earth axes, both included."""
        if axes not in AXES and axes != self.kept_axes:
            raise InputError(f'axes {axes!r} are unknown; known: {", ".join(AXES)}')
        found = [axes]
        while found[-1] != 'earth':
            found.append(self._next_axes(found[-1]))
        return found

    @abstractmethod
    def _next_axes(self, axes: str) -> str:
        """Return the axes that come after given ones on the way to earth axes."""

    @abstractmethod
    def _to_next(self, axes: str, v: Vector) -> Vector:
        """Return components in the next axes of components in given ones."""

    @abstractmethod
    def _from_next(self, axes: str, v: Vector) -> Vector:
        """Return components in given axes of components in the next ones."""

    def _sines(self, angle: str) -> Turn:
        """Return sine and cosine of an attribute [rad]."""

        found: Turn = self._once(angle, lambda: turn(getattr(self, angle)))
        return found

    # ------------------------------------------------------------------ energy and momentum

    @property
    def translational_kinetic_energy(self) -> Vectorizable:
        """Kinetic energy of the centre of gravity over the ground [J]."""
        return 0.5 * self.mass_props.mass * self.speed**2

    @property
    def rotational_kinetic_energy(self) -> Vectorizable:
        """Kinetic energy of the body's rotation [J], without that of its rotors."""
        return 0.0

    @property
    def kinetic_energy(self) -> Vectorizable:
        """Translational and rotational kinetic energy [J]."""
        return self.translational_kinetic_energy + self.rotational_kinetic_energy

    @property
    def potential_energy(self) -> Vectorizable:
        """Potential energy above the origin [J] in uniform gravity.

        It is of the gravity that was added, of 9.81 m/s^2 before any was.
        """
        g = G if self._gravity is None else self._gravity
        return self.mass_props.mass * g * self.altitude

    @property
    def momentum_earth(self) -> Vector:
        """Linear momentum [kg m/s], earth axes."""
        u, v, w = self.velocity_earth
        mass = self.mass_props.mass
        return mass * u, mass * v, mass * w

    def draw(
        self,
        vehicle_model: Any = None,
        *,
        time: Any = None,
        show: bool = True,
        n_vehicles_to_draw: int | None = None,
        draw_axes: bool = False,
        draw_global_axes: bool = False,
        draw_global_grid: bool = True,
        draw_trajectory_line: bool = True,
        draw_altitude_drape: bool = True,
        draw_ground_plane: bool = True,
    ) -> 'Drawing':
        """Draw the vehicle along its path in three dimensions.

        Parameters
        ----------
        vehicle_model : str, path, mapping or airplane
            What to draw, see `viewing.drawing.vehicle_of`; a small aeroplane unless given.
        time : array (n,) [s]
            Of the states; made of the speeds unless given here or by the instance.
        show : bool
            Open a window, and wait until it is closed.
        n_vehicles_to_draw : int
            Along the path; as many as fit unless given.
        draw_axes, draw_global_axes : bool
            Of the vehicle and of the earth.
        draw_global_grid, draw_trajectory_line, draw_altitude_drape, draw_ground_plane : bool

        Returns
        -------
        Drawing
            With `save('x.rrd')`, `screenshot('x.png')` and `show()`.

        Raises
        ------
        InputError
            If the instance holds symbols or a single state; MissingExtraError without rerun-sdk.
        """
        from ..viewing.drawing import draw

        shown = {
            'axes': draw_axes,
            'earth axes': draw_global_axes,
            'grid': draw_global_grid,
            'path': draw_trajectory_line,
            'curtain': draw_altitude_drape,
            'ground': draw_ground_plane,
        }
        hidden = [name for name, wanted in shown.items() if not wanted]
        return draw(
            self, vehicle_model, time=time, show=show, hidden=hidden, vehicles=n_vehicles_to_draw
        )

    def __repr__(self) -> str:
        values = {**self.state, **{name: getattr(self, name) for name in self.indirect_controls}}
        lines = [f'mass_props={self.mass_props!r}', *(f'{k}={v!r}' for k, v in values.items())]
        return f'{type(self).__name__}({", ".join(lines)})'
