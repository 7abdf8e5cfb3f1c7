"""`python -m twingap.cli`, for where the script is not on the path."""

from twingap.cli import main

main()
