"""One self-contained HTML page of a run: curves, status bits, gaps; at the cursor, attitude and lines of sensors."""

from .html import *
