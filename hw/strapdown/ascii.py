"""Text in plain ASCII, for tools that read nothing else."""

import re
import unicodedata

__all__ = ["ascii_text"]

ASCII = str.maketrans({"×": "x", "·": "*", "ᵀ": "^T", "−": "-", "√": "sqrt",
                       "⊗": " (x) ", "π": "pi", "µ": "u", "°": " deg"})
"""Replacements for common characters outside ASCII. Old tools read their files, comments included, as ASCII."""


def ascii_text(text):
    """Text in printable ASCII: letters without accents, Greek letters by name, escapes for all other characters."""
    text = re.sub("[⁰¹²³⁴-⁹]+", lambda found: "^" + unicodedata.normalize("NFKD", found[0]), text)
    plain = "".join(char for char in unicodedata.normalize("NFKD", text.translate(ASCII))
                    if not unicodedata.combining(char))
    plain = re.sub("([Α-Ωα-ω])(?=([^\\W_])?)", _greek, plain)
    return "".join(char if char.isascii() and char.isprintable() else char.encode("unicode_escape").decode("ascii")
                   for char in plain)


def _greek(found):
    """The name of a Greek letter, set off from a letter or digit that follows: gamma, Phi, gamma_s."""
    _, case, _, name = unicodedata.name(found[1]).split()[:4]
    return (name.capitalize() if case == "CAPITAL" else name.lower()) + ("_" if found[2] else "")
