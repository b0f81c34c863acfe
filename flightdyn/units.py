"""Units in SI: multiply by a unit to come from it, divide to go to it: `107 * u.knot` is in m/s.

Every value is exact by definition or follows from such, except where its comment says otherwise.
Angles are in radians. The names are those of AeroSandbox's `tools.units`, and a few more.

References
----------
.. [1] NIST Special Publication 811, *Guide for the Use of the International System of Units*,
   2008 edition, appendix B.
.. [2] BIPM, *The International System of Units*, 9th edition, 2019.
"""

from math import pi as pi

# length [m]
meter = 1.0
inch = 0.0254  # international yard and pound agreement, 1959
foot = 0.3048  # 12 inches, written out: the product is off in its last bit
yard = 0.9144
mile = 1609.344
naut_mile = 1852.0  # First International Extraordinary Hydrographic Conference, 1929
kilometer = 1000.0

# time [s]
second = 1.0
minute = 60.0
hour = 60 * minute
day = 24 * hour
week = 7 * day
year = 365.2425 * day  # the mean year of the Gregorian calendar
month = year / 12

# mass [kg]
kg = 1.0
gram = 1e-3
lbm = 0.45359237  # international yard and pound agreement, 1959
pound = lbm
oz = lbm / 16
short_ton = 2000 * lbm
long_ton = 2240 * lbm
tonne = 1000.0

# force [N]
newton = 1.0
g0 = 9.80665  # standard acceleration of free fall [m/s^2], 3rd CGPM, 1901
lbf = lbm * g0
pound_force = lbf
kgf = kg * g0

slug = lbf / foot  # kg: a pound of force gives it a foot per second squared

# speed [m/s]
kph = 1000 / hour
mph = mile / hour
knot = naut_mile / hour
fps = foot
fpm = foot / minute

# angle [rad] and angular rate [rad/s]
rad = 1.0
deg = pi / 180
revolution = 2 * pi
rads_per_sec = 1.0
rps = revolution
rpm = revolution / minute
deg_per_sec = deg

# area [m^2] and volume [m^3]
acre = 4840 * yard**2
hectare = 1e4
liter = 1e-3
gallon_us = 231 * inch**3
gallon_imperial = 4.54609e-3  # Units of Measurement Regulations 1995 (UK)
gallon = gallon_us
quart = gallon / 4

# pressure [Pa]
pascal = 1.0
bar = 1e5
hectopascal = 100.0
atm = 101325.0  # 10th CGPM, 1954
torr = atm / 760
psi = lbf / inch**2
psf = lbf / foot**2
inch_hg = 3386.389  # conventional mercury at 0 degrees C [1], rounded

# energy [J]
joule = 1.0
btu = 1055.05585262  # International Table: 2326 J/kg per lbm and kelvin times 5/9 [1]
calorie = 4.184  # thermochemical [1]
kcal = 1000 * calorie
watt_hour = hour

# power [W]
watt = 1.0
horsepower = 550 * foot * lbf
hp = horsepower

# electric current [A]
amp = 1.0

# prefixes [2]
yocto, zepto, atto, femto = 1e-24, 1e-21, 1e-18, 1e-15
pico, nano, micro, milli = 1e-12, 1e-9, 1e-6, 1e-3
centi, deci, deka, hecto = 1e-2, 1e-1, 1e1, 1e2
kilo, mega, giga, tera = 1e3, 1e6, 1e9, 1e12
peta, exa, zetta, yotta = 1e15, 1e18, 1e21, 1e24

# short names
m, ft, yd, mi, nmi, km = meter, foot, yard, mile, naut_mile, kilometer
kilogram = kg
sec, s, min, hr, wk, yr = second, second, minute, hour, week, year
N = newton
kt = knot
L = liter
Pa, hPa = pascal, hectopascal
