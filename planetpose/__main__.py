"""`python -m planetpose` is the command `planetpose`."""

from planetpose_launcher import main

main()
