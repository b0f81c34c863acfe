"""A toy balloon filled with helium is let go: where is it after six hours?

In this model the rubber stretches for ever, so that it rises ever faster; its radius tells that no
real balloon would. Above 86 km the standard atmosphere is extrapolated.
"""

from common import draw, output_folder, save, tell

import flightdyn.numpy as np
from flightdyn.simulation.integrator import integrate
from flightdyn.simulation.scenario import load_scenario

FOLDER = output_folder(__doc__)

scenario = load_scenario('helium_balloon')
stage = scenario.vehicle.model().stage()
times = np.linspace(0, scenario.duration, 361)
# drag settles the speed within tenths of a second: steps of one length would have to be that short
# for six hours, while those of CVODES are as long as the flight is smooth
solution = integrate(stage, scenario.initial, (0.0, scenario.duration), t_eval=times)
flight = solution.to_trajectory(vehicle='balloon')
altitude, radius = -flight['z_e'], flight['radius']

save(FOLDER / 'helium_balloon.csv', flight)
tell(
    FOLDER / 'helium_balloon.json',
    {
        'altitude after six hours': (altitude[-1] / 1e3, 'km'),
        'radius up there': (radius[-1], 'm'),
        'radius at the start': (radius[0], 'm'),
        'altitude at twice the radius': (np.interp(2 * radius[0], radius, altitude) / 1e3, 'km'),
        'speed at the end': (-flight['w_e'][-1], 'm/s'),
    },
)
draw(
    FOLDER / 'helium_balloon.png',
    lambda figures: figures.climb_figure(flight),
)
