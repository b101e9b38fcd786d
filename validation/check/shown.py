"""Text of somebody's file on a terminal: characters that would steer it are shown, not sent."""


def printable(text: str) -> str:
    """The text with every character that does not print written as its escape."""
    return "".join(c if c.isprintable() else c.encode("unicode_escape").decode() for c in text)
