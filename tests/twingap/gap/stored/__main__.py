"""Make the stored results again."""

from tests.twingap.gap.stored import main

main()
