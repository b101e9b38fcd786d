"""What an MJCF states and the check does not look at."""

import fourbar
from fourbar.mjcf import write_mjcf
from fourbar_validation.places import MODELS
from fourbar_validation.robots.unread import list_unread
from tests.support.rows import read_rows

GENERATED = write_mjcf(fourbar.load(MODELS / "crank_rocker.toml"))
UNREAD = read_rows("""
joint name="O4" | joint name="O4" actuatorfrcrange="-1 1" | joint actuatorfrcrange
island="disable" | island="disable" eulerdamp="disable" | flag eulerdamp
<worldbody> | <statistic meaninertia="2"/><worldbody> | statistic meaninertia
</worldbody> | </worldbody><deformable/> | deformable
""")


def test_what_the_check_does_not_know_is_named_as_not_looked_at():
    assert list_unread(GENERATED) == []
    text = GENERATED
    for old, new, _ in UNREAD:
        assert old in text
        text = text.replace(old, new, 1)
    assert list_unread(text) == sorted(name for _, _, name in UNREAD)
