"""Mass properties of simple solid bodies, with their centre of gravity at the origin.

References
----------
.. [1] Meriam, Kraige, *Engineering Mechanics: Dynamics*, table of mass moments of inertia
   (appendix D).
"""

from ..errors import InputError
from ..numpy import Vectorizable
from .mass_properties import MassProperties


def mass_properties_from_radius_of_gyration(
    mass: Vectorizable,
    x_cg: Vectorizable = 0.0,
    y_cg: Vectorizable = 0.0,
    z_cg: Vectorizable = 0.0,
    radius_of_gyration_x: Vectorizable = 0.0,
    radius_of_gyration_y: Vectorizable = 0.0,
    radius_of_gyration_z: Vectorizable = 0.0,
) -> MassProperties:
    """Return mass properties by radii of gyration: Ixx = mass radius_of_gyration_x^2.

    Parameters
    ----------
    mass : Vectorizable
        kg
    x_cg, y_cg, z_cg : Vectorizable
        Centre of gravity [m], body axes.
    radius_of_gyration_x, radius_of_gyration_y, radius_of_gyration_z : Vectorizable
        m, about the axes through the centre of gravity. Fuselage and wing of an aeroplane lie in
        a plane, nearly: there the square of the radius about z is nearly the sum of the others.

    Raises
    ------
    InputError
        If no body has these radii: the square of one exceeds the sum of the other two's.
    """
    return MassProperties(
        mass=mass,
        x_cg=x_cg,
        y_cg=y_cg,
        z_cg=z_cg,
        Ixx=mass * radius_of_gyration_x * radius_of_gyration_x,
        Iyy=mass * radius_of_gyration_y * radius_of_gyration_y,
        Izz=mass * radius_of_gyration_z * radius_of_gyration_z,
    )


def mass_properties_of_ellipsoid(
    mass: Vectorizable, radius_x: Vectorizable, radius_y: Vectorizable, radius_z: Vectorizable
) -> MassProperties:
    """Return mass properties of a solid ellipsoid of mass [kg] and semi-axes [m]."""
    return _of_second_moments(mass, radius_x, radius_y, radius_z, 1 / 5)


def mass_properties_of_sphere(mass: Vectorizable, radius: Vectorizable) -> MassProperties:
    """Return mass properties of a solid sphere of mass [kg] and radius [m]."""
    return mass_properties_of_ellipsoid(mass, radius, radius, radius)


def mass_properties_of_rectangular_prism(
    mass: Vectorizable, length_x: Vectorizable, length_y: Vectorizable, length_z: Vectorizable
) -> MassProperties:
    """Return mass properties of a solid box of mass [kg] and full side lengths [m]."""
    return _of_second_moments(mass, length_x, length_y, length_z, 1 / 12)


def mass_properties_of_cube(mass: Vectorizable, side_length: Vectorizable) -> MassProperties:
    """Return mass properties of a solid cube of mass [kg] and side length [m]."""
    return mass_properties_of_rectangular_prism(mass, side_length, side_length, side_length)


def mass_properties_of_cylinder(
    mass: Vectorizable, radius: Vectorizable, length: Vectorizable, axis: str = 'x'
) -> MassProperties:
    """Return mass properties of a solid cylinder.

    Parameters
    ----------
    mass : Vectorizable
        kg
    radius, length : Vectorizable
        m
    axis : 'x', 'y' or 'z'
        The body axis along its length.

    Raises
    ------
    InputError
        If `axis` is another word.
    """
    if axis not in ('x', 'y', 'z'):
        raise InputError(f"mass_properties_of_cylinder: axis must be 'x', 'y' or 'z': {axis!r}")
    along = mass * radius * radius / 2
    across = mass * (3 * radius * radius + length * length) / 12
    xx, yy, zz = (along if axis == name else across for name in 'xyz')
    return MassProperties(mass=mass, Ixx=xx, Iyy=yy, Izz=zz)


def _of_second_moments(
    mass: Vectorizable, x: Vectorizable, y: Vectorizable, z: Vectorizable, factor: float
) -> MassProperties:
    """Return mass properties of a body whose mean of x^2 is `factor` times its size's square."""
    xx, yy, zz = (mass * factor * size * size for size in (x, y, z))
    return MassProperties(mass=mass, Ixx=yy + zz, Iyy=xx + zz, Izz=xx + yy)
