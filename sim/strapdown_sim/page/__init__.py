"""One self-contained HTML page of a run: curves, status bits, gaps, and an attitude that turns with the cursor."""

from .html import *
