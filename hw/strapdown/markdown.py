"""Tables in Markdown."""

__all__ = ["markdown_table"]


def markdown_table(head, rows):
    """A Markdown table.

    Parameters
    ----------
    head : sequence of str
        Titles of the columns. A title that ends in a colon loses it, and its column is aligned right.
    rows : iterable of sequences
        Cells of each row, of any type.
    """
    rule = ["---:" if cell.endswith(":") else "---" for cell in head]
    lines = [[cell.removesuffix(":") for cell in head], rule, *rows]
    return "\n".join(f"| {' | '.join(map(str, line))} |" for line in lines)
