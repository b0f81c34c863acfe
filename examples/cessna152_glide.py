"""The engine of a Cessna 152 stops at 1000 m and 107 kt: how far does it glide, and how?

The plan trades its excess of speed for height, then holds the angle of best glide, and spends
what speed is left on a flare. The audit: energy height (altitude, and kinetic energy as height)
times the best glide ratio is the most there is; what is missing was paid off the best angle.
"""

from common import draw, output_folder, plan, save, tell

import flightdyn as fd
import flightdyn.numpy as np
from flightdyn.planning.planner import Planner
from flightdyn.planning.problem_file import load_problem

FOLDER = output_folder(__doc__)

problem = load_problem('cessna152_glide')
flight = plan(Planner(), problem)
altitude, speed, g = -flight['z_e'], flight['speed'], problem.vehicle.gravity

# the best glide ratio, of a sweep over alpha at the speed and height of sea level and cruise
alpha = np.linspace(-10, 15, 2501)  # deg
state = fd.DynamicsPointMass2DSpeedGamma(speed=speed[0], alpha=alpha)
polar = problem.vehicle.aerodynamics.attach(state, {})
glide = polar['CL'] / polar['CD']
best = np.max(glide)

energy_height = altitude + speed**2 / (2 * g)
bound = energy_height[0] * best
distance = flight['x_e'][-1]
middle = np.linspace(0.1, 0.9, 1001) * flight.duration  # without zoom and flare

save(FOLDER / 'cessna152_glide.csv', flight)
tell(
    FOLDER / 'cessna152_glide.json',
    {
        'range': (distance / 1e3, 'km'),
        'duration': (flight.duration / 60, 'min'),
        'energy height at the start': (energy_height[0], 'm'),
        'best glide ratio': (best, ''),
        'at alpha': (alpha[np.argmax(glide)], 'deg'),
        'most that energy allows': (bound / 1e3, 'km'),
        'reached of it': (100 * distance / bound, '%'),
        'energy height left at the end': (energy_height[-1], 'm'),
        'zoom climb': (np.max(altitude) - altitude[0], 'm'),
        'median alpha': (np.median(flight.sample('alpha', middle)), 'deg'),
        'median speed': (np.median(flight.sample('speed', middle)), 'm/s'),
        'alpha at the end': (flight['alpha'][-1], 'deg'),
        'speed at the end': (speed[-1], 'm/s'),
    },
)
draw(
    FOLDER / 'cessna152_glide.png',
    lambda figures: figures.profile_figure(flight, marked={'alpha': alpha[np.argmax(glide)]}),
)
