from fourbar.show.lines import wrap_line


def test_a_name_that_is_longer_than_a_line_stays_whole():
    name = "linkage::upper_left_joint-linkage::lower_left_joint"
    lines = wrap_line(f"joint {name} follows another of this file", 30)
    assert lines == ["joint", f"    {name}", "    follows another of this", "    file"]
