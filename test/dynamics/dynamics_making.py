"""Instances of every class for tests: one mass, one wind, states and loads at random."""

from typing import Any

import numpy as np

from flightdyn.dynamics import FAMILY, Dynamics, MassProperties

BODY = MassProperties(mass=2.0, Ixx=0.4, Iyy=0.5, Izz=0.7, Ixy=0.05, Iyz=-0.03, Ixz=0.1)
WIND = (7.0, -4.0, 1.5)

CLASSES = FAMILY.values()


def random_values(cls: type[Dynamics], n: int | None = None, seed: int = 11) -> dict[str, Any]:
    """Return states, indirect controls and rotor momenta, away from every singularity."""
    rng = np.random.default_rng(seed)
    names = (*cls.states, *cls.indirect_controls, *cls.rotor_momenta)
    values = {name: rng.uniform(0.2, 1.2, size=n) for name in names}
    return {name: value * (20 if name in FAST else 1) for name, value in values.items()}


FAST = ('speed', 'u_e', 'v_e', 'w_e', 'u_b', 'v_b', 'w_b')


def add_loads(dyn: Dynamics, size: float = 1.0) -> None:
    """Add the weight, and forces and moments in all axes."""
    dyn.add_gravity_force()
    for i, axes in enumerate(('earth', 'body', 'wind', 'stability', 'geometry')):
        dyn.add_force(size, (2.0 - i) * size, -3.0 * size, axes=axes)
        if hasattr(dyn, 'add_moment'):
            dyn.add_moment(0.3 * size, -0.1 * size, (0.2 * i) * size, axes=axes)
