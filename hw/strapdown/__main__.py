"""``python -m strapdown``: the command line."""

from .cli import main

main()
