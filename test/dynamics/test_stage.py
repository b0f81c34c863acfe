"""The stage function: the traced model gives what the instance gives, fast, in wind and time."""

import gc
from typing import Any

import numpy as np
import pytest
from dynamics_making import BODY, CLASSES, WIND, add_loads, random_values

from flightdyn.dynamics import (
    Dynamics,
    DynamicsPointMass2DSpeedGamma,
    DynamicsPointMass3DCartesian,
    DynamicsRigidBody3DBodyEuler,
)
from flightdyn.dynamics.mass_properties import MassProperties
from flightdyn.dynamics.stage import KINEMATICS, Model
from flightdyn.environment.wind import PowerLawWind
from flightdyn.errors import InputError


def model(cls: type[Dynamics], **given: Any) -> Model:
    def attach(dyn: Dynamics, controls: Any) -> None:
        add_loads(dyn)
        dyn.add_force(Fx=controls['push'], axes='wind')

    controls = dict.fromkeys(('push', *cls.indirect_controls, *cls.rotor_momenta), (-1.0, 1.0))
    return Model(
        vehicle='test', dynamics=cls, mass_props=BODY, controls=controls, attach=attach, **given
    )


@pytest.mark.parametrize('cls', CLASSES)
def test_the_stage_gives_what_the_instance_gives(cls: type[Dynamics]) -> None:
    stage = model(cls).stage()
    values = random_values(cls) | {'push': 0.7}
    x = np.array([values[name] for name in stage.states])
    u = np.array([values[name] for name in stage.controls])
    dx, outputs = stage.function(x, u, [*WIND, 3.0])
    dyn: Any = cls(BODY, wind=WIND, **{k: float(v) for k, v in values.items() if k != 'push'})
    add_loads(dyn)
    dyn.add_force(Fx=0.7, axes='wind')
    np.testing.assert_allclose(
        dx.full()[:, 0], list(dyn.state_derivatives().values()), rtol=1e-13, atol=1e-13
    )
    named = dict(zip(stage.outputs, outputs.full()[:, 0], strict=True))
    assert set(KINEMATICS) <= {*stage.states, *stage.controls, *named}
    assert named['airspeed'] == pytest.approx(dyn.airspeed)
    assert named['load_factor'] == pytest.approx(dyn.load_factor)
    for name in {'alpha', 'beta', 'phi', 'theta', 'psi'} & set(named):
        if hasattr(dyn, name):
            assert named[name] == pytest.approx(getattr(dyn, name))
    assert named.get('track', dyn.track if hasattr(dyn, 'track') else 0.0) == pytest.approx(
        np.arctan2(dyn.velocity_earth[1], dyn.velocity_earth[0])
    )


@pytest.mark.parametrize('cls', CLASSES)
def test_the_right_hand_side_gives_what_the_stage_gives(cls: type[Dynamics]) -> None:
    stage = model(cls).stage()
    values = random_values(cls) | {'push': 0.7}
    held = {name: float(values[name]) for name in stage.controls}
    function = stage.right_hand_side(held, WIND)
    gc.collect()  # what the compiled function reads must outlive this scope
    for seed in range(3):
        x = np.array([random_values(cls, seed=seed)[name] for name in stage.states])
        expected = stage.function(x, list(held.values()), [*WIND, 0.5])[0].full()[:, 0]
        first = function(0.5, x)
        np.testing.assert_array_equal(first, expected)
        function(0.5, 2 * x)
        np.testing.assert_array_equal(first, expected)  # not overwritten by the next call


def test_missing_and_unknown_controls_are_refused() -> None:
    stage = model(DynamicsPointMass2DSpeedGamma).stage()
    with pytest.raises(InputError, match='also needs the control alpha'):
        stage.right_hand_side({'push': 1.0})
    with pytest.raises(InputError, match="no control 'pusch', did you mean 'push'"):
        stage.right_hand_side({'pusch': 1.0, 'alpha': 1.0})


def test_a_models_own_wind_adds_to_the_parameters() -> None:
    profile = PowerLawWind(speed=10.0, from_deg=270.0, reference_height=10.0, exponent=0.15)
    stage = model(DynamicsPointMass3DCartesian, wind=profile).stage()
    x = dict.fromkeys(stage.states, 0.0) | {'z_e': -100.0, 'u_e': 30.0}
    u = dict.fromkeys(stage.controls, 0.0)
    _, outputs = stage.function([*x.values()], [*u.values()], [1.0, 2.0, 0.5, 0.0])
    airspeed = dict(zip(stage.outputs, outputs.full()[:, 0], strict=True))['airspeed']
    east = 10.0 * 10**0.15 + 2.0  # the westerly blows east
    assert airspeed == pytest.approx(np.sqrt((30 - 1) ** 2 + east**2 + 0.5**2))


def test_forces_and_wind_may_depend_on_time() -> None:
    def attach(dyn: Dynamics, controls: Any) -> None:
        dyn.add_force(Fx=dyn.time, axes='body')

    stage = Model(
        vehicle='test',
        dynamics=DynamicsRigidBody3DBodyEuler,
        mass_props=BODY,
        controls={},
        attach=attach,
        wind=lambda x_e, y_e, z_e, time: (2 * time, 0.0, 0.0),
    ).stage()
    rates = stage.right_hand_side()(3.0, np.zeros(12))
    assert rates[stage.states.index('u_b')] == pytest.approx(3.0 / BODY.mass)
    _, outputs = stage.function(np.zeros(12), [], [0, 0, 0, 3.0])
    assert dict(zip(stage.outputs, outputs.full()[:, 0], strict=True))['airspeed'] == 6.0


def test_extra_states_and_outputs_go_along() -> None:
    def attach(dyn: Dynamics, values: Any) -> dict[str, Any]:
        dyn.add_force(Fx=values['thrust'], axes='body')
        return {'fuel': -values['thrust'] / 3000.0, 'flow': values['thrust'] / 3000.0}

    stage = Model(
        vehicle='test',
        dynamics=DynamicsRigidBody3DBodyEuler,
        mass_props=lambda extra: BODY + MassProperties(mass=extra['fuel']),
        controls={'thrust': (0.0, 10.0)},
        attach=attach,
        extra_states=('fuel',),
    ).stage()
    assert stage.states == (*DynamicsRigidBody3DBodyEuler.states, 'fuel')
    dx, outputs = stage.function([0.0] * 12 + [3.0], [6.0], [0.0] * 4)
    rates = dict(zip(stage.states, dx.full()[:, 0], strict=True))
    assert rates['u_b'] == pytest.approx(6.0 / (BODY.mass + 3.0))
    assert rates['fuel'] == pytest.approx(-0.002)
    assert dict(zip(stage.outputs, outputs.full()[:, 0], strict=True))['flow'] == 0.002
