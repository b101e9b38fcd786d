"""What a file may not state of places, drives and springs, each refused in one line."""

from pytest import mark

from fourbar.files import loads
from tests.support.rows import read_rows, refused
from tests.support.texts import EVERY_PLACE, HELD, LINE_DRIVEN

FILES = {"places": EVERY_PLACE, "line": LINE_DRIVEN, "point": HELD}
REFUSED = read_rows(r"""
places | arm = | at = | unknown key; must be among bar, force, from_pin
places | from_pin = { x | at = { x | points.Q.at = {'x':
places | point = "P"\n | point = "R"\n | loads[0].point = 'R'
places | point = "P"\n | point = "P"\nbar = 4\n | P is on bar 3
places | arm = | from_pin = ["1 mm", "0 deg"]\narm = | from_pin states the place already
places | Q = { bar = 1, from_pin | Q = { bar = 1, from_centre | the ground has no mass
places | arm = | frame = "bar"\narm = | loads[2].arm
line | [drive] | [drive]\nbar = 4 | drive.bar = 4: unknown key; must be among from, to
line | to = { bar = 4, from_pin = ["9 cm", "0 deg"] } | | drive.to
line | to = { bar = 4 | to = { bar = 1 | drive.to.bar = 1: must be another bar
line | "21 cm", "-60 deg" | "30 cm", "0 deg" | does no work at any position
line | 9 cm | 9 kg | drive.to.from_pin
line | [drive] | [drive]\nforce = 1 | drive.force
point | direction = "90 deg"\n | | drive.direction
point | point = "handle"\n | bar = 2\n | drive.point
point | point = "handle"\n | point = "hand"\n | drive.point = 'hand'
point | point = "handle"\n | from = { bar = 1 }\npoint = "handle"\n | drive.point
point | point = "handle"\n | bar = 1\nfrom_pin = ["1 m", "0 deg"]\n | drive.bar
point | frame = "bar"\n[[ | frame = "body"\n[[ | drive.frame
point | point = "handle"\n | at = ["1 m", "0 deg"]\nbar = 2\n | drive.at
point | point = "handle"\n | bar = 2\nfrom_pin = ["0 m", "0 deg"]\n | bar 1 holds
""")
"""A file, what is replaced in it and by what, and words of the refusal."""


@mark.parametrize("name, old, new, words", REFUSED)
def test_what_a_file_states_wrongly_is_refused_with_what_to_write(
    name, old, new, words
):
    before, after = (text.replace(r"\n", "\n") for text in (old, new))
    text = FILES[name]
    assert before in text
    with refused(words, start="scene.toml: "):
        loads(text.replace(before, after, 1), "scene.toml")
