"""Self-contained HTML pages: of a run, with curves, status bits, gaps, and at the cursor attitude and lines of sensors;
and of many runs, with a table."""

from .html import *
from .table import *
