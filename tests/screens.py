"""What a terminal shows: how many lines of how many characters a first screen may take."""

LINES, WIDTH = 25, 80


def count_rows(text, width=WIDTH):
    """The lines of a text as a terminal breaks them."""
    rows = []
    for line in text.splitlines():
        rows += [line[k : k + width] for k in range(0, max(len(line), 1), width)]
    return rows
