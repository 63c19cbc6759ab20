"""What is taken where nobody chooses; in a module of its own, so that the command line starts without the steps."""

DEFAULT_PROFILE = "joint"
