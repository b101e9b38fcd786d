"""Scene files that several tests share, as text, and words exchanged in one."""


def put(text, *words):
    """Return a text with words exchanged that stand in it: each old, then new."""
    for old, new in zip(words[::2], words[1::2], strict=True):
        assert old in text, old
        text = text.replace(old, new)
    return text


COORDINATES = """\
title = "Four-bar from joint coordinates"
[pins]
O2 = ["4.1 cm", "3.75 cm"]
A = ["1.244 cm", "0.196 cm"]
B = ["-2.32 cm", "-2.293 cm"]
O4 = ["0.165 cm", "1.322 cm"]
[motion]
omega_2 = "10 rpm"
[points]
E = { bar = 3, from_pin = { drawn = ["-2.591 cm", "1.657 cm"] } }
"""
HUNG = """\
title = "Weight hung at the tip of the rocker"
[lengths]
ground = "300 mm"
input = "100 mm"
coupler = "250 mm"
output = "220 mm"
[motion]
theta_2 = ["0 deg", "90 deg", "180 deg", "270 deg"]
omega_2 = "0 rad/s"
[[loads]]
bar = 4
force = ["10 N", "-90 deg"]
from_pin = ["300 mm", "0 deg"]
"""
PULL = """\
title = "Force along x at the rocker's end"
[lengths]
ground = "12 cm"
input = "5 cm"
coupler = "10 cm"
output = "8 cm"
[motion]
theta_2 = "60 deg"
omega_2 = "10 deg/s"
alpha_2 = "5 deg/s^2"
[[loads]]
bar = 4
force = ["50 N", "0 deg"]
from_pin = ["8 cm", "0 deg"]
"""
PLIERS = """\
title = "Pliers: effort at the handle, force at the jaw"
[lengths]
ground = "2.4 in"
input = "0.8 in"
coupler = "1.23 in"
output = "1.55 in"
[motion]
theta_2 = "49 deg"
[points]
handle = { bar = 2, from_pin = ["4.26 in", "0 deg"] }
jaw = { bar = 4, from_pin = ["1 in", "0 deg"] }
"""
LENGTHS = """\
[lengths]
ground = "0.3 m"
input = "0.1 m"
coupler = "0.25 m"
output = "0.22 m"
"""
EVERYTHING = f"""\
{LENGTHS}
[motion]
[effects]
gravity = ["9.81 m/s^2", "-90 deg"]
viscous = {{ A = "0.02 N m s/rad", O4 = "0.01 N m s/rad" }}
friction = {{ B = "0.03 N m" }}
flywheel = {{ bar = 4, inertia = "0.01 kg m^2" }}
torsion = {{ B = {{ stiffness = "0.5 N m/rad", rest = "1 rad", preload = "0.1 N m" }} }}
[effects.pin_friction]
A = {{ coefficient = 0.2, radius = "10 mm" }}
O4 = {{ coefficient = 0.1, radius = "20 mm" }}
[[effects.springs]]
from = {{ bar = 1, from_pin = ["0.1 m", "-1.5 rad"] }}
to = {{ bar = 3, from_pin = ["0.08 m", "0.2 rad"] }}
stiffness = "50 N/m"
length = "0.05 m"
[[effects.springs]]
from = {{ bar = 4, from_pin = ["0.1 m", "-1.5 rad"] }}
to = {{ bar = 3, from_pin = ["0.08 m", "0.2 rad"] }}
stiffness = "50 N/m"
length = "0.05 m"
"""
"""An effect of each kind, springs between other bars than neighbours."""

HELD = (
    PLIERS.replace("[points]", 'omega_2 = "1 rad/s"\n[points]')
    + """\
[drive]
point = "handle"
direction = "90 deg"
frame = "bar"
[[loads]]
point = "jaw"
force = ["-1 lbf", "90 deg"]
frame = "bar"
"""
)
"""A hand at the handle, the grip of the jaw as the load."""
EVERY_PLACE = """
[lengths]
ground = "300 mm"
input = "100 mm"
coupler = "250 mm"
output = "220 mm"
[points]
P = { bar = 3, from_centre = ["20 mm", "10 deg"] }
Q = { bar = 1, from_pin = { x = "5 mm", y = "-60 mm" } }
[[loads]]
point = "P"
force = ["1 N", "10 deg"]
[[loads]]
bar = 4
force = ["1 N", "10 deg"]
from_centre = { x = "5 mm", y = "7 mm" }
frame = "bar"
[[loads]]
bar = 2
force = ["1 N", "10 deg"]
arm = ["5 mm", "7 deg"]
[[effects.springs]]
from = { point = "Q" }
to = { point = "P" }
stiffness = "9 N/m"
length = "1 mm"
[[effects.springs]]
from = { bar = 1 }
to = { bar = 4, from_centre = ["3 mm", "0 deg"] }
stiffness = "9 N/m"
length = "1 mm"
"""
"""Places in every form in which a file can state them."""
LINE_DRIVEN = (
    LENGTHS
    + """\
[motion]
theta_2 = "1 rad"
omega_2 = "2 rad/s"
[drive]
from = { bar = 1, from_pin = ["21 cm", "-60 deg"] }
to = { bar = 4, from_pin = ["9 cm", "0 deg"] }
"""
)
"""A cylinder from the ground to the output."""
