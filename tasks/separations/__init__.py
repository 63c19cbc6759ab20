"""Where other bodies than the target are in the image, and how far from it."""
