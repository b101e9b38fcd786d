"""Names and titles are somebody's text: characters that would steer a terminal or a reader are shown, not sent."""


def plain(text: str) -> str:
    """The text with every character that does not print, but for the ends of lines, written as its escape."""
    return "".join(c if c.isprintable() or c == "\n" else c.encode("unicode_escape").decode() for c in text)
