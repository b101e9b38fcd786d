"""A new scene file: the four lengths filled in, everything else explained in comments."""

from fourbar.linkage import BAR_NAMES, Bar, FourBar

TEXT = """\
title = "New linkage"
source = ""  # where the figures come from

[lengths]
{lengths}
ground_angle = "0 deg"  # from O2 to O4

# A bar that is left out here has no mass. Left out inside: inertia of a uniform bar, centre at mid-bar.
[bars.input]
mass = "{masses[0]!r} kg"  # 1 kg/m
[bars.coupler]
mass = "{masses[1]!r} kg"
# inertia = "0.01 kg m^2"  # about the mass centre G
# centre = ["0.1 m", "0 deg"]  # G from the bar's first pin (O2, A, O4), the angle from the bar's line
[bars.output]
mass = "{masses[2]!r} kg"

[motion]
# theta_2 = "60 deg"  # or {{ from = "0 deg", to = "360 deg", steps = 360 }}; left out: the range of the input
omega_2 = "1 rad/s"  # left out: positions only
# alpha_2 = "0 rad/s^2"
# branch = "crossed"  # left out: open

[drive]
bar = 2  # or 3, 4: the bar that the torque acts on

# Points whose position, velocity and acceleration are wanted: [distance, angle] from the bar's first pin (O2, A, O4).
# [points]
# P = {{ bar = 3, from_pin = ["5 cm", "20 deg"] }}

# As many loads as act; their angles turn with the bar where frame = "bar".
# [[loads]]
# bar = 3
# force = ["10 N", "270 deg"]  # magnitude and direction
# at = ["5 cm", "0 deg"]  # from G
# [[loads]]
# bar = 4
# moment = "-15 N cm"

# [effects]
# gravity = ["9.81 m/s^2", "-90 deg"]
# viscous = {{ O2 = "0.01 N m s/rad" }}
"""


def new_scene(lengths: tuple[str, ...] | list[str]) -> str:
    """The text of a scene file for four lengths (ground, input, coupler, output), written as they were given.

    Bare numbers are metres. Raises InputError for what is no length, and for bars that cannot close.
    """
    from fourbar.files.fields import Reader

    read = Reader("--lengths")
    given = []
    for name, text in zip(BAR_NAMES.values(), lengths, strict=True):
        try:
            given.append((name, f"{float(text)!r} m"))
        except ValueError:
            given.append((name, " ".join(text.split())))
    d, a, b, c = (read.quantity(name, text, "m", positive=True) for name, text in given)
    FourBar(d, Bar(a), Bar(b), Bar(c))
    lines = "\n".join(f'{name} = "{text}"' for name, text in given)
    return TEXT.format(lengths=lines, masses=(a, b, c))
