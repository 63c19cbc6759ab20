"""What is at a position of an image, and where a place of the body is in it: exact, with sigmas, and in words."""
